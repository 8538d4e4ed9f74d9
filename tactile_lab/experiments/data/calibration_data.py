"""Simulated calibration data from kinematics alone, fast enough for hundreds of runs: touches and views of a board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from calibration.forearm.touch_plan import PlannedTouch
from calibration.forearm.view_plan import PlannedView, palm_T_board
from calibration.steps.hand_chain import mount_T_link
from calibration.steps.observations import HandPose, Touch, View
from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MarkerSettings, marker_corners
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import transform_points
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINTS

JOINT_BIAS_rad = float(np.radians(0.6))
JOINT_NOISE_rad = float(np.radians(0.1))
SAMPLES = 20
"""Number of joint readings averaged in one press or picture."""

CONTACT_SIGMA_m = 1e-3
YIELD_m_N = 3e-4
FORCES_N = (0.2, 1.0)
CORNER_SIGMA_px, CORNER_BIAS_px, CORNER_OWN_px = 0.05, 0.03, 0.012
"""As measured on pictures of the simulated rig's camera; bias of a fixed marker: common to all corners, and of each."""
PRINT_SHARE = 3e-4
"""Relative difference between the size of a print and that of its check bar, one standard deviation."""
BASE_SIGMA_m = 1e-4

CAMERA = CameraCalibration(
    focal_px=(773.0, 773.8), centre_px=(322.8, 237.4), distortion=(-0.12, 0.06, 8e-4, -6e-4, 0.0), size_px=(640, 480)
)
WORLD_T_CAMERA = RigidTransform(translation_m=(-0.005, -0.04, -0.58), rpy_rad=(-0.07, 0.05, 0.0))
MARKERS = MarkerSettings(
    world_T_worldmarker=RigidTransform(translation_m=(0.2, 0.0, 0.0), rpy_rad=(float(np.pi), 0.0, 0.1))
)
BOARD_m = np.concatenate(
    [marker_corners(0.03) + np.array([0.019 * x, 0.019 * y, 0.0]) for x in (-1, 1) for y in (-1, 1)]
)
"""Corners of a board of four markers of 30 mm, shape (16, 3)."""


@dataclass(frozen=True, eq=False)
class TrueRig:
    """The true parameters that a calibration has to find.

    Attributes:
        world_T_mount: pose of the mount.
        bias_rad: of every joint, measured minus true, shape (24,).
        yield_m_N: compliance of its fingertips.
    """

    world_T_mount: Pose3
    bias_rad: Array
    yield_m_N: float

    @classmethod
    def draw(cls, rng: np.random.Generator, *, place_m: float = 0.02, turn_rad: float = 0.03) -> TrueRig:
        """A rig displaced from its nominal pose, with a bias on every joint, including those of the wrist."""
        motion = np.concatenate([turn_rad * rng.standard_normal(3), place_m * rng.standard_normal(3)])
        bias = JOINT_BIAS_rad * rng.standard_normal(len(JOINTS))
        return cls(Pose3.Expmap(motion), bias, YIELD_m_N * abs(rng.standard_normal()))

    def measure(
        self, base_q: Array, joints_rad: Array, rng: np.random.Generator, form: HandForm = RIGHT_HAND
    ) -> HandPose:
        """The sensors' readings of a true pose: with bias, and with noise averaged over a press or picture.

        Joints that the hand does not have read zero.
        """
        noise = JOINT_NOISE_rad / np.sqrt(SAMPLES) * rng.standard_normal(len(JOINTS))
        shaken = np.repeat([BASE_SIGMA_m, 0.0], 3) * rng.standard_normal(6)
        turns = np.isin(JOINTS, form.joints)
        return HandPose(base_q + shaken, np.where(turns, joints_rad + self.bias_rad + noise, 0.0), form)


def touches_of(plan: Sequence[PlannedTouch], rig: TrueRig, rng: np.random.Generator) -> list[Touch]:
    """Every planned touch as measured by the sensors: with 1 mm of noise per axis on the contact point.

    Each face is displaced by the error that its geometry states, the same for all of its touches.
    """
    targets = {planned.patch.target.name: planned.patch.target for planned in plan}
    shifts_m = {name: target.sigma_m * float(rng.standard_normal()) for name, target in targets.items()}
    return [_touch(planned, shifts_m[planned.patch.target.name], rig, rng) for planned in plan]


def _touch(planned: PlannedTouch, shift_m: float, rig: TrueRig, rng: np.random.Generator) -> Touch:
    tip, joints = TipEllipsoid(), planned.joints_rad
    force_N = float(rng.uniform(*FORCES_N))
    base_q = planned.base_q(rig.world_T_mount, joints, tip, shift_m - rig.yield_m_N * force_N)
    axes, inward = np.array(tip.semi_axes_m), -planned.world_R_distal.T @ planned.patch.normal_world
    support = axes**2 * inward / np.linalg.norm(axes * inward)
    return Touch(
        finger=planned.finger,
        pose=rig.measure(base_q, joints, rng, planned.form),
        point_distal_m=np.array(tip.centre_distal_m) + support + CONTACT_SIGMA_m * rng.standard_normal(3),
        normal_distal=-inward,
        point_covariance_m2=CONTACT_SIGMA_m**2 * np.eye(3),
        target=planned.patch.target,
        force_N=force_N,
    )


def views_of(plan: Sequence[PlannedView], rig: TrueRig, rng: np.random.Generator) -> list[View]:
    """Every planned picture as taken by the camera, with the board glued on slightly askew, and both prints off in
    size.
    """
    askew = Pose3.Expmap(np.concatenate([0.03 * rng.standard_normal(3), 0.003 * rng.standard_normal(3)]))
    bias_px = CORNER_BIAS_px * rng.standard_normal(2) + CORNER_OWN_px * rng.standard_normal((4, 2))
    board_size, world_size = 1.0 + PRINT_SHARE * rng.standard_normal(2)
    on_palm = transform_points(palm_T_board(plan[0].form).pose() * askew, board_size * BOARD_m)
    world = transform_points(MARKERS.world_T_worldmarker.pose(), world_size * MARKERS.world_corners_m)
    return [_view(planned, rig, on_palm, world, bias_px, rng) for planned in plan]


def _view(
    planned: PlannedView, rig: TrueRig, on_palm_m: Array, world_m: Array, bias_px: Array, rng: np.random.Generator
) -> View:
    base_q = planned.base_q(Pose3())
    mount_T_palm = Pose3(mount_T_link(HandPose(base_q, planned.joints_rad, planned.form), "palm"))
    board = transform_points(rig.world_T_mount * mount_T_palm, on_palm_m)
    pose = rig.measure(base_q, planned.joints_rad, rng, planned.form)
    return View(pose, BOARD_m, _see(board, rng), _see(world_m, rng) + bias_px)


def _see(points_world_m: Array, rng: np.random.Generator) -> Array:
    pixels = CAMERA.project(transform_points(WORLD_T_CAMERA.pose().inverse(), points_world_m))
    return np.asarray(pixels + CORNER_SIGMA_px * rng.standard_normal(pixels.shape))
