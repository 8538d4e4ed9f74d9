"""The error figures of an evaluation, in the units people read: millimetres, degrees, shares."""

from __future__ import annotations

from dataclasses import dataclass

from tactile_lab.shape.metrics import ShapeErrors


@dataclass(frozen=True)
class ShapeFigures:
    """Shape errors for people: millimetres, and shares between 0 and 1."""

    hausdorff_mm: float
    mean_distance_mm: float
    chamfer_mm: float
    fscore_5mm: float
    iou: float

    @classmethod
    def of(cls, errors: ShapeErrors | None) -> ShapeFigures | None:
        """The figures of shape errors in metres."""
        if errors is None:
            return None
        return cls(
            hausdorff_mm=1e3 * errors.hausdorff_m,
            mean_distance_mm=1e3 * errors.mean_distance_m,
            chamfer_mm=1e3 * errors.chamfer_m,
            fscore_5mm=errors.fscore_5mm,
            iou=errors.iou,
        )


@dataclass(frozen=True)
class LoopFigures:
    """Similar grasps: how many were tested, accepted, and of those wrong (None where the truth is not known)."""

    tested: int
    accepted: int
    wrong: int | None


@dataclass(frozen=True)
class TimeFigures:
    """Computing time of the SLAM steps."""

    total_s: float | None
    step_ms_median: float | None
    step_ms_p95: float | None


@dataclass(frozen=True)
class SensingFigures:
    """Distance of the felt contacts from the true surface at the true pose: what the sensing alone gets wrong."""

    median_mm: float
    p95_mm: float


@dataclass(frozen=True)
class UncertaintyFigures:
    """What the estimate says of itself: the standard deviation of its contour or surface, over all its points."""

    sigma_mm_median: float
    sigma_mm_p95: float


@dataclass(frozen=True)
class TruthFigures:
    """For how many grasps the true pose is known, for how many not, and whether the true shape is."""

    seen: int
    missing: int
    mesh: bool
