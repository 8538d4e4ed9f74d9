"""From decoded samples and session events to grasps.

Perception has no clock, no transport and no randomness: its state depends only on the samples and session events it was
given, and on their order. So the live session and a replay of its bytes build the same grasps, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, isinf, isnan
from typing import Any, Literal

import numpy as np
from gtsam import Pose3
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS, Array, Contact, Grasp, StepSigma
from drivers.core.errors import DeviceError
from drivers.core.fingertip import FingertipSensor
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.motors import MotorMap
from sessions.perception.approach_paths import TipSurface
from sessions.perception.carrying.carry import Carry
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.carrying.net_wrench import upward_N
from sessions.perception.carrying.vibration import HeardSlip, SlipHearing, VibratingFingertip
from sessions.perception.contact_world import MountUncertainty
from sessions.perception.event_outcomes import Outcome, TareReport, TruthFrame, Undone
from sessions.perception.hand_odometry import HandMotion, HandOdometry
from sessions.perception.hand_placement import HandPlacement
from sessions.perception.instruments import (
    BaseReading,
    FrameReading,
    HandReading,
    SlotFingertip,
    WrenchFingertip,
    motor_torques,
)
from sessions.perception.touch_capture import ContactErrors, Probed, TouchCapture
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.scales import Scales
from sessions.recording.session_events import EventKind, SessionEvent

_PUSHED = StepSigma(0.02, float(np.radians(15.0)))
"""How far an object may have been pushed that was found again, standing as before."""
_GAVE_WAY = "touched before the object gave way"


class PerceptionSettings(StrictModel):
    """Parameters of contacts.

    Attributes:
        joint_sigma_rad: standard deviation of each joint angle that averaging does not remove (0.6 deg).
        minimum_force_N: a lighter touch does not count as a contact.
        odometry: "touch": a held object moves as the fingertips feel it, which also says how certain that is; "palm":
            it moves with the palm.
        odometry_scale: factor of the standard deviations that odometry states; ``session slips`` measures it.
    """

    joint_sigma_rad: float = Field(default=float(np.radians(0.6)), ge=0.0)
    minimum_force_N: float = Field(default=0.1, ge=0.0)
    odometry: Literal["touch", "palm"] = "touch"
    odometry_scale: float = Field(default=1.0, gt=0.0, le=100.0)


class Perception:
    """State of the hand in the world, and the grasps made of it.

    Args:
        wrench_fingertips: fingertips with their own transports, by finger.
        slot_fingertips: fingertips whose data come with the hand's samples, by finger.
        mount_T_forearm: the positioner's kinematics, from its joint vector (6,).
        world_T_mount: the forearm-to-world calibration.
        mount_covariance: its covariance, see :class:`MountUncertainty`; None if unknown.
        tip_surfaces: of the fingertips whose approach paths are computed, by finger.
        form: of the hand.
        motors: which motor pulls which joint; without it links that push stay unnoticed.
        stays: an object that the hand does not hold stays where it is, but for what the hand feels; False where people
            move it, too.
    """

    def __init__(
        self,
        *,
        wrench_fingertips: Mapping[str, WrenchFingertip] | None = None,
        slot_fingertips: Mapping[str, SlotFingertip] | None = None,
        mount_T_forearm: Callable[[Array], Pose3],
        world_T_mount: Pose3,
        mount_covariance: Array | None = None,
        tip_surfaces: Mapping[str, TipSurface] | None = None,
        settings: PerceptionSettings | None = None,
        form: HandForm = RIGHT_HAND,
        motors: MotorMap | None = None,
        stays: bool = True,
    ) -> None:
        self._stays = stays
        self.form, self.motors = form, motors
        """Which hand it is, and which motor pulls which joint; None if that is not known."""
        self._wrench = dict(wrench_fingertips or {})
        self._slots = dict(slot_fingertips or {})
        everyone: dict[str, FingertipSensor] = {**self._wrench, **self._slots}
        self.fingertips: dict[str, FingertipSensor] = {f: everyone[f] for f in FINGERS if f in everyone}
        self.world_T_mount, self.settings = world_T_mount, settings or PerceptionSettings()
        self.hand = HandPlacement(mount_T_forearm, world_T_mount, form)
        """Where the hand is, from the newest samples."""
        mount = (
            None if mount_covariance is None else MountUncertainty(world_T_mount.matrix(), np.asarray(mount_covariance))
        )
        errors = ContactErrors(self.settings.joint_sigma_rad, mount)
        self.touches = TouchCapture(
            self.fingertips, self.hand, self.settings.minimum_force_N, errors, tip_surfaces or {}
        )
        """Captures, and which fingers they have left out."""
        self.hand_stamp_ns: int | None = None
        """Arrival of the newest fresh joint angles; None before the first."""
        self._loads_N: dict[str, float] | None = None
        self._frame: FrameReading | None = None
        self._probed = Probed()
        self._unheld: dict[EventKind, set[int]] = {EventKind.OBJECT_MOVED: set(), EventKind.OBJECT_FELL: set()}
        """The grasps before which the object was moved otherwise than by the hand that held it."""

        self._carried = HandOdometry()
        felt = self.fingertips if self.settings.odometry == "touch" else {}
        self.held = HeldObject(felt, form.side, self.settings.odometry_scale, motors)
        """The object since it was grasped."""
        self._hearing = SlipHearing({f: tip for f, tip in felt.items() if isinstance(tip, VibratingFingertip)})
        self._fitted = None if motors is None else motors.is_fitted
        self._scales = Scales(self.held, form.side, self.settings.joint_sigma_rad)

    # --- samples -----------------------------------------------------------------------------------------------

    def on_hand(self, sample: HandReading) -> None:
        """Take joint angles, and the fingertip slots that come with them."""
        self._loads_N = None
        for fingertip in self._slots.values():
            fingertip.update(sample)
        self._hearing.on_sample(sample.stamp_ns)
        if not sample.fresh:
            return
        joints_rad = self.hand.take_joints(sample.joints_rad)
        self.hand_stamp_ns = sample.stamp_ns
        self.touches.on_joints(joints_rad)
        if self.held.is_watched and self.hand.ready:
            counts = motor_torques(sample, self._fitted)
            self.held.on_hand(sample.stamp_ns, joints_rad, self.hand.world_T_forearm, counts)

    def on_base(self, sample: BaseReading) -> None:
        """Take the positioner's joints."""
        self._loads_N = None
        self.touches.on_base(self.hand.take_base(sample.q))

    def on_wrench(self, finger: str, samples: Sequence[Any]) -> None:
        """Take samples of one fingertip's own transport."""
        self._loads_N = None
        self._wrench[finger].update(samples)

    def on_frame(self, frame: FrameReading) -> None:
        """Take a camera frame; it is kept until the next one."""
        self._frame = frame

    # --- state -------------------------------------------------------------------------------------------------

    @property
    def grasp_count(self) -> int:
        """Number of grasps so far."""
        return self._carried.grasp_count

    @property
    def is_holding(self) -> bool:
        """Whether a hold has begun and not ended."""
        return self._carried.is_holding

    @property
    def hand_motion(self) -> HandMotion:
        """How the hand has carried the object since the last grasp, in completed holds."""
        return self._carried.motion

    @property
    def carry(self) -> Carry | None:
        """What the fingertips felt in the last completed hold; None if they felt nothing that tells."""
        return self.held.carry

    @property
    def heard_slip(self) -> HeardSlip | None:
        """What fingertips without forces heard of a slip from the last capture until its hold ended; None for none."""
        return self._hearing.slip

    @property
    def properties(self) -> ObjectProperties:
        """Mass, centre and friction of the object, as far as they were measured."""
        return self._scales.properties

    def held_N(self) -> float:
        """Upward force of the fingertips on the object now; 0 where they tell nothing while they move."""
        return upward_N(self.held.fingertips, self.hand.current().world_T_distal[:, :3, :3])

    def loads_N(self) -> dict[str, float]:
        """Contact force on each fingertip of the rig; infinite if the newest sample is invalid."""
        if self._loads_N is None:
            rotations = self.hand.world_R_distal
            told = {finger: tip.load_N(rotations[finger]) for finger, tip in self.fingertips.items()}
            self._loads_N = {finger: inf if isnan(load_N) else load_N for finger, load_N in told.items()}
        return dict(self._loads_N)

    def void_tips(self) -> dict[str, str]:
        """Why the newest sample of a fingertip has no valid force, by finger; without valid ones."""
        void = [finger for finger, load_N in self.loads_N().items() if isinf(load_N)]
        return {finger: self.fingertips[finger].void() or "its load is not a number" for finger in void}

    @property
    def probed(self) -> tuple[Contact, ...]:
        """Contacts of touches without a grasp; they wait for the next grasp, and are forgotten with the next hold."""
        return tuple(self._probed.contacts)

    def problems(self) -> tuple[str, ...]:
        """Problems of fingertips, each beginning with the finger's name, or ``fingertips`` for all of them."""
        late = (f"fingertips: {self.held.delay.problem}",) if self.held.delay.problem else ()
        return (*(f"{finger}: {text}" for finger, tip in self.fingertips.items() for text in tip.health()), *late)

    # --- session events ----------------------------------------------------------------------------------------

    def event(self, event: SessionEvent) -> Outcome | None:
        """Process a session event. Returns the grasp, frame or report it completes.

        Raises:
            SessionError: the event is not valid here (an end without a beginning).
            DeviceError: the hand or the positioner has not sent a sample yet.
        """
        match event.kind:
            case EventKind.TARE:
                return self._tare(event)
            case EventKind.CLOSE_BEGIN:
                self.touches.on_close()
                self.held.on_close(event.stamp_ns)
                return None
            case EventKind.CAPTURE_BEGIN:
                self._begin_capture(event)
                return None
            case EventKind.CAPTURE_END:
                return self._grasp(event)
            case EventKind.TOUCH_END:
                self._probed = self._still_there()
                self._probed.add(self.touches.end(event))
                self.held.on_left()
                self._hearing.on_left()
                return None
            case EventKind.HOLD_BEGIN:
                self._carried.begin(self.hand.world_T_palm)
                self.held.on_hold(event.stamp_ns)
                self._probed = Probed()
                return None
            case EventKind.HOLD_END:
                self._end_hold()
                return None
            case EventKind.TRUTH_FRAME:
                return self._truth_frame()
            case EventKind.UNDO:
                return self._undo()
            case _:
                return self._otherwise(event)

    def _otherwise(self, event: SessionEvent) -> Outcome | None:
        if event.kind in self._unheld:
            self._unheld[event.kind].add(self.grasp_count)
            return None
        return self._scales.event(event, self.grasp_count - 1)

    def _end_hold(self) -> None:
        carry = self.held.end_hold()
        self._carried.end(self.hand.world_T_palm, carry)
        self._hearing.on_left()
        if carry is not None:
            self._scales.on_carry(carry.sliding, self.grasp_count - 1)

    def _tare(self, event: SessionEvent) -> TareReport:
        self.hand.latest()
        if set(self.fingertips) <= set(event.fingers):
            self.held.on_tare(event.stamp_ns)
        self._loads_N = None
        refused = {}
        for finger in event.fingers:
            if finger not in self.fingertips:
                continue
            try:
                self.fingertips[finger].tare(self.hand.world_R_distal[finger])
            except DeviceError as error:
                refused[finger] = error.what
        return TareReport(event.stamp_ns, refused)

    def _begin_capture(self, event: SessionEvent) -> None:
        self.touches.begin(event.stamp_ns)
        if not self.is_holding:
            self.held.on_capture(event.stamp_ns)
            self._hearing.on_still()

    def _grasp(self, event: SessionEvent) -> Grasp:
        measured, probed = self.touches.end(event), self._still_there()
        self._probed = Probed()
        felt = self.held.end_hold(measured.stamp_ns) if self.is_holding else None
        index, motion = self.grasp_count, self._carried.take(self.hand.world_T_palm, felt)
        self.held.on_grasp(measured)
        self._hearing.on_carry(event.stamp_ns)
        return Grasp(
            index=index,
            stamp_ns=measured.stamp_ns,
            contacts=(*measured.contacts, *probed.contacts),
            world_T_palm=Pose3(measured.world_T_palm),
            hand_motion_world=motion.world if index else Pose3(),
            approach_paths=(*measured.ways, *probed.ways),
            motion_sigma=self._motion_sigma(index, motion),
            begins_anew=index in self._unheld[EventKind.OBJECT_FELL],
        )

    def _still_there(self) -> Probed:
        """What was touched before for the next grasp; nothing where the object has given way since, and is counted."""
        if not self.held.given_way_m or not self._probed.contacts:
            return self._probed
        self.touches.drop_counts[_GAVE_WAY] += len(self._probed.contacts)
        return Probed()

    def _motion_sigma(self, index: int, motion: HandMotion) -> StepSigma | None:
        if index in self._unheld[EventKind.OBJECT_MOVED]:
            return _PUSHED
        stood = self.held.stood if self._stays else None
        return self.held.then_closed(stood if motion.is_rest else motion.sigma) if index else None

    def _truth_frame(self) -> TruthFrame | None:
        frame, self._frame = self._frame, None
        if frame is None:
            return None
        current = self.grasp_count if self.touches.is_open else self.grasp_count - 1
        return TruthFrame(current if current >= 0 else None, frame)

    def _undo(self) -> Undone:
        self._carried.undo()
        self.touches.abandon()
        self._scales.undo(self.grasp_count)
        return Undone(self.grasp_count)
