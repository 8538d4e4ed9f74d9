"""The content of a report, gathered once: no file is read afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.poses import rotate, transform_points
from tactile_lab.evaluation.files.properties_file import MeasuredBody
from tactile_lab.evaluation.files.results import Results
from tactile_lab.evaluation.files.tables import ContactRows
from tactile_lab.evaluation.trajectory import estimate_T_truth
from tactile_lab.report.camera_picture import CameraView
from tactile_lab.report.course import Course

Faces = NDArray[np.int64]
FLAT_m = 1e-7


@dataclass(frozen=True)
class SessionFacts:
    """The session's manifest as text for people.

    Attributes:
        headline: the object as people call it; a mesh by its file's name alone.
        rig: name of the rig.
        started: date and time, ISO 8601, or "" with a virtual clock.
        status: closed, interrupted, failed or recovered.
        notes: the operator's notes.
        problem: why the session failed, "" if it did not.
        made_with: names and values of command, versions and settings.
        calibrations: file name and hash of each calibration copy.
    """

    headline: str
    rig: str
    started: str = ""
    status: str = "closed"
    notes: str = ""
    problem: str = ""
    made_with: tuple[tuple[str, str], ...] = ()
    calibrations: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Surface:
    """A triangle mesh in the estimate's object frame with a standard deviation at each vertex, NaN for a guess."""

    vertices_m: Array
    faces: Faces
    sigma_m: Array
    normals: Array | None = None


def outward_normals(ring: Array) -> Array:
    """Unit normals of a closed ring of points, pointing out of it, shape (n, 2)."""
    tangent = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-12)
    area = np.sum(ring[:, 0] * np.roll(ring[:, 1], -1) - ring[:, 1] * np.roll(ring[:, 0], -1))
    return np.asarray(normal * np.sign(area))


def with_plain_lids(surface: Surface) -> Surface:
    """An upright prism whose flat ends have no uncertainty: their corners are doubled, with sigma NaN. The ends of a
    planar session's solid were never touched; colours interpolated from their rims would be misleading.
    """
    corners = surface.vertices_m[surface.faces]
    lid = np.ptp(corners[:, :, 2], axis=1) < FLAT_m
    count = len(surface.vertices_m)
    return Surface(
        np.concatenate([surface.vertices_m, surface.vertices_m]),
        np.where(lid[:, None], surface.faces + count, surface.faces),
        np.concatenate([surface.sigma_m, np.full(count, np.nan)]),
    )


@dataclass(frozen=True)
class TrueShape:
    """Ground truth from the marker camera and the object's model; the model is in the truth's own object frame.

    Attributes:
        world_T_object: true pose of each grasp or None.
        mesh: vertices (n, 3) and faces (m, 3), or None.
        outline_m: the model's horizontal section at the contacts, shape (n, 2), or None.
    """

    world_T_object: tuple[Pose3 | None, ...]
    mesh: tuple[Array, Faces] | None = None
    outline_m: Array | None = None


@dataclass(frozen=True)
class ReportContent:
    """The content of one report.

    Attributes:
        facts: the session's manifest.
        results: the SLAM results.
        evaluation: ``evaluation.json``, or None if the session was not evaluated.
        surface: the estimated surface, or None if there is none.
        contour_m: the estimated contour or section, shape (n, 2), estimate's object frame, or None.
        contour_sigma_m: standard deviation at each point of the contour, shape (n,); NaN where it is a guess.
        truth: ground truth, or None.
        fitted_outline_m: the true outline fitted to the estimate, shape (n, 2), estimate's object frame, or None.
        measured: what is known of the object's mass, as it was weighed.
        course: decisions and stops of the session.
        camera: the marker camera's last picture of a grasp, or None.
        camera_problem: why there is none, "" for a session without camera.
    """

    facts: SessionFacts
    results: Results
    evaluation: Mapping[str, Any] | None = None
    surface: Surface | None = None
    contour_m: Array | None = None
    contour_sigma_m: Array = field(default_factory=lambda: np.zeros(0))
    truth: TrueShape | None = None
    fitted_outline_m: Array | None = None
    measured: MeasuredBody = field(default_factory=MeasuredBody)
    course: Course = field(default_factory=Course)
    camera: CameraView | None = None
    camera_problem: str = ""

    def pose_sigma(self, grasp: int) -> tuple[float | None, float | None]:
        """Stated standard deviations of a grasp's position, millimetres, and rotation, degrees; None if unknown."""
        covariances = self.results.trajectory.covariances
        covariance = covariances[grasp] if covariances else None
        if covariance is None:
            return None, None
        variances = np.diag(covariance)
        return 1e3 * float(np.sqrt(variances[:3].sum())), float(np.degrees(np.sqrt(variances[3:].sum())))

    def band_m(self) -> tuple[Array, ...]:
        """The contour moved by two standard deviations outward and inward, each of shape (n, 2); empty if unknown.

        Where it is a guess it has no band.
        """
        if self.contour_m is None or len(self.contour_sigma_m) != len(self.contour_m):
            return ()
        aside = 2.0 * np.nan_to_num(self.contour_sigma_m)[:, None] * outward_normals(self.contour_m)
        return self.contour_m + aside, self.contour_m - aside

    @property
    def estimate_T_truth(self) -> Pose3 | None:
        """The truth's object frame in the estimate's, by the first grasp that has both."""
        if self.truth is None:
            return None
        return estimate_T_truth(self.results.trajectory.world_T_object, self.truth.world_T_object)

    def truth_outline_m(self) -> Array | None:
        """The true outline in the estimate's object frame, shape (n, 2)."""
        alignment = self.estimate_T_truth
        if self.truth is None or self.truth.outline_m is None or alignment is None:
            return None
        flat = np.column_stack([self.truth.outline_m, np.zeros(len(self.truth.outline_m))])
        return transform_points(alignment, flat)[:, :2]

    def truth_mesh(self) -> tuple[Array, Faces] | None:
        """The true mesh in the estimate's object frame."""
        alignment = self.estimate_T_truth
        if self.truth is None or self.truth.mesh is None or alignment is None:
            return None
        vertices, faces = self.truth.mesh
        return transform_points(alignment, vertices), faces

    def placed_contacts(self) -> list[PlacedContacts]:
        """The contacts of every placed grasp in the estimate's object frame."""
        poses = self.results.trajectory.world_T_object
        placed = []
        for index, (pose, rows) in enumerate(zip(poses, self.results.contacts, strict=True)):
            if pose is not None:
                points = transform_points(pose.inverse(), rows.points_world_m)
                placed.append(PlacedContacts(index, rows, points, rotate(pose.inverse(), rows.normals_world)))
        return placed


@dataclass(frozen=True)
class PlacedContacts:
    """Contacts of one grasp in the estimate's object frame: points (n, 3) and outward normals (n, 3)."""

    grasp: int
    rows: ContactRows
    points_m: Array
    normals: Array
