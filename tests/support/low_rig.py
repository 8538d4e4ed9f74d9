"""The packaged simulated rig for test sessions on low objects, without the search for the object's top."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from tactile_lab import rigs

SHIPPED = Path(rigs.__file__).parent

BRISK_WAY = {
    "lift_m": 0.06,
    "travel_m_s": 0.5,
    "descent_m_s": 0.1,
    "landing_m_s": 0.1,
    "links_landing_m_s": 0.1,
}
"""The way to the object takes a seventh of the usual time: most of what a session does, where nothing is on the way."""

BRISK = {
    **BRISK_WAY,
    "turn_rad_s": 3.0,
    "finger_rad_s": 3.0,
    "closing_m_s": 0.045,
    "squeeze_s": 0.3,
}
"""A session takes three fifths of the usual time, and so does what reads it again and again."""


def low_rig(folder: Path, *keys: dict[str, Any], cycle: Mapping[str, float] = MappingProxyType(BRISK)) -> Path:
    """Write a rig file into ``folder``, with further keys; lists and mappings are merged.

    A session starts with its first grasp, as on a rig whose objects are known to be low, and moves briskly; ``cycle``
    says how.
    """
    content = yaml.safe_load((SHIPPED / "sim.yaml").read_text())
    content["calibration"] = {role: str(SHIPPED / file) for role, file in content["calibration"].items()}
    for more in ({"conductor": {"probing": {"top": False}, "cycle": dict(cycle)}}, *keys):
        for key, value in more.items():
            known = content.get(key)
            content[key] = (
                {**known, **value}
                if isinstance(known, dict)
                else [*(known or []), *value]
                if isinstance(value, list)
                else value
            )
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(content))
    return path
