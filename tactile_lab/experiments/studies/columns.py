"""Columns of the tables that several experiments share."""

from __future__ import annotations

from tactile_lab.experiments.groups import Column

HAUSDORFF = Column("Hausdorff, mm", "hausdorff_mm")
MEAN_DISTANCE = Column("mean distance, mm", "mean_mm", kind="median")
REGISTRATION = Column("registration, mm", "registration_mm")
STEP = Column("step, ms: median / p95", "step_ms", 0, kind="pooled")
FINISH = Column("end, ms", "finish_ms", 0, kind="median")
COVERED = Column("within 2 sigma", "within_2_sigma", 0, kind="percent")
AGAINST_KNOWN = Column("Hausdorff, mm", "hausdorff_mm", 2, versus=True)
POSES_INSIDE = Column("poses inside 50 / 68 / 95 %", "poses_inside", 0, kind="shares")
SURFACE_INSIDE = Column("surface inside 50 / 68 / 95 %", "surface_inside", 0, kind="shares")
SIZES_INSIDE = Column("sizes within 1 / 2 / 3 sigma", "size_z", 0, kind="within")
TRACKING_COLUMNS = (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION, COVERED, POSES_INSIDE, SURFACE_INSIDE, STEP, FINISH)
SHAPE_COLUMNS = (HAUSDORFF, Column("mean Hausdorff, mm", "hausdorff_mm", 1, kind="mean"), MEAN_DISTANCE, COVERED)
