"""The input of the metrics: an estimate read from its files, the ground truth, and derived values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import trimesh
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.evaluation.files.mesh_io import read_mesh
from tactile_lab.evaluation.files.results import Results
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.evaluation.registration import in_object_m, registration_rms_mm
from tactile_lab.evaluation.shape import (
    ShapeComparison,
    compare_contour,
    compare_mesh,
    contact_height_m,
    horizontal_outline,
)
from tactile_lab.evaluation.trajectory import compared_grasps, estimate_T_truth
from tactile_lab.evaluation.truth.rotational_symmetry import (
    ORIGIN_m,
    modulo_mesh_symmetry,
    modulo_symmetry,
    outline_symmetry,
    symmetry_turns,
)
from tactile_lab.slam.doubt.symmetry import Symmetry


@dataclass(frozen=True)
class Truth:
    """Ground truth, for the evaluation only.

    Attributes:
        world_T_object: the object's pose at each grasp by the marker camera, None if it was not seen.
        mesh: the object's surface in the truth's object frame, or None.
        outline_m: its horizontal outline in that frame, shape (n, 2), if only that is known.
    """

    world_T_object: tuple[Pose3 | None, ...]
    mesh: trimesh.Trimesh | None = None
    outline_m: Array | None = None


@dataclass(frozen=True)
class EstimateWithTruth:
    """An estimate with its ground truth.

    Attributes:
        folder: of the results.
        results: its content.
        truth: the ground truth, with one pose per grasp.
    """

    folder: Path
    results: Results
    truth: Truth

    @property
    def poses(self) -> tuple[Pose3 | None, ...]:
        """The estimated ``world_T_object`` at each grasp, None if there is none."""
        return self.results.trajectory.world_T_object

    @cached_property
    def symmetry(self) -> Symmetry | None:
        """Rotational symmetry of the true surface about its own axis, or of the true outline; None if it has none."""
        if self.truth.mesh is not None:
            turns = symmetry_turns(self.truth.mesh)
            return None if turns is None else Symmetry(turns, ORIGIN_m)
        return None if self.truth.outline_m is None else outline_symmetry(self.truth.outline_m)

    @property
    def symmetry_turns(self) -> int | None:
        """Order of that symmetry; None if there is none or the true shape is unknown."""
        return None if self.symmetry is None else self.symmetry.order

    @cached_property
    def poses_modulo_symmetry(self) -> tuple[Pose3 | None, ...]:
        """The estimated poses, turned by symmetries of the object towards the true heading; a ball's as it rolled."""
        if self.truth.mesh is not None:
            return modulo_mesh_symmetry(self.poses, self.truth.world_T_object, self.truth.mesh, self.symmetry_turns)
        centre_m = ORIGIN_m if self.symmetry is None else self.symmetry.centre_m
        return modulo_symmetry(self.poses, self.truth.world_T_object, self.symmetry_turns, centre_m)

    @property
    def placed_contacts_m(self) -> Array:
        """Contacts of all placed grasps in the estimate's object frame, shape (m, d)."""
        placed = zip(self.results.contacts, self.poses, strict=True)
        points_m = in_object_m((rows.points_world_m, pose) for rows, pose in placed if pose is not None)
        return points_m[:, : self.results.dimension]

    @cached_property
    def registration_rms_mm(self) -> float | None:
        """See :func:`tactile_lab.evaluation.registration.registration_rms_mm`; rotations of symmetry do not count."""
        points = [rows.points_world_m for rows in self.results.contacts]
        told = self.poses_modulo_symmetry
        return registration_rms_mm(points, told, self.truth.world_T_object, self.results.dimension)

    @cached_property
    def shape(self) -> tuple[ShapeComparison | None, tuple[str, ...]]:
        """The contour or mesh compared with the truth, None if one of them is missing; and the reason.

        Raises:
            ShapeError: the true mesh or contour cannot be compared.
        """
        name = "contour.csv" if self.results.dimension == 2 else "mesh.ply"
        if not (self.folder / name).is_file():
            return None, ()
        alignment = estimate_T_truth(self.poses, self.truth.world_T_object)
        truth_T_estimate = None if alignment is None else alignment.inverse()
        if self.results.dimension == 3:
            mesh = self.truth.mesh
            return (None, ()) if mesh is None else _surface(self.folder / name, mesh, truth_T_estimate)
        outline = true_outline(self.results, self.truth)
        estimate = read_contour(self.folder / name).points_m
        return None if outline is None else compare_contour(estimate, outline, truth_T_estimate), ()


def _surface(
    path: Path, truth: trimesh.Trimesh, truth_T_estimate: Pose3 | None
) -> tuple[ShapeComparison | None, tuple[str, ...]]:
    """A completely wrong surface is a result too: no metrics, but the reason."""
    try:
        mesh = read_mesh(path)
    except ShapeError as error:
        return None, (f"the estimated surface cannot be compared: it {error.what}",)
    return compare_mesh(mesh, truth, truth_T_estimate), ()


def true_outline(results: Results, truth: Truth) -> Array | None:
    """The true outline, shape (n, 2), truth's object frame: as given, or the mesh's section at the contacts' mean
    height (at half the mesh's height without true poses).
    """
    if truth.outline_m is not None:
        return truth.outline_m
    if truth.mesh is None:
        return None
    points, poses = seen_contacts(results, truth)
    known = any(len(found) for found in points)
    height_m = contact_height_m(points, poses) if known else float(truth.mesh.bounds[:, 2].mean())
    return horizontal_outline(truth.mesh, height_m)


def seen_contacts(results: Results, truth: Truth) -> tuple[list[Array], list[Pose3]]:
    """World contacts and true pose of every grasp that the camera saw."""
    pairs = compared_grasps(truth.world_T_object, truth.world_T_object)
    return [results.contacts[pair.index].points_world_m for pair in pairs], [pair.truth for pair in pairs]
