"""The packaged simulated rig for test sessions on low objects, without the search for the object's top."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from tactile_lab import rigs

SHIPPED = Path(rigs.__file__).parent


def low_rig(folder: Path, *keys: dict[str, Any]) -> Path:
    """Write a rig file into ``folder``, with further keys; lists and mappings are merged.

    A session starts with its first grasp, as on a rig whose objects are known to be low.
    """
    content = yaml.safe_load((SHIPPED / "sim.yaml").read_text())
    content["calibration"] = {role: str(SHIPPED / file) for role, file in content["calibration"].items()}
    for more in ({"conductor": {"probing": {"top": False}}}, *keys):
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
