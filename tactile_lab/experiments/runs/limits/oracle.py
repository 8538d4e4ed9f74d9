"""The smallest number of grasps if all is known in advance, even the errors of execution: a bound for every policy.

Each candidate is executed several times before the run, with random errors. A beam search selects the fewest of these
executions whose contacts explore the contour: first by what each of them explores alone, then together.
"""

from __future__ import annotations

import numpy as np
from gtsam import Pose2
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array, Grasp
from tactile_lab.experiments.coverage_criteria import CONTACT_m, Definition, ExploredMap
from tactile_lab.experiments.data.planar_hand import PlanarHand

_EXECUTIONS = 60
_BEAM, _BRANCHES, _JUDGED = 60, 8, 3
_NEARLY = 0.12
Chosen = tuple[int, ...]


def fewest_grasps(
    hand: PlanarHand, palms: Array, definition: Definition, true_points_m: Array, goal: float, most: int
) -> int:
    """Smallest number of grasps found that explores the share ``goal`` of the contour; ``most`` if none does.

    Args:
        hand: executes grasps on the object at the origin.
        palms: candidates, shape (n, 3).
        definition: definition of coverage.
        true_points_m: of the contour, shape (m, 2).
        goal: share of them to explore.
        most: largest number of grasps to try.
    """
    repeats = max(1, _EXECUTIONS // len(palms))
    grasps = [hand.grasp(0, Pose2(*palm), Pose2()) for palm in np.repeat(palms, repeats, axis=0)]
    alone = np.array([_near(grasp, true_points_m) for grasp in grasps])
    beam: list[tuple[NDArray[np.bool_], Chosen]] = [(np.zeros(len(true_points_m), dtype=bool), ())]
    for count in range(1, most + 1):
        beam = _extend(beam, alone)
        for covered, chosen in beam[:_JUDGED]:
            if covered.mean() > goal - _NEARLY and _share(grasps, chosen, definition, true_points_m) >= goal:
                return count
    return most


def _extend(
    beam: list[tuple[NDArray[np.bool_], Chosen]], alone: NDArray[np.bool_]
) -> list[tuple[NDArray[np.bool_], Chosen]]:
    """The sets with one more grasp that cover most."""
    found: dict[Chosen, NDArray[np.bool_]] = {}
    for covered, chosen in beam:
        gains = (alone & ~covered).sum(axis=1)
        for index in np.argsort(-gains)[:_BRANCHES]:
            found[tuple(sorted((*chosen, int(index))))] = covered | alone[index]
    ranked = sorted(found.items(), key=lambda item: -int(item[1].sum()))[:_BEAM]
    return [(covered, chosen) for chosen, covered in ranked]


def _near(grasp: Grasp, true_points_m: Array) -> NDArray[np.bool_]:
    if not grasp.contacts:
        return np.zeros(len(true_points_m), dtype=bool)
    return np.asarray(cKDTree(grasp.points_world_m[:, :2]).query(true_points_m)[0] < CONTACT_m)


def _share(grasps: list[Grasp], chosen: Chosen, definition: Definition, true_points_m: Array) -> float:
    points = np.concatenate([grasps[index].points_world_m[:, :2] for index in chosen])
    normals = np.concatenate([grasps[index].normals_world[:, :2] for index in chosen])
    return float(ExploredMap.of(points, normals).explored_points(definition, true_points_m).mean())
