"""Reads the results of a SLAM run from ``results/``, for evaluation and report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import SessionDataError
from tactile_lab.evaluation.files.plain import read_json_object
from tactile_lab.evaluation.files.tables import RERUN, ContactRows, read_contacts
from tactile_lab.evaluation.files.trajectory_file import Trajectory, read_trajectory


@dataclass(frozen=True)
class Results:
    """The results of a SLAM run."""

    trajectory: Trajectory
    contacts: tuple[ContactRows, ...]
    slam: Mapping[str, Any]
    step_seconds: tuple[float, ...]

    @property
    def sigma_quantiles_m(self) -> Array | None:
        """Standard deviation over the contour or surface as percentiles; None without a shape."""
        quantiles = self.slam.get("sigma_quantiles_m")
        return None if quantiles is None else np.array(quantiles, dtype=float)

    @property
    def status(self) -> str:
        """How far to trust them, see :mod:`tactile_lab.slam.doubt.status`; what older files call "ok" is "complete",
        without a known share.
        """
        status = str(self.slam["status"])
        return "complete" if status == "ok" else status

    @property
    def known_share(self) -> float | None:
        """Share of the outline or surface that was touched; None if unknown."""
        share = self.slam.get("known_share")
        return None if share is None else float(share)

    @property
    def dimension(self) -> int:
        """2: a horizontal contour; 3: a surface."""
        return int(self.slam["dimension"])


def read_results(folder: Path) -> Results:
    """Read ``results/``.

    Raises:
        SessionError: a file is missing or not as :func:`write_results` writes it.
    """
    trajectory = read_trajectory(folder / "trajectory.csv")
    slam = read_json_object(folder / "slam.json", hint=RERUN)
    missing = [key for key in ("method", "seed", "dimension", "status", "steps", "loops") if key not in slam]
    if missing:
        raise SessionDataError(f"lacks {', '.join(missing)}", where=str(folder / "slam.json"), hint=RERUN)
    contacts = read_contacts(folder / "contacts.csv", len(trajectory.stamps_s))
    timing = read_json_object(folder / "timing.json", hint=RERUN)
    return Results(trajectory, contacts, slam, tuple(map(float, timing.get("step_seconds", ()))))
