"""The trackers behind one interface, and their settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Protocol, Self, TypeAlias

import numpy as np
from gtsam import Pose3
from pydantic import Field as Limit
from pydantic import model_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array, StepSigma
from drivers.core.errors import ConfigurationError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.baselines.icp_tracker import IcpSettings, IcpTracker
from tactile_lab.slam.tracking.baselines.odometry_tracker import KnownPoseTracker, OdometryTracker
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
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
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate
from tactile_lab.slam.tracking.filter.particle_tracker import ParticleTracker
from tactile_lab.slam.tracking.joint.deferred_association import Relocate
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.joint.settings import JointSettings

GRID_MARGIN_m = 0.040

Method: TypeAlias = Literal["joint", "particle", "thesis-pf", "thesis-pf-graph", "known-pose", "odometry", "icp"]
"""The tracking methods, by the names in settings, command line and tables; see TrackingSettings."""

THESIS_METHODS: tuple[Method, ...] = ("thesis-pf", "thesis-pf-graph")
PLANAR_METHODS: tuple[Method, ...] = ("thesis-pf", "thesis-pf-graph", "particle")
GRAPH_METHODS: tuple[Method, ...] = ("particle", "thesis-pf-graph")
"""Methods whose poses the pose graph corrects."""

THESIS_SHAPE = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
"""The shape model of section 2.2, with that one of its two kernels that suits its filter better (decision 50)."""


class Tracker(Protocol):
    """Follows the object from grasp to grasp; the calls of one step come in this order."""

    effective_count: float
    """Effective number of particles or hypotheses after the last weighting."""

    @property
    def map(self) -> ContactMap:
        """All grasps so far with their present poses."""

    @property
    def refined(self) -> ContactMap:
        """The same with refinements that take too long for every step, for the shape shown between grasps."""

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        """Move the belief by the hand's motion (eq. 3.7), known as well as ``measured`` says."""

    def weigh(self, contacts: ContactSet) -> bool:
        """Weight the belief by a grasp's contacts in the world (eq. 3.6); returns False if nothing fits."""

    def estimate(self) -> PoseEstimate:
        """The present pose."""

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """Add the grasp to the map. A tracker with one hypothesis keeps uncertain contacts out of the shape."""

    def resample(self) -> None:
        """Concentrate the belief on likely states."""

    def adopt(self, corrected: ContactMap) -> None:
        """Take over a map whose poses were corrected from outside."""

    def finish(self) -> None:
        """No further grasp follows: final estimation from all of them."""


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
    """
    shape = settings.shape or (THESIS_SHAPE if settings.method in THESIS_METHODS else GpisSettings())
    start = ContactMap((first,), shape, settings.space)
    match settings.method:
        case "joint":
            return JointTracker(start, settings.motion, settings.joint, settings.kernel_every, relocate)
        case "odometry":
            return OdometryTracker(start, settings.motion)
        case "icp":
            return IcpTracker(start, settings.motion, settings.icp)
        case "known-pose":
            return KnownPoseTracker(start, settings.motion, known_poses or ())
        case _:
            return _particle_tracker(settings, start, rng)


def poses_to_be_told(method: Method, poses: Sequence[Pose3 | None] | None) -> tuple[Pose3 | None, ...] | None:
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


def _particle_tracker(settings: TrackingSettings, start: ContactMap, rng: np.random.Generator) -> ParticleTracker:
    calibrated = settings.method not in THESIS_METHODS
    spacing_m = settings.contour_grid_m if settings.dimension == 2 else settings.surface_grid_m

    def field_of(contact_map: ContactMap) -> FieldGrid:
        alone = settings.matching == "previous" and not calibrated
        fitted = (contact_map.last_used_alone() if alone else contact_map).fit()
        return FieldGrid.around(
            fitted, margin_m=GRID_MARGIN_m, spacing_m=spacing_m, gradient=calibrated, variance=calibrated
        )

    measurement: Measurement = ThesisMeasurement(settings.gate, start.settings.offsurface_distance_m)
    if calibrated:
        measurement = CalibratedMeasurement(settings.likelihood)
    return ParticleTracker(
        first=start,
        measurement=measurement,
        noise=settings.motion,
        particles=settings.particles,
        kernel_every=settings.kernel_every,
        field_of=field_of,
        rng=rng,
    )
