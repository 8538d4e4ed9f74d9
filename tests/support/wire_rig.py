"""The packaged sim-wire rig with its own cable, addresses and time limits, so that tests can run in parallel."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from tactile_lab import rigs

SHIPPED = Path(rigs.__file__).parent


def wire_rig(folder: Path, shipped: str = "sim-wire", **changes: Any) -> Path:
    """Write a rig file into ``folder``: with long time limits for a busy machine, and without the check of the motor
    map.

    Args:
        folder: the folder of the file.
        shipped: which of the packaged rigs.
        changes: keys of the rig file to replace.
    """
    content = yaml.safe_load((SHIPPED / f"{shipped}.yaml").read_text())
    content["calibration"] = {role: str(SHIPPED / file) for role, file in content["calibration"].items()}
    wires, net = content["wires"], f"127.{1 + os.getpid() % 250}.{os.getpid() // 250 % 250}"
    ethercat = {"interface": f"tln{os.getpid()}", "master": {"answer_s": 0.02, "setup_answer_s": 0.2}}
    wires["hand"] |= {"ethercat": ethercat, "far_end": f"tlf{os.getpid()}", "first_move": False, "patience_s": 60.0}
    wires["base"]["host"], wires["camera"]["host"] = f"{net}.20", f"{net}.21"
    for number, wire in enumerate(wires["fingertips"].values()):
        wire["host"] = f"{net}.{11 + number}"
    content["hand"] |= {"cycle_s": 0.004}
    content["base"] |= {"lost_limit": 100} | ({"watchdog_hz": 2.0} if shipped == "sim-ur" else {})
    content["conductor"]["probing"] = {"top": False}  # 15 s of real time in every session
    brisk = {"landing_m_s": 0.05, "links_landing_m_s": 0.05}  # 10 s of real time in every grasp: the top is not known
    content["conductor"]["cycle"] = content["conductor"].get("cycle", {}) | brisk
    content["conductor"]["safety"] = {"tip_stale_s": 2.0, "stale_s": 5.0, "first_moves_scale": 1.0}
    path = folder / "wire.yaml"
    path.write_text(yaml.safe_dump(content | changes))
    return path
