"""The joints' calibration on a rig: a block on its table, the wizard's plan, and its measurer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from calibration.forearm.placement import load_forearm
from calibration.forearm.record import check_hand, check_origin
from calibration.forearm.recordings import FORMAT, ForearmData, load_data
from calibration.forearm.wizard import solve_forearm
from calibration.hand.block_plan import FINGERS, load_block, plan_block
from calibration.hand.block_problem import BlockSettings, BlockWizard, is_of_block, solve_block
from calibration.hand.joints import JointCorrection, JointLimits, JointPose, from_contacts, from_poses, load_poses
from calibration.hand.pose_steps import PlannedPose, PoseSteps
from calibration.steps.geometry import Block
from calibration.steps.quality import Judgement
from calibration.steps.refinement import JointOffset
from calibration.store.store import Covariance
from drivers.core.configuration import StrictModel, load, load_model
from drivers.core.errors import ConfigurationError
from drivers.simulation.objects import object_model
from drivers.simulation.settings import ObjectStart
from sessions.measuring.calibration_measurer import CalibrationMeasurer, MeasurerSettings
from sessions.measuring.held_hand import HeldHand
from sessions.recording.recorder import TrafficSink
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.laboratory import connected_runtime
from tactile_lab.rigs.wired import hand_form
from tactile_lab.workflow.calibrating_forearm import clear_table, tip_shapes

BLOCK = "box-12x6x6"
"""The object that a simulated rig has for a block."""

_STEEL_kg = 3.4


class JointSettings(StrictModel):
    """A file of settings for ``calibrate joints``.

    Attributes:
        block: errors and limits of the touches, and the least of them.
        limits: what the corrections must keep to.
        measurer: how the hand moves.
    """

    renamed: ClassVar = {"station": "measurer"}

    block: BlockSettings = BlockSettings()
    limits: JointLimits = JointLimits()
    measurer: MeasurerSettings = MeasurerSettings()


@dataclass(frozen=True)
class JointRequest:
    """What a person asks for.

    Attributes:
        rig: name of a shipped rig, or a rig file.
        block: geometry file with the block, instead of the rig's.
        fingers: long fingers that press.
        rounds: how often every face is pressed in every posture.
        seed: of a simulated rig.
        settings: see there.
    """

    rig: str
    block: Path | None = None
    fingers: tuple[str, ...] = FINGERS
    rounds: int = 1
    seed: int = 0
    settings: JointSettings = field(default_factory=JointSettings)


@dataclass(frozen=True, eq=False)
class FoundJoints:
    """Corrections, and what they were found from.

    Attributes:
        method: in words.
        corrections: by joint.
        trusted: whether the data kept to their own limits.
        offsets: all joints that contacts were asked for, the unobservable ones too.
        covariance: of those offsets.
        judgements: of the touches.
    """

    method: str
    corrections: Mapping[str, JointCorrection]
    trusted: bool = True
    offsets: Mapping[str, JointOffset] = field(default_factory=dict)
    covariance: Covariance | None = None
    judgements: tuple[Judgement, ...] = ()


def load_settings(path: Path | None) -> JointSettings:
    """A file of settings; the usual ones without. Raises ConfigurationError."""
    return JointSettings() if path is None else load_model(path, JointSettings)


def from_file(source: Path, rig: Rig, settings: JointSettings) -> FoundJoints:
    """Corrections from known poses that were measured, or recorded touches. Raises ConfigurationError."""
    here = rig.installation
    if not _holds_touches(source):
        return from_known(load_poses(source, here).poses)
    data = load_data(source)
    check_origin(data, here, str(source))
    check_hand(data, hand_form(rig), str(source))
    if not data.touches:
        hint = "Record touches: tactile-lab calibrate joints --record FILE"
        raise ConfigurationError(
            "contains pictures, which do not determine the fingers' joints", where=str(source), hint=hint
        )
    return from_touches(data, rig, settings)


def _holds_touches(source: Path) -> bool:
    content = load(source)
    return isinstance(content, dict) and content.get("format") == FORMAT


def from_known(poses: Sequence[JointPose]) -> FoundJoints:
    """Corrections from known poses that were measured. Raises ConfigurationError when there is none."""
    if not poses:
        raise ConfigurationError("no pose was read", where="joints", hint="Hold the hand in the poses of the file")
    return FoundJoints("known poses", from_poses(poses))


def known_poses(source: Path, rig: Rig) -> tuple[JointPose, ...]:
    """Known poses of a file some of which are still to be read from the hand; none when all were measured.

    Raises:
        ConfigurationError: the file cannot be used.
    """
    poses = () if _holds_touches(source) else load_poses(source, rig.installation).poses
    return poses if any(pose.unread for pose in poses) else ()


@contextmanager
def pose_wizard(
    rig: Rig, poses: Sequence[JointPose], limits: JointLimits, seed: int, onlooker: TrafficSink
) -> Iterator[tuple[PoseSteps, HeldHand]]:
    """The poses that are still to be read, with a connected hand that a person holds in them.

    Raises:
        ConfigurationError: the rig cannot be used.
        DeviceError: it is not ready.
    """
    check_calibration(rig)
    plan = [PlannedPose(pose) for pose in poses if pose.unread]
    with connected_runtime(rig, seed, BLOCK, onlooker, first_move=False) as runtime:
        yield PoseSteps(plan, limits), HeldHand(runtime)


def from_touches(data: ForearmData, rig: Rig, settings: JointSettings) -> FoundJoints:
    """Corrections of the joints that touches determine: of a block alone by the forearm's calibration, else with it.

    Raises:
        ConfigurationError: too few touches, or they determine no joint.
    """
    if is_of_block(data.touches):
        found = solve_block(data.touches, load_forearm(rig.files["forearm"]), settings.block)
        told = from_contacts(found.offsets)
        return FoundJoints("contacts of a block", told, found.passed, found.offsets, found.covariance, found.judgements)
    result = solve_forearm(data)
    offsets, quality = result.solution.offsets, result.quality
    return FoundJoints("contacts", from_contacts(offsets), quality.passed, offsets, None, quality.judgements)


@contextmanager
def joint_wizard(request: JointRequest, onlooker: TrafficSink) -> Iterator[tuple[BlockWizard, CalibrationMeasurer]]:
    """A wizard with a connected measurer; the hand is lifted off and everything closed in the end.

    Args:
        request: see there.
        onlooker: is shown the hand while it moves.

    Raises:
        ConfigurationError: the rig lacks what is needed, or a finger cannot press alone.
        DeviceError: the rig is not ready.
    """
    rig = load_rig(request.rig)
    check_calibration(rig)
    block, tips, form = _block(rig, request), tip_shapes(rig), hand_form(rig)
    if unknown := sorted(set(request.fingers) - (set(form.long_fingers) & set(tips))):
        hint = f"Press with some of {', '.join(form.long_fingers)} that have a calibrated fingertip"
        raise ConfigurationError(f"{', '.join(unknown)} cannot press alone", where="--fingers", hint=hint)
    world_T_mount = load_forearm(rig.files["forearm"]).world_T_mount.pose()
    plan = plan_block(block, request.fingers, request.rounds, form)
    wizard = BlockWizard(plan, request.settings.block)
    with connected_runtime(_with_block(rig, block), request.seed, BLOCK, onlooker) as runtime:
        measurer = CalibrationMeasurer(runtime, world_T_mount, tips, request.settings.measurer)
        yield wizard, measurer
        measurer.close()


def _block(rig: Rig, request: JointRequest) -> Block:
    if request.block is None and "block" not in rig.files:
        hint = "Describe its size and pose in a file and give it with --block, or give known poses with --from"
        raise ConfigurationError("no block with a known pose is given", where=rig.source, hint=hint)
    return load_block(request.block or rig.files["block"])


def _with_block(rig: Rig, block: Block) -> Rig:
    """A simulated rig with its block where the file says, too heavy to be pushed; a real one as it is.

    Raises:
        ConfigurationError: a simulated rig has no such block.
    """
    if rig.description.kind != "simulated":
        return rig
    size_m = np.ptp(object_model(BLOCK).mesh.bounds, axis=0)
    if not np.allclose(size_m, block.size_m, atol=1e-6):
        what = "the simulated block is " + " x ".join(f"{1e3 * side:.0f}" for side in size_m) + " mm"
        raise ConfigurationError(what, where=rig.source, hint="Give that size")
    place, yaw = block.world_T_block.translation_m, block.world_T_block.pose().rotation().yaw()
    start = ObjectStart(x_m=place[0], y_m=place[1], yaw_rad=float(yaw))
    return clear_table(rig, {"start": start, "object_mass_kg": _STEEL_kg})
