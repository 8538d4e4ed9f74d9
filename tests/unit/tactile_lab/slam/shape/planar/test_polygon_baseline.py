"""Numbers of outlines with straight faces on fixed problems: joints, sigma, evidence, simple and crossed polygons."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.joints import JointMaker
from tactile_lab.slam.shape.planar.outlines import encloses, is_simple
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.planar.regularity import with_right_angles
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts, divide, segment
from tactile_lab.slam.shape.surfaces.surface import Contour
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_polygon, l_block, rectangle


def ring(outline_m: Array, grown: float) -> Contour:
    """A provisional outline with four points a side, its sigma growing along it."""
    following = np.roll(outline_m, -1, axis=0)
    share = np.arange(8)[:, None, None] / 8
    points_m = grown * (outline_m + share * (following - outline_m)).transpose(1, 0, 2).reshape(-1, 2)
    return Contour(points_m, np.linspace(0.001, 0.004, len(points_m)), is_closed=True)


def on_sides(sides: list[tuple[Array, Array, int]], sigma_m: Array | float = 0.001) -> PlanarContacts:
    """Exact contacts evenly along pieces from start to end, counter-clockwise."""
    points_m, normals = [], []
    for start_m, end_m, count in sides:
        along = np.subtract(end_m, start_m)
        points_m.append(start_m + np.linspace(0.0, 1.0, count)[:, None] * along)
        normals.append(np.tile([along[1], -along[0]] / np.linalg.norm(along), (count, 1)))
    return PlanarContacts.of(np.vstack(points_m), np.vstack(normals), sigma_m, 0.08)


def told(polygon: Polygon) -> dict[str, object]:
    contour = polygon.contour(0.004)
    return {
        "outline": polygon.outline_m,
        "sigma": polygon.vertex_sigma_m,
        "faces": polygon.edge_faces,
        "evidence": polygon.log_evidence,
        "corners": polygon.corners_m,
        "convex": polygon.corners.places_m,
        "contour": digest(contour.points_m),
        "contour sigma": digest(contour.sigma_m),
    }


def test_polygons_of_noisy_contacts() -> None:
    """An L and a rectangle, with more scatter than stated, with few contacts, and with contacts at corners."""
    values: dict[str, object] = {}
    for name, outline_m, count, noise in (("L", l_block(), 40, 1.0), ("scatter", rectangle(), 30, 2.5)):
        points_m, normals = contacts_on_polygon(outline_m, count, seed=3, noise=noise)
        contacts = PlanarContacts.of(points_m, normals, np.linspace(0.0008, 0.0012, count), 0.08)
        faces = with_right_angles(contacts, segment(contacts, outline_m))
        at_corner = PlanarContacts.of(outline_m[:1] - 0.0005, -np.full((1, 2), np.sqrt(0.5)), 0.001, 0.08)
        values[name] = told(Polygon.of(contacts, faces, ring(outline_m, 1.02)))
        values[f"{name}, corner"] = told(Polygon.of(contacts, faces, None, at_corner))
    triangle_m = np.array([[0.0, 0.0], [0.06, 0.0], [0.02, 0.05]])
    contacts = on_sides([(triangle_m[k - 1], triangle_m[k], 4) for k in range(3)])
    three = Polygon.of(contacts, divide(contacts, np.arange(12)))
    values["triangle"] = told(three)
    values["as usual"] = [digest(three.contour().points_m), three.contour().is_closed]
    assert_baseline("shape/planar/polygons", values)
    with pytest.raises(ShapeError, match="has no surface"):
        three.mesh()


def joints(
    sides: list[tuple[Array, Array, int]], provisional: Contour | None, sigma_m: Array | float
) -> list[list[float]]:
    """What joins each side with the next: number of points, their sum, and the sum of their sigmas."""
    contacts = on_sides(sides, sigma_m)
    along = np.array([np.subtract(end_m, start_m) for start_m, end_m, _ in sides])
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    offsets_m = np.sum(outward * [start_m for start_m, _, _ in sides], axis=1)
    labels, numbers = np.repeat(np.arange(len(sides)), [count for _, _, count in sides]), np.arange(len(sides))
    angles = np.arctan2(outward[:, 1], outward[:, 0])
    faces = Faces(labels, angles, offsets_m, np.arange(len(labels)), 0.0, numbers)
    maker = JointMaker(contacts, faces, provisional)
    found = [maker.between(face, (face + 1) % len(sides)) for face in range(len(sides))]
    return [[len(one.points_m), *one.points_m.sum(axis=0), float(np.nansum(one.sigma_m))] for one in found]


def test_faces_meet_in_a_corner_or_by_a_bridge() -> None:
    """The sides of a square and what joins them, as one thing grows: an angle, the distance of contacts from a corner,
    their overlap beyond it with few or many on a side, the distance of the provisional outline, the error of contacts.
    """
    low, right, top, left = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
    square, back = np.array([low, right, top, left]), [(top, left, 5), (left, low, 5)]
    values: dict[str, list[list[list[float]]]] = {
        name: [] for name in ("angle", "gap", "far", "sparse", "first", "last", "many", "vague", "unlike")
    }
    unlike_m = np.where(np.arange(20) < 5, 0.0005, 0.001)
    for step in range(12):
        turn = np.deg2rad(2.0 + step)
        bent_m = np.array([0.0, -0.05]) + 0.05 * np.array([np.cos(turn), np.sin(turn)])
        flat = [(low, np.array([-0.005, -0.05]), 4), (np.array([0.001, -0.05]), bent_m, 4), (bent_m, top, 4), *back]
        values["angle"].append(joints(flat, None, 0.001))
        gap_m = 0.006 * step
        sides = [(low, right - [gap_m, 0.0], 12), (np.add(right, [0.0, gap_m]), top, 12), *back]
        values["gap"].append(joints(sides, ring(square, 0.75), 0.001))
        apart = [(low, np.add(low, [0.04, 0.0]), 12), (np.add(right, [0.0, 0.06]), top, 12), *back]
        values["far"].append(joints(apart, ring(square, 1.0 - 0.05 * step), 0.001))
        apart = [(low, np.add(low, [0.04, 0.0]), 4 + 2 * step), (np.add(right, [0.0, 0.06]), top, 2), *back]
        values["sparse"].append(joints(apart, ring(square, 0.75), 0.001))
        beyond_m = 0.0013 * step
        values["first"].append(joints([(low, np.add(right, [beyond_m, 0.0]), 5), (right, top, 5), *back], None, 0.001))
        values["unlike"].append(
            joints([(low, np.add(right, [beyond_m, 0.0]), 5), (right, top, 5), *back], None, unlike_m)
        )
        values["last"].append(joints([(low, right, 5), (right - [0.0, beyond_m], top, 5), *back], None, 0.001))
        both = [(low, np.add(right, [0.02, 0.0]), 2 + step), (right, top, 13 - step), *back]
        values["many"].append([*joints(both, None, 0.001), *joints(both[::-1], None, 0.001)])
        short = [(low, np.add(low, [0.02, 0.0]), 3), (np.add(right, [0.0, 0.02]), top, 3), *back]
        values["vague"].append(joints(short, None, 0.001 + 0.003 * step))
    assert_baseline("shape/planar/joints", values)


def test_a_bridge_takes_the_provisional_outline_unless_it_detours() -> None:
    """Two parallel sides whose provisional outline bulges ever more between them, both ways around."""
    values = []
    for step in range(10):
        bulge = 0.01 + 0.015 * step
        sides = [
            (np.array([-0.05, -0.02]), np.array([0.04, -0.02]), 6),
            (np.array([0.04, 0.02]), np.array([-0.05, 0.02]), 6),
            (np.array([-0.06, 0.015]), np.array([-0.06, -0.015]), 4),
        ]
        angles = np.linspace(-np.pi / 2, np.pi / 2, 25)
        round_m = np.column_stack([0.04 + bulge * np.cos(angles), 0.02 * np.sin(angles)])
        outline_m = np.vstack([[[-0.06, -0.02], [-0.01, -0.02]], round_m, [[-0.01, 0.02], [-0.06, 0.02]]])
        sigma_m = np.linspace(0.001, 0.003, len(outline_m))
        for start in (0, 14):
            turned = Contour(np.roll(outline_m, start, axis=0), np.roll(sigma_m, start), is_closed=True)
            values.append(joints(sides, turned, 0.001))
    assert_baseline("shape/planar/bridges", {"joints": values})


def test_two_faces_enclose_nothing() -> None:
    contacts = on_sides([(np.array([0.0, 0.0]), np.array([0.1, 0.0]), 4), (np.array([0.1, 0.05]), np.zeros(2), 4)])
    faces = divide(contacts, np.arange(8))
    assert faces.count == 2
    with pytest.raises(ShapeError, match="2 faces enclose nothing"):
        Polygon.of(contacts, faces)


def test_faces_the_wrong_way_around_enclose_nothing() -> None:
    square = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.05], [0.0, 0.05]])
    contacts = on_sides([(square[k], square[k - 1], 4) for k in range(4)])
    with pytest.raises(ShapeError, match="one region"):
        Polygon.of(contacts, divide(contacts, np.arange(16)))


@pytest.mark.parametrize(
    ("outline", "simple"),
    [
        ([[0, 0], [2, 0], [2, 2], [0, 2]], True),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], False),  # crossed
        ([[0, 0], [2, 0], [1, 0], [1, 2]], False),  # folded back on itself
        ([[0, 0], [4, 0], [4, 3], [2, 0], [0, 3]], False),  # a corner on another side
        ([[0, 0], [4, 0], [4, 3], [2, 0.01], [0, 3]], True),
        ([[0, 0], [4, 0], [4, 3], [2, -0.01], [0, 3]], False),
        ([[0, 0], [1, 0], [2, 0], [2, 2], [0, 2]], True),  # straight on is no fold
        ([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2]], True),
        ([[0, 0], [4, 0], [4, 4], [2, 2], [4, 2], [0, 4]], False),
        ([[0, 0], [1, 0], [0, 1]], True),
        ([[0, 0], [2, 0], [1, 1], [2, 2], [0, 2], [1, 1]], False),  # touches itself at a corner
        ([[0, 0], [5, 0], [5, 1], [3, 1], [6, 1], [6, 5], [0, 5]], False),  # a side along another
        ([[0, 0], [5, 0], [5, 1], [3, 1], [3, 2], [6, 2], [6, 5], [0, 5]], True),
    ],
)
def test_crossed_touching_and_folded_outlines_are_not_simple(outline: list[list[float]], simple: bool) -> None:
    """From every corner, both ways around, also turned and small."""
    polygon = np.array(outline, dtype=float)
    for start in range(len(polygon)):
        turned = np.roll(polygon, start, axis=0)
        assert is_simple(turned) == simple
        assert is_simple(turned[::-1]) == simple
        assert is_simple(turned[:, ::-1] * 0.125) == simple


def test_what_an_outline_encloses() -> None:
    """A fine grid over an L with corners on rows of the grid, as a whole and with no point at all."""
    axis = np.arange(-0.05, 0.071, 0.004)
    places_m = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    found = encloses(l_block(), places_m)
    assert encloses(l_block(), places_m[:0]).shape == (0,)
    assert_baseline("shape/planar/encloses", {"inside": np.flatnonzero(found)})
