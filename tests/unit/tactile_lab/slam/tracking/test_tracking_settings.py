"""Settings of the tracking that do not go together."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from tactile_lab.slam.tracking.trackers import TrackingSettings


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"method": "joint", "shape": {"observations": "offsurface"}}, '"joint" needs shape.observations "normals"'),
        ({"freedom": "space", "dimension": 2}, 'freedom "space" needs dimension 3'),
        ({"freedom": "space", "dimension": 3, "method": "thesis-pf"}, "knows objects on a table only"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        TrackingSettings.model_validate(settings)


def test_the_joint_method_takes_normals() -> None:
    settings = {"method": "joint", "shape": {"observations": "normals"}}
    assert TrackingSettings.model_validate(settings).method == "joint"
