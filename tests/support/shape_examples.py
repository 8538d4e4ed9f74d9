"""Known shapes and noisy contacts on them, shared by the tests of this folder."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

POINT_SIGMA_m, NORMAL_SIGMA_rad = 0.001, float(np.deg2rad(5))


def rectangle(length_m: float = 0.10, width_m: float = 0.06) -> Array:
    return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length_m / 2, width_m / 2]


def triangle() -> Array:
    return np.array([[-0.05, -0.0267], [0.05, -0.0267], [0.0, 0.0533]])


def ellipse(long_m: float = 0.05, short_m: float = 0.03) -> Array:
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    return np.column_stack([long_m * np.cos(angle), short_m * np.sin(angle)])


def half_disc(radius_m: float = 0.035) -> Array:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 240)
    return radius_m * np.column_stack([np.cos(angle), np.sin(angle)]) - [0.4 * radius_m, 0.0]


def l_block() -> Array:
    return np.array([[0, 0], [0.1, 0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.08], [0, 0.08]]) - [0.04, 0.032]


def contacts_on_polygon(polygon_m: Array, count: int, seed: int, noise: float = 1.0) -> tuple[Array, Array]:
    """Random contacts with 1 mm and 5 degrees of noise, times ``noise``."""
    rng = np.random.default_rng(seed)
    edges = np.roll(polygon_m, -1, axis=0) - polygon_m
    lengths = np.linalg.norm(edges, axis=1)
    edge = rng.choice(len(edges), count, p=lengths / lengths.sum())
    points = polygon_m[edge] + rng.random((count, 1)) * edges[edge]
    heading = np.arctan2(-edges[edge, 0], edges[edge, 1]) + noise * rng.normal(0, NORMAL_SIGMA_rad, count)
    normals = np.column_stack([np.cos(heading), np.sin(heading)])
    return points + noise * rng.normal(0, POINT_SIGMA_m, points.shape), normals


def noisy(points: Array, normals: Array, seed: int) -> tuple[Array, Array]:
    """Contacts with 1 mm and 5 degrees of noise in any dimension."""
    rng = np.random.default_rng(seed)
    turned = normals + rng.normal(0, NORMAL_SIGMA_rad, normals.shape)
    moved = points + rng.normal(0, POINT_SIGMA_m, points.shape)
    return moved, turned / np.linalg.norm(turned, axis=1, keepdims=True)


def contacts_on_sphere(radius_m: float, count: int, dimension: int, seed: int) -> tuple[Array, Array]:
    """Exact contacts on a circle or sphere around the origin."""
    directions = np.random.default_rng(seed).normal(size=(count, dimension))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return radius_m * directions, directions


def contacts_on_box(extents_m: Array, count: int, seed: int) -> tuple[Array, Array]:
    """Exact contacts on a box around the origin, spread by area."""
    rng = np.random.default_rng(seed)
    extents_m = np.asarray(extents_m)
    areas = np.prod(extents_m) / extents_m
    axis = rng.choice(3, count, p=areas / areas.sum())
    side = rng.choice([-1.0, 1.0], count)
    normals = np.eye(3)[axis] * side[:, None]
    points = rng.uniform(-0.5, 0.5, (count, 3)) * extents_m
    points[np.arange(count), axis] = side * extents_m[axis] / 2
    return points, normals
