"""Columns of the tables that several experiments share."""

from __future__ import annotations

from tactile_lab.experiments.summary import Column

HAUSDORFF = Column("Hausdorff, mm", "hausdorff_mm")
MEAN_DISTANCE = Column("mean distance, mm", "mean_mm", kind="median")
REGISTRATION = Column("registration, mm", "registration_mm")
STEP = Column("step, ms: median / p95", "step_ms", 0, kind="pooled")
FINISH = Column("end, ms", "finish_ms", 0, kind="median")
COVERED = Column("within 2 sigma", "within_2_sigma", 0, kind="percent")
AGAINST_KNOWN = Column("Hausdorff, mm", "hausdorff_mm", 2, versus=True)
TRACKING_COLUMNS = (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION, COVERED, STEP, FINISH)
SHAPE_COLUMNS = (HAUSDORFF, Column("mean Hausdorff, mm", "hausdorff_mm", 1, kind="mean"), MEAN_DISTANCE, COVERED)
