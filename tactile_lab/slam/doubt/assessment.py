"""What may be believed of an estimate: its status, its doubts in words, its alternatives, and its known part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.halves import exchanged
from tactile_lab.slam.doubt.heights import many_heights
from tactile_lab.slam.doubt.known_part import known_part, reach_for, with_guesses_told
from tactile_lab.slam.doubt.missing_parts import missing_parts
from tactile_lab.slam.doubt.rivals import alternatives, costs_above, doubts_of, turned_by_symmetry
from tactile_lab.slam.doubt.signs import signs
from tactile_lab.slam.doubt.sizes import unknown_sizes
from tactile_lab.slam.doubt.status import (
    LARGEST_REFUSED_SHARE,
    LEAST_GRASPS,
    Alternative,
    Doubt,
    Status,
    status_of,
)
from tactile_lab.slam.doubt.symmetry import NEARLY_ALIKE_m, Symmetry, symmetry_of
from tactile_lab.slam.doubt.unfelt_top import doubts_of_top
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.tracker import Tracker
from tactile_lab.slam.tracking.trackers import TrackingSettings

_ENOUGH_TO_SEE = 0.8
"""Known share of a shape whose symmetry counts: turns that no contact could tell."""


@dataclass(frozen=True)
class Assessment:
    """What may be believed of an estimate.

    Attributes:
        status: see :mod:`tactile_lab.slam.doubt.status`.
        shape: the outline or surface, with its known part, and a standard deviation of the rest that says it is a
            guess; None without one.
        known_share: share of the shape that was touched; None without a shape.
        doubts: all reasons to doubt it.
        alternatives: other placings of grasps, the most likely first.
    """

    status: Status
    shape: Contour | SurfaceMesh | None
    known_share: float | None
    doubts: tuple[Doubt, ...]
    alternatives: tuple[Alternative, ...]


def assess(
    tracker: Tracker | None,
    shape: Contour | SurfaceMesh | None,
    settings: TrackingSettings,
    refused: Sequence[bool],
    *,
    lost: bool,
    origin_height_m: float,
    heights_m: Array,
    has_ended: bool = True,
) -> Assessment:
    """Assess an estimate.

    Args:
        tracker: None if no object frame was ever defined.
        shape: the outline or surface, object frame.
        settings: of the estimation.
        refused: of every grasp, whether it could not be placed.
        lost: whether the object could not be followed.
        origin_height_m: height of the object frame's origin over the table.
        heights_m: of the contacts of an outline over the table, shape (n,); none of a surface.
        has_ended: no grasp follows. Before, only the trajectories that are still kept count as alternatives; at the
            end more are searched for.
    """
    if tracker is None:
        return Assessment("lost", shape, None, (), ())
    contact_map = tracker.refined
    share, missing = None, list[Doubt]()
    if shape is not None:
        stands = settings.freedom == "table"
        floor_m = -origin_height_m if stands else None
        reach_m = reach_for(contact_map.contacts, sum(grasp.used for grasp in contact_map.placed))
        part = known_part(shape, contact_map.contacts, floor_m, contact_map.free_points_m, reach_m=reach_m)
        if isinstance(shape, SurfaceMesh):
            missing = [*missing_parts(contact_map, shape, floor_m), *doubts_of_top(shape, part.unfelt)]
        shape, share = with_guesses_told(shape, part), part.share
    symmetry = symmetry_of(shape) if shape is not None and share is not None and share >= _ENOUGH_TO_SEE else None
    if has_ended:
        others = _alternatives(tracker, contact_map, settings, shape, symmetry, origin_height_m)
    else:
        others = _kept_alternatives(tracker, symmetry, origin_height_m)
    doubts = (
        *signs(contact_map, settings.motion, poses_given=settings.method == "known-pose"),
        *(exchanged(contact_map) if has_ended else ()),
        *doubts_of(others),
        *_refused(refused),
        *_few(len(refused) - sum(refused)),
        *unknown_sizes(shape, contact_map.contacts.points_m),
        *missing,
        *many_heights(heights_m),
        *(
            [Doubt("symmetry", symmetry.words, grave=False)]
            if symmetry is not None and symmetry.interchangeable
            else []
        ),
    )
    status = status_of(lost=lost, known_share=share, doubts=doubts)
    return Assessment(status, shape, share, doubts, others)


def _alternatives(
    tracker: Tracker,
    contact_map: ContactMap,
    settings: TrackingSettings,
    shape: Contour | SurfaceMesh | None,
    symmetry: Symmetry | None,
    origin_height_m: float,
) -> tuple[Alternative, ...]:
    """Those of method "joint", which compares trajectories by their evidence."""
    if not isinstance(tracker, JointTracker):
        return ()
    found = costs_above(tracker.hypotheses[0], tracker.rivals)
    near = None if shape is None else symmetry_of(shape, NEARLY_ALIKE_m)
    if near is not None:
        found += turned_by_symmetry(contact_map, near, settings.motion, settings.joint.proposals.unexplained_cost)
    return alternatives(contact_map, found, symmetry, origin_height_m)


def _kept_alternatives(tracker: Tracker, symmetry: Symmetry | None, origin_height_m: float) -> tuple[Alternative, ...]:
    if not isinstance(tracker, JointTracker):
        return ()
    found = costs_above(tracker.hypotheses[0], tracker.contenders)
    return alternatives(tracker.map, found, symmetry, origin_height_m)


def _refused(refused: Sequence[bool]) -> list[Doubt]:
    grasps = tuple(index for index, each in enumerate(refused) if each)
    if len(grasps) <= LARGEST_REFUSED_SHARE * len(refused):
        return []
    words = f"{len(grasps)} of {len(refused)} grasps could not be placed: the object may have been elsewhere then"
    return [Doubt("refused-grasps", words, grasps, grave=False)]


def _few(placed: int) -> list[Doubt]:
    if placed >= LEAST_GRASPS:
        return []
    words = f"only {placed} grasp{'' if placed == 1 else 's'} could be placed: nothing confirms the shape"
    return [Doubt("few-grasps", words, grave=False)]
