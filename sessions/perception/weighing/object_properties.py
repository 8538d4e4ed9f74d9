"""What is known of the object's mass, centre and friction, each with its standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from drivers.core.contacts import Array
from drivers.core.fingertip import GRAVITY
from sessions.perception.carrying.friction_balance import MeasuredFriction
from sessions.perception.weighing.table_pull import weight_on_edges
from sessions.perception.weighing.value import Value
from sessions.perception.weighing.weighing import Dragging, Hanging

_LEAST_SLIDING = 40
"""Sliding contacts that are needed to tell their friction: 0.8 s of one fingertip."""
_SLIDING_SHARE = 0.9
"""Quantile of the force ratios at contacts that slide: some only seem to, and lie below the cone."""


@dataclass(frozen=True)
class Centre:
    """The centre of mass on the table, world x and y, when a grasp was captured.

    Attributes:
        grasp_index: that grasp.
        place_m, sigma_m: shape (2,) each.
    """

    grasp_index: int
    place_m: Array
    sigma_m: Array


@dataclass
class ObjectProperties:
    """Collects liftings, draggings and sliding contacts of a session.

    Attributes:
        hangings: with the grasp in which they were; their centre is where it was in that grasp's capture.
        draggings: likewise.
        sliding: ratio of tangential to normal force at contacts that slid, by the grasp after which they did.
    """

    hangings: list[tuple[int, Hanging]] = field(default_factory=list)
    draggings: list[tuple[int, Dragging]] = field(default_factory=list)
    sliding: list[tuple[int, Array]] = field(default_factory=list)

    def undo(self, grasp_index: int) -> None:
        """Forget what was measured after a grasp that does not count."""
        self.hangings = [each for each in self.hangings if each[0] < grasp_index]
        self.draggings = [each for each in self.draggings if each[0] < grasp_index]
        self.sliding = [each for each in self.sliding if each[0] < grasp_index]

    def hung_in(self, grasp_index: int) -> Hanging | None:
        """The last lifting, if it was in this grasp and the object hung free."""
        index, found = self.hangings[-1] if self.hangings else (-1, None)
        return found if index == grasp_index and found is not None and found.is_free else None

    @property
    def is_known(self) -> bool:
        """Whether the object was weighed or dragged, with whatever result."""
        return bool(self.hangings or self.draggings)

    def in_words(self) -> str:
        """What is known, for people."""
        values = [
            ("mass" if self.hung_free else "mass, of what stood on an edge,", self.mass_kg, 1e3, "g", 0),
            ("table's friction", self.table_friction_N, 1.0, "N", 2),
            ("coefficient of the table", self.table_friction, 1.0, "", 2),
        ]
        told = [
            f"{name} {scale * each.value:.{digits}f} ± {2 * scale * each.sigma:.{digits}f} {unit}".rstrip()
            for name, each, scale, unit, digits in values
            if each is not None
        ]
        if self.tip_friction_at_least is not None:
            told.append(f"of the fingertips at least {self.tip_friction_at_least:.2f}")
        return ", ".join(told) or "nothing is known of its weight and friction"

    @property
    def hung_free(self) -> bool:
        """Whether nothing but the fingertips held it once: its mass is known as well as this hand can tell."""
        return bool(self._free)

    @property
    def mass_kg(self) -> Value | None:
        """Mass, of an object that never hung free by how the table held it back on its edge; None if that is unsure."""
        weight = _mean([Value(each.weight_N, each.weight_sigma_N) for _, each in self._free]) or self._on_edges_N
        return None if weight is None else Value(weight.value / GRAVITY, weight.sigma / GRAVITY)

    @property
    def centres(self) -> tuple[Centre, ...]:
        """Centres of mass, one for each time that the object hung free."""
        return tuple(Centre(index, each.centre_m, each.centre_sigma_m) for index, each in self._free)

    @property
    def table_friction_N(self) -> Value | None:
        """Force of friction of the table on the object; None if it was never dragged to and fro."""
        return _mean([Value(each.friction_N, each.friction_sigma_N) for _, each in self.draggings])

    @property
    def table_friction(self) -> Value | None:
        """Coefficient of friction of the table; None if the object's weight is not known."""
        mass = self.mass_kg
        if mass is None or not self.draggings:
            return None
        found = []
        for _, each in self.draggings:
            pressed_N = max(GRAVITY * mass.value + each.pressed_N, 1e-3)
            ratio = each.friction_N / pressed_N
            found.append(Value(ratio, float(np.hypot(each.friction_sigma_N, ratio * GRAVITY * mass.sigma)) / pressed_N))
        return _mean(found)

    @property
    def tip_friction_at_least(self) -> float | None:
        """What the fingertips' coefficient of friction is at least; None if they hardly slid.

        A light object, or one that the hand carries along, does not reach the edge of the cone.
        """
        ratios = np.concatenate([np.zeros(0), *(each for _, each in self.sliding)])
        return float(np.quantile(ratios, _SLIDING_SHARE)) if len(ratios) >= _LEAST_SLIDING else None

    @property
    def friction(self) -> MeasuredFriction:
        """What odometry, and whoever squeezes the object, need to know; nothing before it was dragged."""
        table, mass = self.table_friction_N, self.mass_kg
        if table is None:
            return MeasuredFriction()
        return MeasuredFriction(
            table_N=table.value,
            table_sigma_N=table.sigma,
            tips_at_least=self.tip_friction_at_least or 0.0,
            weight_N=float("nan") if mass is None else GRAVITY * mass.value,
        )

    @property
    def _on_edges_N(self) -> Value | None:
        dragged = [each.pull for _, each in self.draggings if each.pull is not None]
        tipped = [each.pull for _, each in self.hangings if each.is_tipped and each.pull is not None]
        return weight_on_edges(dragged, tipped)

    @property
    def _free(self) -> list[tuple[int, Hanging]]:
        return [each for each in self.hangings if each[1].is_free]


def _mean(values: Sequence[Value]) -> Value | None:
    """Mean, weighted by certainty; as uncertain as the best of them, since a hand's errors are the same every time."""
    if not values:
        return None
    weights = np.array([max(each.sigma, 1e-9) ** -2 for each in values])
    mean = float(weights @ [each.value for each in values] / weights.sum())
    spread = max(abs(each.value - mean) for each in values) / 2
    return Value(mean, float(np.hypot(min(each.sigma for each in values), spread)))
