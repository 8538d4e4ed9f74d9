"""The shipped simulated rig for sessions of tests on low objects: without the search for the object's top."""

from __future__ import annotations

from pathlib import Path

import yaml

from tactile_lab import rigs

SHIPPED = Path(rigs.__file__).parent


def low_rig(folder: Path) -> Path:
    """A rig file in ``folder``; a session begins with its first grasp, as on a rig that knows its objects to be low."""
    content = yaml.safe_load((SHIPPED / "sim.yaml").read_text())
    content["calibration"] = {role: str(SHIPPED / file) for role, file in content["calibration"].items()}
    content["conductor"] = {"probing": {"top": False}}
    path = folder / "low.yaml"
    path.write_text(yaml.safe_dump(content))
    return path
