"""Moments and principal axes of inertia of an estimated surface, on the assumption that it is evenly filled.

Nothing measures how mass is spread inside an object. The inertia is that of a body of uniform density with the measured
mass, about the measured centre of mass; its uncertainty knows mass, centre and surface, not the assumption.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from sessions.perception.weighing.value import Value

_SHARE = 0.1
"""Of its sigma by which the surface is moved: a guess between contacts may be farther out than the object is wide."""
_ROUND = 1e-9
"""Principal moments that differ by a smaller share are equal."""


@dataclass(frozen=True)
class PrincipalInertia:
    """Principal moments and axes of inertia about the centre of mass, in the order of the moments.

    Attributes:
        moments_kg_m2: ascending, shape (3,).
        moments_sigma_kg_m2: their standard deviations, shape (3,).
        axes: a unit vector a row, right-handed, shape (3, 3).
        axes_sigma_rad: how far each may be turned, shape (3,); 45 degrees or more where the moments of two axes
            cannot be told apart, as of round objects.
    """

    moments_kg_m2: Array
    moments_sigma_kg_m2: Array
    axes: Array
    axes_sigma_rad: Array

    def as_json(self) -> dict[str, Any]:
        """What files say of it."""
        return {
            "assumes": "uniform density",
            "moments_kg_m2": {"value": self.moments_kg_m2.tolist(), "sigma": self.moments_sigma_kg_m2.tolist()},
            "axes": {"value": self.axes.tolist(), "sigma_rad": self.axes_sigma_rad.tolist()},
        }

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> PrincipalInertia:
        """Raises KeyError, TypeError or ValueError if it is damaged."""
        moments, axes = record["moments_kg_m2"], record["axes"]
        return cls(
            np.array(moments["value"], dtype=float).reshape(3),
            np.array(moments["sigma"], dtype=float).reshape(3),
            np.array(axes["value"], dtype=float).reshape(3, 3),
            np.array(axes["sigma_rad"], dtype=float).reshape(3),
        )


@dataclass(frozen=True)
class EvenBody:
    """A closed surface that is evenly filled.

    Attributes:
        surface: faces outward, metres.
        sigma_m: standard deviation at each of its vertices along the normal, shape (n,).
        mass: kilograms.
        measured_centre_m: x and y of the centre of mass, shape (2,); None for that of the filled surface. Its height is
            always that.
        centre_sigma_m: its standard deviation along each axis.
    """

    surface: trimesh.Trimesh
    sigma_m: Array
    mass: Value
    measured_centre_m: Array | None = None
    centre_sigma_m: float = 0.0

    @property
    def centre_m(self) -> Array:
        """Centre of mass, shape (3,)."""
        return self._centre_m(self.surface)

    @property
    def inertia_kg_m2(self) -> Array:
        """About the centre of mass along the frame's axes, shape (3, 3)."""
        return self._inertia(self.surface, self.centre_m)

    def principal(self) -> PrincipalInertia:
        """Principal moments and axes.

        The surface is moved out and in along its normals as a whole for the moments. An axis is turned most by a
        surface that is farther out in two opposite quadrants between it and another axis, and farther in in the rest.
        """
        inertia = self.inertia_kg_m2
        moments, axes = _moments_and_axes(inertia)
        changes = [inertia * (self.mass.sigma / self.mass.value), *self._by_centre(), self._by_surface(self.sigma_m)]
        turned = np.array([axes @ change @ axes.T for change in changes])
        sigma = np.sqrt(np.sum(np.diagonal(turned, axis1=1, axis2=2) ** 2, axis=0))
        return PrincipalInertia(moments, sigma, axes, self._turns_rad(moments, axes, turned))

    def _turns_rad(self, moments: Array, axes: Array, changes: Array) -> Array:
        along = (np.asarray(self.surface.vertices) - self.centre_m) @ axes.T
        squares = np.zeros(3)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            quadrants = self._by_surface(self.sigma_m * np.sign(along[:, i] * along[:, j]))
            product = np.hypot(axes[i] @ quadrants @ axes[j], np.linalg.norm(changes[:, i, j]))
            turn = np.arctan2(2 * product + _ROUND * moments[2], moments[j] - moments[i]) / 2
            squares[[i, j]] += turn**2
        return np.sqrt(squares)

    def _by_centre(self) -> list[Array]:
        """Change of the inertia for one sigma of the centre along x and along y, away from the surface's own."""
        off = self.centre_m - np.asarray(self.surface.center_mass)
        steps = self.centre_sigma_m * np.eye(3)[:2] * np.where(off[:2] < 0, -1.0, 1.0)[:, None]
        return [self._inertia(self.surface, self.centre_m + step) - self.inertia_kg_m2 for step in steps]

    def _by_surface(self, outward_m: Array) -> Array:
        """Change of the inertia where the surface is moved out by this much at each vertex."""
        step = _SHARE * outward_m[:, None] * np.asarray(self.surface.vertex_normals)
        out, into = self._inertia_moved(step), self._inertia_moved(-step)
        return np.asarray((out - into) / (2 * _SHARE))

    def _inertia_moved(self, step_m: Array) -> Array:
        moved = trimesh.Trimesh(np.asarray(self.surface.vertices) + step_m, self.surface.faces, process=False)
        return self._inertia(moved, self._centre_m(moved))

    def _centre_m(self, surface: trimesh.Trimesh) -> Array:
        even_m = np.asarray(surface.center_mass, dtype=float)
        return even_m if self.measured_centre_m is None else np.append(self.measured_centre_m, even_m[2])

    def _inertia(self, surface: trimesh.Trimesh, about_m: Array) -> Array:
        own = np.asarray(surface.moment_inertia, dtype=float) / surface.volume
        off = about_m - np.asarray(surface.center_mass)
        return np.asarray(self.mass.value * (own + (off @ off) * np.eye(3) - np.outer(off, off)))


def _moments_and_axes(inertia: Array) -> tuple[Array, Array]:
    """Ascending moments, and axes as right-handed rows whose largest entry is positive, except for the last."""
    moments, columns = np.linalg.eigh(inertia)
    axes = columns.T
    largest = np.argmax(np.abs(axes), axis=1)
    axes = axes * np.sign(axes[np.arange(3), largest])[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    return moments, axes
