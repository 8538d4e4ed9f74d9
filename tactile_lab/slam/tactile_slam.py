"""Tactile SLAM: follow an object through successive grasps and build its shape at the same time.

:meth:`TactileSlam.add_grasp` is algorithm 3.1 of the thesis for one grasp, followed by the pose graph of its
section 3.3.3. Frames: the object frame is defined by the first grasp, its origin at the contacts' centre, its x
axis along the palm's horizontal axis, z up (section 3.4). The object stays on the table: its pose is
``(x, y, yaw)`` and its origin keeps its initial height, so that in the object frame a contact's z is its
height over the table minus that height, in every grasp.

Grasps that cannot be registered:

- No particle explains the contacts (with the thesis's gate: fewer than four close and observable ones): the predicted
  pose is kept, with its increased covariance, and the contacts are not used: "untracked".
- The pose is corrected, but remains so uncertain that it moves the contacts along their normals by more than
  ``placement_limit_m`` (few contacts, or a direction not observed): "uncertain". A particle filter does not use the
  contacts, because they could not be removed from its only map; joint hypotheses use them and remain revisable.

Where an object has fallen over (:attr:`~drivers.core.contacts.Grasp.begins_anew`) the estimate begins anew, with a new
object frame; grasps before that have no pose. Where more was known of it before, that is the result
(:mod:`tactile_lab.slam.before_fall`).

A session is lost when the last ``lost_after`` grasps are untracked, or more than half of all. A grasp that was
untracked when it was taken and has a place by now does not count, nor does a touch without a grasp that met nothing.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import Array, Contact, Grasp
from drivers.core.errors import TrackingError
from drivers.core.observability import observability, planar_observability
from drivers.core.one_thread import on_one_thread
from tactile_lab.slam.before_fall import better_known
from tactile_lab.slam.current_shape import CurrentShape
from tactile_lab.slam.doubt.assessment import Assessment, assess
from tactile_lab.slam.doubt.heights import side_heights_m
from tactile_lab.slam.doubt.rivals import displaced
from tactile_lab.slam.doubt.status import Alternative
from tactile_lab.slam.graph.back_end import BackEnd
from tactile_lab.slam.graph.relocation import relocated_poses
from tactile_lab.slam.result import SlamResult, SlamStep, Verdict
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.step_log import StepLog
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, placement_sigma_m
from tactile_lab.slam.tracking.contacts.first_pose import first_pose_vector
from tactile_lab.slam.tracking.filter.particle_filter import CERTAIN_VARIANCE, PoseEstimate
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.joint.mechanisms import Mechanism
from tactile_lab.slam.tracking.tracker import Tracker
from tactile_lab.slam.tracking.trackers import (
    GRAPH_METHODS,
    THESIS_METHODS,
    checked_known_poses,
    make_tracker,
)
from tactile_lab.slam.trajectory import Trajectory

_STAYS = 1e-9


class TactileSlam:
    """Estimates grasp by grasp. The same settings, seed and grasps give the same result."""

    def __init__(
        self,
        settings: SlamSettings | None = None,
        seed: int = 0,
        known_poses: Sequence[Pose3 | None] | None = None,
    ) -> None:
        """

        Args:
            settings: see there.
            seed: of all random numbers.
            known_poses: true ``world_T_object`` of every grasp, in order, only for method "known-pose".

        Raises:
            ConfigurationError: the method needs poses and has none, or is given poses that it must not use.
        """
        self._settings = settings or SlamSettings()
        self._known_poses = checked_known_poses(self._settings.method, known_poses)
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        back_end = self._settings.back_end
        if self._settings.method not in GRAPH_METHODS or self._settings.freedom == "space":
            back_end = back_end.model_copy(update={"enabled": False})
        self._back_end = BackEnd(
            back_end,
            as_printed=self._settings.method in THESIS_METHODS,
            noise=self._settings.motion,
        )
        self._space = self._settings.space
        self._tracker: Tracker | None = None
        self._origin_height_m = 0.0
        self._waiting: tuple[Contact, ...] = ()
        """Contacts of grasps before the object frame, while the object stays where it is."""

        self._log = StepLog(self._settings.lost_after)
        self._heights_m: Array = np.empty(0)
        """Of the contacts of an outline so far, over the table."""

        self._shape = CurrentShape(self._settings, self._settings.shape_model)
        self._has_ended = False
        self._before_fall: SlamResult | None = None

    @property
    def settings(self) -> SlamSettings:
        """The settings."""
        return self._settings

    @property
    def step_count(self) -> int:
        """Number of grasps added so far."""
        return len(self._log)

    @on_one_thread
    def add_grasp(self, grasp: Grasp) -> SlamStep:
        """Add one grasp (algorithm 3.1, then the graph).

        One that has entries that are not finite, or wrong units, counts as one without contacts; its step says why.
        """
        try:
            return self._step(grasp)
        except TrackingError as error:
            self._step(replace(grasp, contacts=()))
            return self._log.tell_last(str(error))

    def _step(self, grasp: Grasp) -> SlamStep:
        """Raises TrackingError: the grasp has entries that are not finite, or wrong units; nothing was changed."""
        started = time.perf_counter()
        if grasp.begins_anew:
            self._begin_anew()
        contacts = ContactSet.of_grasp(grasp, self._settings.dimension, self._origin_height_m)
        if self._settings.dimension == 2:
            self._heights_m = np.append(self._heights_m, side_heights_m(grasp))
        if self._tracker is None:
            return self._begin(grasp, started)
        self._tracker.predict(self._space.motion(grasp.hand_motion_world), grasp.motion_sigma)
        explained = self._tracker.weigh(contacts)
        estimate = self._tracker.estimate()
        verdict, reason = self._judge(contacts, estimate, explained)
        self._tracker.update_shape(contacts, verdict == "tracked")
        self._tracker.resample()
        self._tracker.adopt(self._back_end.close_loops(self._tracker.map))
        return self._record(grasp, contacts, verdict, reason, started)

    @on_one_thread
    def finish(self) -> SlamResult:
        """Correct all poses a last time, and build the final shape with the best kernel parameters."""
        self._has_ended = True
        if self._tracker is not None:
            self._tracker.finish()
            self._tracker.adopt(self._back_end.close_all_loops(self._tracker.map))
            self._tracker.adopt(self._tracker.map.with_best_kernel(max_iterations=30, longest_m=0.300))
        wanted = self._settings
        shape = self.shape(wanted.contour_resolution_m if wanted.dimension == 2 else wanted.mesh_resolution_m)
        told = self._assess(shape)
        trajectory = self._trajectory
        covariances, common = trajectory.covariances_with(told.alternatives)
        result = SlamResult(
            method=self._settings.method,
            seed=self._seed,
            dimension=self._settings.dimension,
            world_T_object=trajectory.poses,
            covariances=covariances,
            steps=self._log.steps,
            loops=self._back_end.reports,
            surface=self.surface,
            contour=told.shape if isinstance(told.shape, Contour) else None,
            mesh=told.shape if isinstance(told.shape, SurfaceMesh) else None,
            status=told.status,
            warnings=self._shape.warnings,
            known_share=told.known_share,
            doubts=told.doubts,
            alternatives=told.alternatives,
            common_covariances=common,
        )
        return better_known(self._before_fall, result)

    @property
    def world_T_object(self) -> Pose3 | None:
        """The present pose; None before the object frame is defined."""
        return self._trajectory.poses[-1] if self._log else None

    @property
    def trajectory(self) -> tuple[Pose3 | None, ...]:
        """The present estimate of the pose at every grasp; None if unknown."""
        return self._trajectory.poses

    @property
    def pose_covariance(self) -> Array | None:
        """Covariance of the present (x m, y m, yaw rad) in the world, shape (3, 3)."""
        return self._trajectory.covariances[-1] if self._log else None

    @property
    def origin_height_m(self) -> float:
        """Height of the object frame's origin over the table."""
        return self._origin_height_m

    @property
    @on_one_thread
    def surface(self) -> Gpis | None:
        """The present field in the object frame; None before there are contacts.

        Before the end of a long session settled contacts are represented by some of them, see :class:`CurrentShape`.
        """
        contacts = self._shape_contacts()
        return None if contacts is None else contacts.fit()

    @property
    def _trajectory(self) -> Trajectory:
        return Trajectory(self._tracker, len(self._log), self._origin_height_m)

    def _shape_contacts(self) -> ContactMap | None:
        if self._tracker is None:
            return None
        return self._shape.contacts(self._tracker.refined, has_ended=self._has_ended)

    @on_one_thread
    def shape(self, resolution_m: float) -> Contour | SurfaceMesh | None:
        """The present outline or surface by the model of the settings; None if the contacts enclose nothing yet.

        See :func:`tactile_lab.slam.current_shape.present_shape`.
        """
        contacts = self._shape_contacts()
        return None if contacts is None else self._shape.extract(contacts, self._origin_height_m, resolution_m)

    @on_one_thread
    def assess(self, shape: Contour | SurfaceMesh | None) -> Assessment:
        """How far to trust the present estimate, between grasps.

        Args:
            shape: the present outline or surface, object frame; None if there is none.
        """
        return self._assess(shape)

    def displaced(self, alternative: Alternative) -> ContactMap:
        """All contacts as they are placed if an alternative to the present estimate is right.

        Raises:
            TrackingError: there is no estimate yet.
        """
        if self._tracker is None:
            raise TrackingError("there is no estimate yet", where="tactile SLAM", hint="Add grasps first")
        return displaced(self._tracker.refined, alternative)

    def _assess(self, shape: Contour | SurfaceMesh | None) -> Assessment:
        return assess(
            self._tracker,
            shape,
            self._settings,
            self._log.refused(self._tracker),
            lost=self.is_lost,
            origin_height_m=self._origin_height_m,
            heights_m=self._heights_m,
            has_ended=self._has_ended,
        )

    @property
    def surface_grasps(self) -> NDArray[np.intp]:
        """Number of the grasp of each contact of :attr:`surface`, shape (n,): 0 for the first in the map and for all
        that are settled, and growing from there.
        """
        contacts = self._shape_contacts()
        return np.empty(0, dtype=np.intp) if contacts is None else contacts.grasp_indices

    @property
    def mechanisms_that_acted(self) -> frozenset[Mechanism]:
        """Mechanisms of method "joint" that reported a change."""
        tracker = self._tracker
        return frozenset(tracker.mechanisms.changed) if isinstance(tracker, JointTracker) else frozenset()

    @property
    def is_lost(self) -> bool:
        """See the module's docstring; a session without an object frame is lost as well."""
        return self._log.is_lost(self._tracker)

    def _begin_anew(self) -> None:
        if self._tracker is not None:
            self._before_fall, self._has_ended = self.finish(), False
        self._tracker, self._origin_height_m, self._waiting = None, 0.0, ()
        self._heights_m = np.empty(0)
        self._shape = CurrentShape(self._settings, self._settings.shape_model)

    def _begin(self, grasp: Grasp, started: float) -> SlamStep:
        """Define the object frame: origin at the contacts' centre, x axis along the palm's (section 3.4)."""
        stays = grasp.hand_motion_world.equals(Pose3(), _STAYS)
        grasp = replace(grasp, contacts=(*grasp.contacts, *(self._waiting if stays else ())))
        self._waiting = grasp.contacts
        contacts = ContactSet.of_grasp(grasp, self._settings.dimension, self._origin_height_m)
        least = self._settings.least_first_contacts
        if len(contacts) < least:
            reason = f"{len(contacts)} contacts, the object frame needs {least}"
            return self._record(grasp, contacts, "untracked", reason, started)
        following = None if self._known_poses is None else self._known_poses[len(self._log) :]
        if following is not None and (not following or following[0] is None):
            return self._record(grasp, contacts, "untracked", "its true pose is not known", started)
        on_table = self._settings.freedom == "table"
        self._origin_height_m = float(grasp.points_world_m[:, 2].mean()) if on_table else 0.0
        contacts = ContactSet.of_grasp(grasp, self._settings.dimension, self._origin_height_m)
        row = first_pose_vector(grasp, contacts, on_table=on_table)
        first = PlacedGrasp(contacts, row, CERTAIN_VARIANCE * np.eye(self._space.size), np.zeros(self._space.size))
        relocate = relocated_poses if on_table else None
        self._tracker = make_tracker(self._settings, first, self._rng, following, relocate)
        return self._record(grasp, contacts, "first", "object frame born", started)

    def _judge(self, contacts: ContactSet, estimate: PoseEstimate, explained: bool) -> tuple[Verdict, str]:
        if not explained:
            return "untracked", "no pose explains the contacts" if len(contacts) else "no contacts"
        spread_m = placement_sigma_m(contacts, estimate.pose, estimate.covariance, self._space)
        if spread_m > self._settings.placement_limit_m:
            return "uncertain", f"contacts uncertain to {1e3 * spread_m:.0f} mm"
        return "tracked", f"contacts placed to {1e3 * spread_m:.1f} mm"

    def _record(self, grasp: Grasp, contacts: ContactSet, verdict: Verdict, reason: str, started: float) -> SlamStep:
        placed = self._tracker.map.placed[-1] if self._tracker else None
        seen_by = planar_observability if self._settings.freedom == "table" else observability
        step = SlamStep(
            index=grasp.index,
            stamp_ns=grasp.stamp_ns,
            world_T_object=self._space.pose(placed.pose, self._origin_height_m) if placed else None,
            covariance=placed.covariance if placed else None,
            effective_count=self._tracker.effective_count if self._tracker else 0.0,
            observability=seen_by(contacts.points_m, contacts.normals).smallest if len(contacts) else 0.0,
            verdict=verdict,
            reason=reason,
            contacts=len(contacts),
            contacts_used=len(placed.kept) if placed else 0,
            seconds=time.perf_counter() - started,
        )
        return self._log.add(step, grasp)
