"""The trackers by name, and their settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from gtsam import Pose3
from pydantic import AfterValidator, model_validator
from pydantic import Field as Limit

from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from drivers.core.registry import Registry
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.added_tracker import AddedTracker
from tactile_lab.slam.tracking.baselines.icp_tracker import IcpSettings, IcpTracker
from tactile_lab.slam.tracking.baselines.odometry_tracker import KnownPoseTracker, OdometryTracker
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tactile_lab.slam.tracking.filter.measurement import (
    CalibratedMeasurement,
    CalibratedSettings,
    GateSettings,
    Measurement,
    ThesisMeasurement,
)
from tactile_lab.slam.tracking.filter.particle_tracker import ParticleTracker
from tactile_lab.slam.tracking.joint.deferred_association import Relocate
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.joint.settings import JointSettings
from tactile_lab.slam.tracking.tracker import Tracker

GRID_MARGIN_m = 0.040

THESIS_METHODS: tuple[str, ...] = ("thesis-pf", "thesis-pf-graph")
PLANAR_METHODS: tuple[str, ...] = ("thesis-pf", "thesis-pf-graph", "particle")
GRAPH_METHODS: tuple[str, ...] = ("particle", "thesis-pf-graph")
"""Methods whose poses the pose graph corrects."""

THESIS_SHAPE = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
"""The shape model of section 2.2, with that one of its two kernels that suits its filter better (decision 50)."""


@dataclass(frozen=True)
class TrackerStart:
    """What a tracker starts with.

    Attributes:
        map: the grasp that defines the object frame, with the shape model of the settings.
        rng: source of all random numbers.
        known_poses: true ``world_T_object`` of all grasps that follow, for methods that use them.
        relocate: proposes poses anywhere on the object; None where it cannot.
    """

    map: ContactMap
    rng: np.random.Generator
    known_poses: Sequence[Pose3 | None] = ()
    relocate: Relocate | None = None


MakeTracker: TypeAlias = Callable[["TrackingSettings", TrackerStart], Tracker]
"""Makes a method's tracker, started at the first grasp."""


METHODS: Registry[MakeTracker] = Registry("method", group="methods")
"""Constructors of the trackers, by the names in settings, command line and tables. See ``docs/plugins.md``."""

Method: TypeAlias = Annotated[str, AfterValidator(METHODS.known)]
"""The name of a registered method, for settings."""


class TrackingSettings(StrictModel):
    """Settings of tracking.

    Attributes:
        method: "joint" keeps several trajectories, proposed by the measurement and smoothed with the shape; "thesis-pf"
            is algorithm 3.1 with (3.9) and the gate, "thesis-pf-graph" the same with the pose graph behind; "particle"
            is that filter with the calibrated likelihood. Baselines: "known-pose" is given the true poses, "odometry"
            believes the hand's motion, "icp" registers each grasp to those before.
        dimension: 2 for the horizontal contour, 3 for the surface.
        freedom: "table", the object stands on the table and only turns and slides; "space", it is held free.
        motion: slip of the object relative to the hand's motion.
        particles: their number.
        shape: the shape model; None for the method's own.
        gate: of the thesis's measurement model.
        matching: the field in the thesis's likelihood (3.9): of all grasps ("map"), or of the previous one alone, as
            figure 3.4 draws it.
        likelihood: of the calibrated one.
        joint: parameters of the hypotheses.
        icp: parameters of the registration baseline.
        kernel_every: kernel parameters are estimated again after this many grasps.
        contour_grid_m, surface_grid_m: spacing of the grid that particles look the field up in.
    """

    method: Method = "joint"
    dimension: Literal[2, 3] = 2
    freedom: Literal["table", "space"] = "table"
    motion: MotionNoise = MotionNoise()
    particles: int = Limit(default=20_000, ge=100)
    shape: GpisSettings | None = None
    gate: GateSettings = GateSettings()
    matching: Literal["map", "previous"] = "map"
    likelihood: CalibratedSettings = CalibratedSettings()
    joint: JointSettings = JointSettings()
    icp: IcpSettings = IcpSettings()
    kernel_every: int = Limit(default=4, ge=1)
    contour_grid_m: float = Limit(default=0.002, gt=0)
    surface_grid_m: float = Limit(default=0.005, gt=0)

    @property
    def space(self) -> PoseVectors:
        """The kind of pose vectors."""
        return PLANAR if self.freedom == "table" else SPATIAL

    @model_validator(mode="after")
    def _surfaces_in_space(self) -> Self:
        if self.freedom == "space" and self.dimension != 3:
            raise ValueError('freedom "space" needs dimension 3')
        if self.freedom == "space" and self.method in PLANAR_METHODS:
            raise ValueError(f'method "{self.method}" knows objects on a table only; freedom "space" needs another')
        return self

    @model_validator(mode="after")
    def _normals_for_joint(self) -> Self:
        if self.method == "joint" and self.shape is not None and self.shape.observations != "normals":
            raise ValueError('method "joint" needs shape.observations "normals"')
        return self


