"""All experiments by name."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.core.errors import ConfigurationError
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.studies import (
    ablation,
    carrying,
    consistency,
    everyday,
    exploration,
    laboratory,
    planar,
    solids,
    thesis_drawings,
    thesis_exploration,
    thesis_figures,
)

EXPERIMENTS: Mapping[str, Experiment] = {
    study.name: study
    for study in (
        planar.METHODS_2D,
        solids.METHODS_3D,
        solids.EVERYDAY,
        solids.EVERYDAY_2D,
        solids.EVERYDAY_SHAPE,
        solids.KNOWN_SHAPE,
        solids.SOLID_LIMIT,
        solids.FELT_3D,
        solids.FELT_LIMIT,
        solids.METHODS_6DOF,
        ablation.ABLATION,
        consistency.CONSISTENCY,
        planar.FELT_2D,
        planar.CONTOUR_LIMIT,
        planar.RANDOM_CONTACTS,
        thesis_figures.FIGURE_2_7,
        thesis_figures.FIGURE_2_12,
        thesis_figures.FIGURE_3_12,
        thesis_figures.FIGURE_3_14,
        thesis_figures.FIGURE_3_15,
        thesis_figures.FIGURE_3_16,
        thesis_figures.FIGURE_3_20,
        thesis_figures.FIGURE_3_21,
        thesis_figures.THESIS_READINGS,
        *thesis_drawings.ALL,
        *thesis_exploration.ALL,
        exploration.TABLE_4_2,
        exploration.TABLE_4_3,
        exploration.EXPLORATION_HAND,
        exploration.EXPLORATION_KINEMATIC,
        exploration.EXPLORATION_FELT,
        everyday.EVERYDAY_OBJECTS,
        everyday.HANDS,
        carrying.CARRIES,
        carrying.CARRIED_3D,
        carrying.WEIGHING,
        laboratory.CAMERA_TRUTH,
        laboratory.GRAPH_STRESS,
        laboratory.CALIBRATE_FOREARM,
        laboratory.FOREARM_ON_RIG,
        laboratory.CALIBRATE_FINGERTIP,
        laboratory.CRASH_RECOVERY,
    )
}
"""Every experiment by its name."""


def experiment(name: str) -> Experiment:
    """The experiment named ``name``. Raises ConfigurationError if there is none."""
    if name not in EXPERIMENTS:
        hint = f"Available experiments: {', '.join(EXPERIMENTS)}"
        raise ConfigurationError(f"there is no experiment {name!r}", where="experiment", hint=hint)
    return EXPERIMENTS[name]
