"""A cube that stays where it stands is explored grasp by grasp: figures 4.1, 4.3, 4.4 and 4.5."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gtsam import Pose2
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import spearmanr

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.fixed_solid import FixedSolid
from tactile_lab.experiments.data.sensing import NORMAL_SIGMA_rad, POINT_SIGMA_m
from tactile_lab.experiments.data.solids import solid
from tactile_lab.experiments.data.true_surface import reachable_points, within
from tactile_lab.experiments.thesis.facets import between_0_and_1, edges, faces_observer, facets, in_picture
from tactile_lab.slam.exploration.information.igef import IgefSettings, igef
from tactile_lab.slam.exploration.information.surface_uncertainty import contact_entropy
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.exploration.policy import Belief, Surface
from tactile_lab.slam.exploration.regions import RegionSettings, Weighting, unexplored_regions
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh, extract_mesh

OBJECT = "cube-6"
FIELD = GpisSettings(amplitude_m=0.0141, length_m=0.040)
"""Matérn kernel, normals observed; fixed, so that all grasps and policies are judged by the same field."""
_MESH_STEP_m = 0.007
_NEAR_m, _FAR_m = 0.010, 0.030
_TOUCHED_m = 0.012
"""Half the distance of neighbouring fingertips: this near to a contact the surface counts as touched."""
_SHOWN_SIGMA_m = 0.010
"""Standard deviation that is drawn darkest."""
_LIGHTEST_REGION = 0.4
"""Its shade; what is explored has shade 0."""

Measure = Callable[[Gpis, Surface], Array]


def explore(seed: int, grasps: int, policy: str) -> FixedSolid:
    """Grasp the cube this many times: the first grasp is random, a policy chooses the others."""
    rng = np.random.default_rng([seed, 44])
    cube, chooser = FixedSolid(solid(OBJECT), rng), make_policy(policy)
    candidates = cube.candidates()
    cube.grasp(candidates[int(rng.integers(len(candidates)))])
    for _ in range(1, grasps):
        field, mesh = fitted(cube)
        belief = Belief(field, Surface.of(mesh), cube.points_m, cube.normals, cube.grasp_indices, Pose2())
        chosen = chooser.choose(candidates, belief, rng).chosen
        cube.grasp(candidates[int(rng.integers(len(candidates))) if chosen is None else chosen])
    return cube


def fitted(cube: FixedSolid) -> tuple[Gpis, SurfaceMesh]:
    """The field through all contacts, and its surface on the table. Raises ShapeError if they enclose nothing."""
    field = Gpis.fit(cube.points_m, cube.normals, POINT_SIGMA_m, NORMAL_SIGMA_rad, FIELD)
    return field, extract_mesh(field, resolution_m=_MESH_STEP_m, floor_m=0.0)


def progress(cell: Cell) -> dict[str, Any]:
    """The surface after some grasps (figures 4.4 and 4.5). Cell: policy, grasps made."""
    cube = explore(cell.seed, int(cell["after"]), str(cell["policy"]))
    _, mesh = fitted(cube)
    truth = cube.true_mesh
    errors = mesh_errors(mesh, truth)
    touched = within(reachable_points(truth, 3), cube.points_m, _TOUCHED_m)
    shades = np.clip(mesh.sigma_m / _SHOWN_SIGMA_m, 0.0, 1.0)
    return {
        "contacts": len(cube.points_m),
        "hausdorff_mm": 1e3 * errors.hausdorff_m,
        "mean_mm": 1e3 * errors.mean_distance_m,
        "touched": float(touched.mean()),
        "picture": _picture(mesh, shades, cube),
    }


def divided(cell: Cell) -> dict[str, Any]:
    """Regions of the unexplored surface (figure 4.3, appendix B). Cell: weighting, grasps made."""
    cube = explore(cell.seed, int(cell["after"]), "clusters")
    _, mesh = fitted(cube)
    surface = Surface.of(mesh)
    weighting: Weighting = "appendix" if cell["weighting"] == "appendix" else "text"
    regions = unexplored_regions(surface, RegionSettings(weighting=weighting))
    members = [region.members for region in regions]
    extents = [1e3 * float(np.linalg.norm(np.ptp(surface.points_m[own], axis=0))) for own in members]
    unknown = np.mean(surface.sigma_m > RegionSettings().unknown_sigma_m)
    return {
        "regions": len(regions),
        "extents_mm": extents,
        "unexplored": float(unknown),
        "picture": _picture_of_regions(mesh, members, cube),
    }


def mapped(cell: Cell) -> dict[str, Any]:
    """A measure of uncertainty over the surface after one grasp (figure 4.1). Cell: measure."""
    cube = explore(cell.seed, 1, "random")
    field, mesh = fitted(cube)
    surface = Surface.of(mesh)
    values = between_0_and_1(MEASURES[str(cell["measure"])](field, surface))
    away_m = np.asarray(cKDTree(cube.points_m).query(surface.points_m)[0])
    bands = {"near": away_m < _NEAR_m, "between": (away_m >= _NEAR_m) & (away_m < _FAR_m), "far": away_m >= _FAR_m}
    variance = between_0_and_1(_variance(field, surface))
    return {
        "contacts": len(cube.points_m),
        **{name: float(values[band].mean()) if band.any() else None for name, band in bands.items()},
        "with_variance": float(spearmanr(values, variance).statistic),
        "picture": _picture(mesh, values, cube),
    }


def _variance(field: Gpis, surface: Surface) -> Array:
    return np.asarray(field.variance(surface.points_m))


def _entropy(field: Gpis, surface: Surface) -> Array:
    """Of one more contact at each place."""
    return np.array([contact_entropy(np.array([[variance]])) for variance in _variance(field, surface)])


def _information_gain(field: Gpis, surface: Surface) -> Array:
    return igef(surface, field.contacts_m, field.normals, surface.points_m, IgefSettings()).product


MEASURES: Mapping[str, Measure] = {
    "variance": _variance,
    "entropy": _entropy,
    "information gain estimation": _information_gain,
}
"""Equations 4.7, 4.10 and 4.15 at the vertices of a surface."""


def _picture(mesh: SurfaceMesh, shades: Array, cube: FixedSolid) -> dict[str, Any]:
    return {
        "facets": facets(mesh.vertices, mesh.faces, shades),
        "edges": edges(cube.true_mesh),
        "dots": in_picture(_in_sight(mesh, cube.points_m)),
    }


def _in_sight(mesh: SurfaceMesh, points_m: Array) -> Array:
    """The points on the side of the surface that the picture shows."""
    _, nearest = cKDTree(mesh.vertices).query(points_m)
    return np.asarray(points_m[faces_observer(mesh.normals[nearest])])


def _picture_of_regions(mesh: SurfaceMesh, members: Sequence[NDArray[np.intp]], cube: FixedSolid) -> dict[str, Any]:
    """Each region in a shade of its own with its number, what is explored in the lightest."""
    shades, names = np.zeros(len(mesh.vertices)), []
    unknown = np.flatnonzero(mesh.sigma_m > RegionSettings().unknown_sigma_m)
    if members:
        own = np.concatenate([np.full(len(part), number) for number, part in enumerate(members)])
        _, nearest = cKDTree(mesh.vertices[np.concatenate(members)]).query(mesh.vertices[unknown])
        shades[unknown] = np.linspace(_LIGHTEST_REGION, 1.0, len(members))[own[nearest]]
    for number, part in enumerate(members, start=1):
        seen = part[faces_observer(mesh.normals[part])]
        if len(seen):
            names.append([str(number), *in_picture(mesh.vertices[seen].mean(axis=0, keepdims=True))[0]])
    return {**_picture(mesh, shades, cube), "names": names}