def make_tracker(
    settings: TrackingSettings,
    first: PlacedGrasp,
    rng: np.random.Generator,
    known_poses: Sequence[Pose3 | None] | None = None,
    relocate: Relocate | None = None,
) -> Tracker:
    """The tracker that the settings ask for, started at the first grasp.

    Args:
        settings: see there.
        first: the grasp that defines the object frame.
        rng: source of all random numbers.
        known_poses: for "known-pose": true ``world_T_object`` of the first grasp and of all that follow.
        relocate: for "joint": proposes poses anywhere on the object.

    Raises:
        EstimationError: a method of an extension or a plug-in raises; names its file.
    """
    shape = settings.shape or (THESIS_SHAPE if settings.method in THESIS_METHODS else GpisSettings())
    start = TrackerStart(ContactMap((first,), shape, settings.space), rng, known_poses or (), relocate)
    make = METHODS[settings.method]
    if settings.method in OUR_METHODS:
        return make(settings, start)
    return AddedTracker(settings.method, METHODS.file(settings.method), lambda: make(settings, start))


def checked_known_poses(method: str, poses: Sequence[Pose3 | None] | None) -> tuple[Pose3 | None, ...] | None:
    """Check that only the method that needs true poses gets them.

    Raises:
        ConfigurationError: the method needs poses and has none, or is given poses that it must not use.
    """
    if method == "known-pose" and (poses is None or all(pose is None for pose in poses)):
        hint = "Use data with true poses, or another method"
        raise ConfigurationError("needs the object's true poses, and there are none", where="known-pose", hint=hint)
    if method != "known-pose" and poses is not None:
        raise ConfigurationError("must not be given the true poses", where=method)
    return None if poses is None else tuple(poses)


def _particle(settings: TrackingSettings, start: TrackerStart) -> Tracker:
    calibrated = settings.method not in THESIS_METHODS
    spacing_m = settings.contour_grid_m if settings.dimension == 2 else settings.surface_grid_m

    def field_of(contact_map: ContactMap) -> FieldGrid:
        alone = settings.matching == "previous" and not calibrated
        fitted = (contact_map.last_used_alone() if alone else contact_map).fit()
        return FieldGrid.around(
            fitted, margin_m=GRID_MARGIN_m, spacing_m=spacing_m, gradient=calibrated, variance=calibrated
        )

    measurement: Measurement = ThesisMeasurement(settings.gate, start.map.settings.offsurface_distance_m)
    if calibrated:
        measurement = CalibratedMeasurement(settings.likelihood)
    return ParticleTracker(
        first=start.map,
        measurement=measurement,
        noise=settings.motion,
        particles=settings.particles,
        kernel_every=settings.kernel_every,
        field_of=field_of,
        rng=start.rng,
    )


def _joint(settings: TrackingSettings, start: TrackerStart) -> Tracker:
    return JointTracker(start.map, settings.motion, settings.joint, settings.kernel_every, start.relocate)


def _odometry(settings: TrackingSettings, start: TrackerStart) -> Tracker:
    return OdometryTracker(start.map, settings.motion)


def _icp(settings: TrackingSettings, start: TrackerStart) -> Tracker:
    return IcpTracker(start.map, settings.motion, settings.icp)


def _known_pose(settings: TrackingSettings, start: TrackerStart) -> Tracker:
    return KnownPoseTracker(start.map, settings.motion, start.known_poses)


METHODS.register("joint", _joint)
METHODS.register("particle", _particle)
METHODS.register("thesis-pf", _particle)
METHODS.register("thesis-pf-graph", _particle)
METHODS.register("known-pose", _known_pose)
METHODS.register("odometry", _odometry)
METHODS.register("icp", _icp)

OUR_METHODS = frozenset(METHODS.registered())
"""Those that need no guarding."""
