"""Makes a calibration's touches and pictures with a rig.

The positioner moves the hand, one finger stretched, in front of a face and presses it softly; or it shows the board on
the hand to the camera. The safety supervisor checks every cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from gtsam import Pose3
from pydantic import Field

from calibration.forearm.touch_plan import PlannedTouch
from calibration.forearm.view_plan import PlannedView
from calibration.forearm.wizard import Observation, Planned
from calibration.steps.observations import HandPose, Touch, View
from drivers.camera.boards import CharucoBoard, GridBoard, SingleMarker
from drivers.camera.detection import detect
from drivers.camera.markers import MarkerSettings
from drivers.camera.targets.april_grid import AprilGrid
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.closing.closing import motor_targets
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.kinematics import JOINTS
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.rig_runtime.rig_runtime import RigRuntime

ObservedT = TypeVar("ObservedT")
Board = SingleMarker | GridBoard | CharucoBoard | AprilGrid


class MeasurerSettings(StrictModel):
    """How the hand moves during calibration.

    Attributes:
        travel_m_s, turn_rad_s: speeds between poses.
        press_m_s: speed toward a face.
        fingers_rad_s: joint speed between postures.
        lift_m: height above a place at which the hand arrives and leaves.
        stand_off_m: distance at which the press starts; more than the mount's error.
        beyond_m: distance behind the expected face at which the search ends.
        back_m: retreat after the first touch, before the slow second touch.
        again_m_s: speed of the second touch.
        press_N: force at which it stops.
        settle_s, capture_s: rest before a measurement, and its length.
        tares: how often to wait for a fingertip that still swings.
        safety: limits; wide, since the edges of a table are far out and a stretched finger keeps the palm high.
    """

    travel_m_s: float = Field(default=0.25, gt=0.0)
    turn_rad_s: float = Field(default=1.2, gt=0.0)
    press_m_s: float = Field(default=0.02, gt=0.0)
    fingers_rad_s: float = Field(default=1.0, gt=0.0)
    lift_m: float = Field(default=0.08, gt=0.0)
    stand_off_m: float = Field(default=0.03, gt=0.0)
    beyond_m: float = Field(default=0.03, gt=0.0)
    back_m: float = Field(default=0.003, gt=0.0)
    again_m_s: float = Field(default=0.003, gt=0.0)
    press_N: float = Field(default=0.4, gt=0.0)
    settle_s: float = Field(default=0.3, gt=0.0)
    capture_s: float = Field(default=0.25, gt=0.0)
    tares: int = Field(default=5, ge=1)
    safety: SafetySettings = SafetySettings(palm_minimum_height_m=0.05, workspace_radius_m=1.1)


class PressingHand:
    """A connected rig runtime whose hand is moved and presses faces; shared by all measurers.

    Args:
        runtime: connected.
        world_T_mount: approximate pose of the mount.
        tips: shape of each fingertip.
        settings: see there.
    """

    def __init__(
        self,
        runtime: RigRuntime,
        world_T_mount: Pose3,
        tips: Mapping[str, TipEllipsoid],
        settings: MeasurerSettings | None = None,
    ) -> None:
        self.runtime, self.settings = runtime, settings or MeasurerSettings()
        self.supervisor = SafetySupervisor(runtime, self.settings.safety, runtime.cycle_ns)
        self._motion = Motion(runtime, self.supervisor)
        self._world_T_mount, self._tips = world_T_mount, dict(tips)
        self._targets_rad: dict[str, float] = {}
        self._q = runtime.perception.hand.base_q.copy()

    # --- pressing ----------------------------------------------------------------------------------------------

    def _press_and_observe(self, planned: PlannedTouch, captured: Callable[[PlannedTouch], ObservedT]) -> ObservedT:
        """Press as planned, observe, and move back in front of the face."""
        tip, joints = self._tips[planned.finger], planned.joints_rad
        before = planned.base_q(self._world_T_mount, joints, tip, self.settings.stand_off_m)
        behind = planned.base_q(self._world_T_mount, joints, tip, -self.settings.beyond_m)
        self._leave()
        self._take_posture(joints)
        self._arrive(before)
        self._tare(planned.finger)
        try:
            self._press(planned, before, behind)
            return captured(planned)
        finally:
            self._move(before, self.settings.travel_m_s)

    def _press(self, planned: PlannedTouch, before: Array, behind: Array) -> None:
        """Find the face, move back a little, and touch it again slowly: the softer the press,
        the less the tip yields.
        """
        self._search(planned, behind, self.settings.press_m_s)
        back = self.settings.back_m / float(np.linalg.norm(before[:3] - behind[:3]))
        self._move(self._q + back * (before - behind), self.settings.travel_m_s)
        self._motion.wait(self.settings.settle_s)
        self._search(planned, behind, self.settings.again_m_s)
        self._motion.wait(self.settings.settle_s)

    def _search(self, planned: PlannedTouch, behind: Array, speed_m_s: float) -> None:
        for q in self._motion.line(behind, speed_m_s):
            self._go(q)
            if self._motion.loads_N()[planned.finger] >= self.settings.press_N:
                return
        hint = "Check its pose in the geometry file, and the initial guess of the mount's pose"
        raise DeviceError(f"{planned.finger} touched nothing at {planned.patch.target.name}", where="touch", hint=hint)

    def _tare(self, finger: str) -> None:
        if refused := self._motion.tare(self.settings.settle_s, (finger,), self.settings.tares):
            raise DeviceError(f"cannot be zeroed: {refused[finger]}", where=finger, hint="See tactile-lab rig check")

    # --- motion ------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Lift the hand off, and stop."""
        self._leave()

    def _leave(self) -> None:
        """Straight up from where the hand is."""
        self._move(self._q + np.array([0, 0, self.settings.lift_m, 0, 0, 0]), self.settings.travel_m_s)

    def _arrive(self, q: Array) -> None:
        """Move above a place first, then down."""
        self._move(q + np.array([0, 0, self.settings.lift_m, 0, 0, 0]), self.settings.travel_m_s)
        self._move(q, self.settings.travel_m_s)

    def _move(self, q: Array, speed_m_s: float) -> None:
        self._motion.move_base(q, speed_m_s, self.settings.turn_rad_s)
        self._q = np.array(q)

    def _go(self, q: Array) -> None:
        self._motion.set_base(q)
        self._motion.tick()
        self._q = np.array(q)

    def _take_posture(self, joints_rad: Array) -> None:
        """Joints to a posture, straight in joint space."""
        wanted = self._targets_of(joints_rad)
        start = self._targets_rad or self._targets_of(self.runtime.perception.hand.joints_rad)
        way = max(abs(wanted[name] - start[name]) for name in wanted)
        if way > 0.0:
            for share in self._motion.shares(way / self.settings.fingers_rad_s):
                self.runtime.hand.set_targets({n: (1 - share) * start[n] + share * wanted[n] for n in wanted})
                self._motion.tick()
        self._targets_rad = wanted

    def _targets_of(self, joints_rad: Array) -> dict[str, float]:
        """Targets of the motors that the hand has."""
        targets = motor_targets(dict(zip(JOINTS, joints_rad.tolist(), strict=True)))
        return {name: targets[name] for name in self.runtime.perception.form.driven}

    def _mean_pose(self, duration_s: float, each: Callable[[], object] = lambda: None) -> HandPose:
        """Joints of hand and positioner, averaged over a time; ``each`` is called in every cycle."""
        seen, joints, base = self.runtime.perception, [], []
        for _ in range(self._motion.cycles(duration_s)):
            self._motion.tick()
            joints.append(seen.hand.joints_rad)
            base.append(seen.hand.base_q)
            each()
        return HandPose(np.mean(base, axis=0), np.mean(joints, axis=0), seen.form)


