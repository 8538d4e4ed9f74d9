"""What may be believed of the present estimate, as plain data for recording and page (topic ``/slam/state``)."""

from __future__ import annotations

from typing import Any

from tactile_lab.slam.doubt.assessment import Assessment


def trust_message(found: Assessment) -> dict[str, Any]:
    """The status, the share of the shape that was touched, and doubts and alternatives as sentences."""
    return {
        "status": found.status,
        "known_share": found.known_share,
        "doubts": [doubt.words for doubt in found.doubts],
        "alternatives": [one.words() for one in found.alternatives],
    }
