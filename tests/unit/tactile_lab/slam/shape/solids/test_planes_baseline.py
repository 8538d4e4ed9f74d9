"""Numbers of planes through contacts on fixed problems: clusters, regular planes, their cells, and what is material."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.regularities import offsets_of_faces, regular_normals
from tactile_lab.slam.shape.solids.cells import Arrangement, Mask, arrange
from tactile_lab.slam.shape.solids.extent import field_end, open_sides
from tactile_lab.slam.shape.solids.labels import label_cells
from tactile_lab.slam.shape.solids.merging import fit_normals, merge_clusters
from tactile_lab.slam.shape.solids.mesh import FacetMesh, area_weighted_normals, borders, boundary, refine
from tactile_lab.slam.shape.solids.planes import (
    Planes,
    WeightedContacts,
    divide,
    fit_planes,
    plane_price,
    segment_planes,
    weighted_contacts,
)
from tactile_lab.slam.shape.solids.regularity import RegularPlanes, regularise
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_box, contacts_on_sphere, noisy
from tests.support.solid_examples import contacts_on, l_block_mesh


def on_l_block(count: int, seed: int) -> WeightedContacts:
    """Noisy contacts, no two with the same standard deviations."""
    points_m, normals = contacts_on(l_block_mesh(), count, seed)
    return weighted_contacts(points_m, normals, np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count))


def told(planes: Planes) -> dict[str, object]:
    return {
        "labels": planes.labels,
        "normals": planes.normals,
        "offsets": planes.offsets_m,
        "chi_square": planes.chi_square,
        "heights": planes.heights_m(np.array([[0.01, 0.02, 0.03]])),
    }


def regular_told(found: RegularPlanes) -> dict[str, object]:
    places_m = np.array([[0.0, 0.0, 0.0], [0.05, -0.03, 0.02]])
    return {
        "planes": told(found.planes),
        "middles": found.middles_m,
        "sigma": [1e3 * found.sigma_m(plane, places_m) for plane in range(found.planes.count)],
        "offset sigma": 1e3 * np.sqrt(found.offset_variances_m2),
        "areas": found.log_angle_areas,
        "saved": found.saved,
    }


def faceted(mesh: FacetMesh) -> list[object]:
    return [digest(mesh.vertices_m), digest(mesh.triangles), digest(mesh.planes), digest(area_weighted_normals(mesh))]


def test_best_normals_of_clusters() -> None:
    """Round, flat and long clusters, pulled along, across and not at all."""
    k = np.arange(8.0)[:, None]
    arms = np.sin(np.arange(8 * 9).reshape(8, 3, 3) * (1.0 + 0.1 * k[:, :, None])) * 10.0 ** (k[:, :, None] / 3)
    pulls = 50 * np.column_stack([np.cos(k), np.sin(k), 0.3 * np.cos(2 * k)])
    pulls[3], pulls[4] = 0.0, [0.0, 0.0, 200.0]
    found = fit_normals(arms @ arms.transpose(0, 2, 1), pulls)
    assert_baseline(
        "shape/solids/normals", {"normals": np.delete(found, 3, axis=0), "length": np.linalg.norm(found[3])}
    )


def test_clusters_of_contacts() -> None:
    """An L divided with low and high limits, and only among similar normals; and no contacts."""
    contacts = on_l_block(40, seed=4)
    columns = contacts.points_m, contacts.normals, contacts.point_weights, contacts.normal_weights
    values: dict[str, object] = {
        f"{limit}, {cosine}": merge_clusters(*columns, limit, cosine)
        for limit, cosine in ((2.0, 0.6), (15.0, 0.6), (60.0, 0.6), (1e4, 0.6), (1e4, 0.95))
    }
    values["none"] = merge_clusters(*(each[:0] for each in columns), 1.0, 0.5)
    assert_baseline("shape/solids/clusters", values)


def test_planes_of_contacts() -> None:
    """An L, a ball, few contacts, and clusters that contacts leave for better ones or that dissolve."""
    ball = noisy(*contacts_on_sphere(0.04, 40, 3, seed=3), seed=3)
    contacts = on_l_block(60, seed=5)
    values: dict[str, object] = {
        "L": told(divide(contacts)),
        "ball": told(segment_planes(*ball, 0.001, 0.08)),
        "few": told(segment_planes(*(each[:2] for each in ball), 0.001, np.array([0.1, 0.2]))),
        "alternating": told(fit_planes(contacts, np.arange(60) % 5)),
        "prices": [plane_price(count) for count in (0, 1, 2, 3, 50)],
        "exact": [weighted_contacts(*ball, 0.0, 1e-7).point_weights[0]],
    }
    gaps = []
    for step in range(14):  # two parallel walls, and single contacts of one that rise towards the other
        flat = np.stack(np.meshgrid(np.linspace(0, 0.04, 4), np.linspace(0, 0.03, 3)), axis=-1).reshape(-1, 2)
        points_m = np.vstack([np.column_stack([flat, np.full(12, z)]) for z in (0.0, 0.0006 * step)])
        gaps.append(digest(segment_planes(points_m, np.tile([0.0, 0.0, 1.0], (24, 1)), 0.001, 0.08).labels))
    values["gaps"] = gaps
    assert_baseline("shape/solids/planes", values)


def test_regular_planes() -> None:
    """An L with and without regularities, and a leaning one for which nothing is upright."""
    contacts = on_l_block(50, seed=6)
    planes = divide(contacts)
    values = {
        "upright": regular_told(regularise(contacts, planes, upright=True)),
        "leaning": regular_told(regularise(contacts, planes, upright=False)),
        "plain": regular_told(regularise(contacts, planes, upright=True, regular=False)),
    }
    assert_baseline("shape/solids/regular_planes", values)


def test_regularities_of_directions() -> None:
    """Faces turned ever farther from regular, with vague and precise directions, in space and in the plane."""
    values: dict[str, object] = {}
    for dimension in (2, 3):
        for sigma in (0.03, 0.09):
            rows = []
            for step in range(10):
                turn = np.deg2rad(1.9 * step + 0.4)
                turned = np.array([np.sin(turn), np.cos(turn), 0.05 * step])[:dimension]
                normals = np.vstack([np.eye(dimension), turned / np.linalg.norm(turned), -np.eye(dimension)[:1]])
                spread = sigma**2 * np.diag(1.0 + 0.3 * np.sqrt(np.arange(normals.size)))
                found = regular_normals(normals, spread, upright=dimension == 3)
                said = " ".join(f"{each.kind} {each.face} {each.other}," for each in found.regularities)
                rows.append([found.normals[-2], 1e3 * np.diag(found.covariance), said, found.saved])
            values[f"{dimension}, {sigma}"] = rows
    contacts = on_l_block(20, seed=7)
    normals, labels = np.array([[0.0, 0.0, 1.0], [0.6, 0.8, 0.0]]), np.arange(20) % 2
    values["offsets"] = offsets_of_faces(contacts.points_m, contacts.point_weights**-0.5, labels, normals)
    assert_baseline("shape/solids/regularities", values)


def cut_box(count: int = 4) -> Arrangement:
    """A box of 100 x 80 x 60 mm cut by planes of all directions."""
    normals = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, -0.2], [0.0, 0.1, 1.0], [-0.7, 0.7, 0.3], [1.0, 0.0, 0.0]])
    normals = normals[:count] / np.linalg.norm(normals[:count], axis=1, keepdims=True)
    offsets_m = np.array([0.012, -0.006, 0.004, 0.0, -0.03])[:count]
    return arrange(normals, offsets_m, np.array([-0.05, -0.04, -0.03]), np.array([0.05, 0.04, 0.03]))


def surface_of(found: Arrangement, material: Mask) -> object:
    try:
        return faceted(boundary(found, material))
    except ShapeError as error:
        return str(error)


def test_cells_between_planes() -> None:
    """Corners, facets, volumes and areas of all cells; places in them; their surface, refined."""
    found = cut_box(5)
    places_m = 0.055 * np.sin(np.arange(60.0).reshape(20, 3))
    facets = [[*each.loop, each.plane, each.below, each.above] for each in found.facets]
    sides = np.linspace(-0.03, 0.03, found.cell_count) < 0.01
    mesh = boundary(found, sides)
    values = {
        "vertices": found.vertices_m,
        "facets": [sum(each) for each in facets],
        "signs": [int(row @ (1 << np.arange(5))) for row in found.signs],
        "centres": digest(found.centres_m),
        "volumes": 1e6 * found.volumes_m3,
        "areas": 1e4 * found.areas_m2,
        "places": found.locate(places_m),
        "surface": faceted(mesh),
        "refined": faceted(refine(mesh, 0.02)),
        "borders": borders(mesh),
        "touching": [surface_of(found, np.arange(found.cell_count) % step == 1) for step in (2, 3, 4, 5, 7, 8)],
    }
    assert_baseline("shape/solids/cells", values)
    with pytest.raises(ShapeError, match="enclose nothing"):
        boundary(found, np.zeros(found.cell_count, dtype=bool))


def small_field() -> Gpis:
    points_m, normals = contacts_on_box(np.array([0.06, 0.05, 0.04]), 24, seed=3)
    return Gpis.fit(points_m, normals, 0.001, 0.08).with_log_parameters(np.log([0.0009, 0.05]))


def lattice() -> Arrangement:
    """Twelve cells of about 12 mm edge amid the open ones at the sides of a box that stands at height -0.03."""
    normals = np.array([[1.0, 0.02, 0.0]] * 4 + [[0.0, 1.0, 0.03]] * 3 + [[0.02, 0.0, 1.0]] * 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets_m = np.array([-0.017, -0.006, 0.007, 0.018, -0.012, 0.001, 0.013, -0.012, 0.001, 0.014])
    return arrange(normals, offsets_m, np.full(3, -0.03), np.full(3, 0.03))


def test_which_cells_are_material() -> None:
    """By the field alone and with contacts, on a floor or not, and where a finger passed cells ever more often."""
    found, field = lattice(), small_field()
    contacts_m = np.array(
        [[0.018, 0.004, 0.006], [0.018, -0.008, -0.006], [-0.004, -0.012, 0.004], [0.012, 0.004, 0.014]]
    )
    labels, none = np.array([3, 3, -1, 9]), np.empty((0, 3))
    touched = Planes(labels, found.normals, found.offsets_m, 0.0)
    alone = Planes(np.full(4, -1), found.normals, found.offsets_m, 0.0)

    def material(planes: Planes, free_m: Array, floor_m: float | None) -> list[int]:
        return np.flatnonzero(label_cells(found, planes, contacts_m, field, free_m, floor_m)).tolist()

    values: dict[str, object] = {
        f"floor {floor_m}": [material(planes, none, floor_m) for planes in (alone, touched)]
        for floor_m in (None, -0.03, -0.03 + 2e-6, -0.02)
    }
    inner_m = found.centres_m[material(alone, none, None)]
    for name, planes in (("alone", alone), ("touched", touched)):
        passed = [np.repeat(inner_m, count, axis=0) for count in range(14)]
        values[name] = [material(planes, free_m, None) for free_m in passed]
    one_by_one = [np.repeat(inner_m[:k], 12, axis=0) for k in range(len(inner_m))]
    values["one by one"] = [material(touched, free_m, None) for free_m in one_by_one]
    assert_baseline("shape/solids/material", values)


def test_ends_of_a_field_on_sides_without_a_plane() -> None:
    """With walls leaning ever more, with and without a floor; ends in several directions."""
    field = small_field()
    values: dict[str, list[object]] = {"sides": [], "ends": []}
    for step in range(12):
        lean = np.deg2rad(8.0 * step)
        normals = np.array([[np.cos(lean), 0.0, np.sin(lean)], [0.0, np.sin(lean), -np.cos(lean)]])
        planes = Planes(np.zeros(1, np.int64), normals, np.full(2, 0.03), 0.0)
        for floor_m in (None, -0.02):
            caps = open_sides(field, planes, floor_m)
            values["sides"].append([[*each.normal, each.offset_m] for each in caps])
    for side in (np.array([0.0, 0.0, 1.0]), np.array([0.6, -0.8, 0.0]), np.array([-0.48, 0.6, -0.64])):
        cap = field_end(field, side)
        values["ends"].append([*cap.foot_m, cap.offset_m, cap.sigma_m])
    far = field_end(field.of_some(np.arange(4)), np.array([0.0, 0.0, -1.0]))
    values["ends"].append([*far.foot_m, far.offset_m, far.sigma_m])
    assert_baseline("shape/solids/extent", values)


def test_long_triangles_are_halved() -> None:
    """Triangles with no, one, two and three long edges, all three ways around."""
    corners: Array = np.array(
        [[0.0, 0, 0], [1, 0, 0], [0.4, 0.9, 0], [2.3, 0.3, 0.2], [0.1, 0.1, 2.0], [0.05, 0.02, 0.1]]
    )
    values = []
    for triangle in ([0, 1, 2], [0, 3, 2], [0, 3, 4], [0, 5, 4], [1, 3, 5]):
        for turn in range(3):
            rows = np.roll(triangle, turn)[None]
            mesh = FacetMesh(corners, rows.astype(np.int64), np.array([7]))
            values.append([faceted(refine(mesh, longest)) for longest in (0.6, 1.5)])
    assert_baseline("shape/solids/halved", {"triangles": values})
