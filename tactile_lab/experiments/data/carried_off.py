"""Grasps of an object that somebody moves in between, which the hand's motion does not show."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from gtsam import Pose3

from drivers.core.contacts import ApproachPath, Contact, Grasp
from tactile_lab.experiments.data.sensing import SimulatedGrasps

_Data = TypeVar("_Data", bound=SimulatedGrasps)


def carried_off(data: _Data, at: int, jump: Pose3) -> _Data:
    """The session with the object moved by ``jump``, world frame, just before grasp ``at``.

    The hand grasps it in its new place, but its motion between the two grasps is that of before.
    """
    later = [_moved(grasp, jump) for grasp in data.grasps[at:]]
    later[0] = replace(later[0], hand_motion_world=data.grasps[at].hand_motion_world)
    poses = [jump * pose for pose in data.world_T_body[at:]]
    return replace(data, grasps=(*data.grasps[:at], *later), world_T_body=(*data.world_T_body[:at], *poses))


def _moved(grasp: Grasp, jump: Pose3) -> Grasp:
    return replace(
        grasp,
        contacts=tuple(_moved_contact(one, jump) for one in grasp.contacts),
        approach_paths=tuple(_moved_path(path, jump) for path in grasp.approach_paths),
        hand_motion_world=jump * grasp.hand_motion_world * jump.inverse(),
    )


def _moved_contact(contact: Contact, jump: Pose3) -> Contact:
    turn = jump.rotation()
    normal = turn.rotate(contact.normal_world)
    return replace(contact, point_world_m=jump.transformFrom(contact.point_world_m), normal_world=normal)


def _moved_path(path: ApproachPath, jump: Pose3) -> ApproachPath:
    start, end = (jump.transformFrom(point) for point in (path.start_world_m, path.end_world_m))
    return replace(path, start_world_m=start, end_world_m=end)
