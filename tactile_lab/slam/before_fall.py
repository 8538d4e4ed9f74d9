"""What was known of an object until it fell over: more, perhaps, than what was felt of it since.

A fall changes where an object is, not what it is. The session goes on with a new object frame, but where it ends soon
afterwards, or the object is not found again, the model from before the fall is the better one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.result import SlamResult

_Entry = TypeVar("_Entry")

_WORTH_A_POSE = 0.1
"""Share of a shape that is worth as much as knowing where the object is now."""


def better_known(before: SlamResult | None, since: SlamResult) -> SlamResult:
    """The result that knows more of the shape, with an entry for every grasp.

    Args:
        before: of the grasps until the object fell over, None if it never did; its poses since are unknown.
        since: of all grasps; those before the fall have no pose.
    """
    if before is None or not _is_better(before, since):
        return since
    fallen, count = len(before.world_T_object), len(since.world_T_object)
    words = f"the object fell over before grasp {fallen + 1}: the model is what was known of it until then"
    return replace(
        before,
        world_T_object=_padded(before.world_T_object, count),
        covariances=_padded(before.covariances, count),
        common_covariances=_padded(before.common_covariances, count) if before.common_covariances else (),
        steps=since.steps,
        loops=since.loops,
        status="partial" if before.status == "complete" else before.status,
        doubts=(*before.doubts, Doubt("fell", words, (fallen,), grave=False)),
    )


def _is_better(before: SlamResult, since: SlamResult) -> bool:
    """Whether it knows so much more that the present pose, which only the other one has, is worth less."""
    if "lost" in {before.status, since.status} and before.status != since.status:
        return since.status == "lost"
    return (before.known_share or 0.0) > (since.known_share or 0.0) + _WORTH_A_POSE


def _padded(entries: tuple[_Entry | None, ...], count: int) -> tuple[_Entry | None, ...]:
    return (*entries, *[None] * (count - len(entries)))