class CalibrationMeasurer(PressingHand):
    """A rig that makes planned touches and pictures.

    Args:
        runtime, world_T_mount, tips, settings: see :class:`PressingHand`.
        board: board on the hand, for pictures; None for touches.
        markers: the world marker, for pictures.
    """

    def __init__(
        self,
        runtime: RigRuntime,
        world_T_mount: Pose3,
        tips: Mapping[str, TipEllipsoid],
        settings: MeasurerSettings | None = None,
        board: Board | None = None,
        markers: MarkerSettings | None = None,
    ) -> None:
        super().__init__(runtime, world_T_mount, tips, settings)
        self._board, self._markers = board, markers

    def measure(self, planned: Planned) -> Observation:
        """Make one planned touch or picture.

        Raises:
            DeviceError: nothing was touched, no contact was measured, or the board is not in the picture.
            SafetyError: a limit was exceeded; the rig was stopped.
        """
        observation = (
            self._press_and_observe(planned, self._capture)
            if isinstance(planned, PlannedTouch)
            else self._view(planned)
        )
        self.supervisor.on_approach()
        return observation

    # --- touches -----------------------------------------------------------------------------------------------

    def _capture(self, planned: PlannedTouch) -> Touch:
        seen, finger = self.runtime.perception, planned.finger
        sensor = seen.fingertips[finger]
        sensor.begin_capture()
        pose = self._mean_pose(self.settings.capture_s)
        contact = sensor.contact(seen.hand.world_R_distal[finger])
        if contact is None:
            hint = "Press again at another place; see tactile-lab rig check"
            raise DeviceError(f"{finger} felt no valid contact", where="touch", hint=hint)
        return Touch(
            finger=finger,
            pose=pose,
            point_distal_m=contact.point_distal_m,
            normal_distal=contact.normal_distal,
            point_covariance_m2=contact.point_covariance_m2,
            target=planned.patch.target,
            force_N=contact.force_N,
        )

    # --- pictures ----------------------------------------------------------------------------------------------

    def _view(self, planned: PlannedView) -> View:
        board, markers = self._board, self._markers
        if self.runtime.camera is None or board is None or markers is None:
            raise DeviceError("pictures need a camera, its markers and a board on the hand", where="marker method")
        self._take_posture(planned.joints_rad)
        self._move(planned.base_q(self._world_T_mount), self.settings.travel_m_s)
        self._motion.wait(self.settings.settle_s)
        pose = self._mean_pose(self.settings.capture_s)
        image = self.runtime.picture(self._motion.tick).image
        board_m, board_px = board.match_corners(image)
        if len(board_m) < 4:
            hint = "Move it into the picture, and make sure that nothing hides it"
            raise DeviceError("the board on the hand is not in the picture", where="camera", hint=hint)
        return View(pose, board_m, board_px, detect(image, markers.dictionary).get(markers.world_id))
