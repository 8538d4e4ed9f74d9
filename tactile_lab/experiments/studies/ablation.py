"""What each mechanism of the default method is worth."""

from __future__ import annotations

from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs import ablation_runs
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, ranges

ABLATION = Experiment(
    "ablation",
    "The default method with one mechanism left out at a time, in the plane, with wrong contacts and in space.",
    ablation_runs.settings,
    ablation_runs.track_without,
    (
        Column("runs that come out the same", "same", 0, kind="percent"),
        Column("registration, mm", "registration_mm", 2, kind="paired", most=10.0),
        Column("Hausdorff, mm", "hausdorff_mm", 2, kind="paired", most=20.0),
        Column("within 2 sigma", "within_2_sigma", 2, kind="paired"),
        Column("failed share", "failed", 2, kind="paired"),
        Column("steps, ms", "step_ms", 0, kind="paired"),
        Column("end, ms", "finish_ms", 0, kind="paired"),
        Column("registration, mm", "registration_mm"),
        Column("Hausdorff, mm", "hausdorff_mm"),
        Column("step, ms: median / p95", "step_ms", 0, kind="pooled"),
        Column("end, ms", "finish_ms", 0, kind="median"),
    ),
    ranges("without", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: str(cell["condition"]), columns=1),
    pooled=("shape", "grasps"),
)
