"""Carries of the simulated rig in which something happens to the object or to a sensor: the carry says so, and its
stated noise holds the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, Array
from drivers.simulation.plant import Plant
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.perception.carrying.carry import Carry
from sessions.perception.interpreter import HAND_LINK
from tactile_lab.experiments.data.spoilt_samples import AS_MEASURED
from tactile_lab.experiments.runs import carried_objects
from tactile_lab.experiments.runs.carried_objects import CarryWatch, MASS_kg, WatchedCarry, watch_carries
from tests.support.low_rig import BRISK_WAY, low_rig

SEED = 5
SOON, LATER = 20, 30
"""Cycles after the beginning of the carry."""
LIGHT_kg, HIGH_m = 0.1, 0.010
"""An object that the hand can lift, and how high above the table it is dropped."""

Interfere = Callable[[Plant, int], None]


@pytest.fixture(autouse=True)
def brisk_way(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The hand comes down briskly; it grasps and carries as usual."""
    monkeypatch.setattr(carried_objects, "RIG", str(low_rig(tmp_path, cycle=BRISK_WAY)))


def carry_with(
    interfere: Interfere,
    shape: str = "box-10x6x4",
    seed: int = SEED,
    lifts: bool = False,
) -> tuple[SessionOutcome, CarryWatch]:
    """A session of two grasps; something happens in each cycle of the carry between them; or a light object
    is lifted to be weighed meanwhile.
    """
    during = "weigh" if lifts else "re-orient"

    class Interfering(CarryWatch):
        cycles: int | None = None

        def phase(self, number: int, name: str) -> None:
            super().phase(number, name)
            self.cycles = 0 if name == during else None
            if name == during == "weigh":
                self._palm_before, self._carried = self._runtime.perception.hand.world_T_palm, (0, {})
            self._world.plant._data.xfrc_applied[:] = 0.0

        def on_sample(self, link: str, sample: object) -> None:
            super().on_sample(link, sample)
            if link == HAND_LINK and self.cycles is not None:
                self.cycles += 1
                interfere(self._world.plant, self.cycles)

    return watch_carries(shape, seed, 2, LIGHT_kg if lifts else MASS_kg, int(lifts), make_watch=Interfering)


def only_carry(outcome: SessionOutcome, watch: CarryWatch) -> tuple[WatchedCarry, Carry]:
    assert outcome.ending is Ending.COMPLETE
    (found,) = watch.carries(outcome.grasps)
    return found, found.by[AS_MEASURED]


def sigmas_off(found: WatchedCarry, felt: Carry) -> Array:
    """By how much the stated motion is off when the hand has opened, in stated standard deviations, shape (3,)."""
    said, true = felt.motion * found.before, found.after
    off = np.array([said.x() - true.x(), said.y() - true.y(), true.between(said).theta()])
    return off / [felt.sigma.translation_m, felt.sigma.translation_m, felt.sigma.rotation_rad]


def lift_off(plant: Plant, fingers: set[str]) -> None:
    """These fingertips go through everything from now on."""
    for geometry, finger in plant._tips.items():
        if finger in fingers:
            plant._model.geom_contype[geometry] = plant._model.geom_conaffinity[geometry] = 0


def lose(plant: Plant, cycle: int) -> None:
    if cycle == LATER:
        lift_off(plant, set(FINGERS))


def leave_to_the_thumb(plant: Plant, cycle: int) -> None:
    if cycle == LATER:
        lift_off(plant, set(FINGERS) - {"TH"})


def fix_to_the_table(plant: Plant, cycle: int) -> None:
    if cycle == 1:
        first = plant._model.joint("object").dofadr[0]
        plant._model.dof_damping[first : first + 6] = 1e4


def jam(plant: Plant, cycle: int) -> None:
    """Something presses it onto the table."""
    plant._data.xfrc_applied[plant._object, 2] = -60.0 * min(max((cycle - 2 * LATER) / 10, 0.0), 1.0)


def leave_to_the_first_finger(plant: Plant, cycle: int) -> None:
    if cycle == 2 * LATER:
        lift_off(plant, set(FINGERS) - {"FF"})


def tip_over(plant: Plant, cycle: int) -> None:
    if cycle >= SOON:
        side = plant._data.xmat[plant._object].reshape(3, 3)[:, 1]
        plant._data.xfrc_applied[plant._object, 3:] = 0.6 * side


@pytest.mark.parametrize(
    ("interfere", "shape", "seed", "words"),
    [
        (lose, "box-10x6x4", SEED, "touched by no fingertip for"),
        (leave_to_the_thumb, "box-10x6x4", SEED, "held by one fingertip for"),
        pytest.param(leave_to_the_first_finger, "l-block", 9, "held by one fingertip for", marks=pytest.mark.long),
        (fix_to_the_table, "box-10x6x4", SEED, "is it jammed, or held by something?"),
        pytest.param(jam, "hexagonal-prism", 8, "is it jammed, or held by something?", marks=pytest.mark.long),
        (tip_over, "cube-6", SEED, "has it fallen over?"),
    ],
)
def test_what_happens_to_the_object_is_told_and_the_noise_holds_it(
    interfere: Interfere, shape: str, seed: int, words: str
) -> None:
    outcome, watch = carry_with(interfere, shape, seed)
    found, felt = only_carry(outcome, watch)
    assert any(words in told for told in watch.told)
    assert np.abs(sigmas_off(found, felt)).max() < 3.0


def test_an_object_that_is_dropped_from_a_height_is_told_and_the_noise_holds_it() -> None:
    heights_m: list[float] = []

    def drop(plant: Plant, cycle: int) -> None:
        heights_m.append(float(plant._data.xpos[plant._object, 2]))
        if heights_m[-1] > heights_m[0] + HIGH_m:
            lift_off(plant, set(FINGERS))

    outcome, watch = carry_with(drop, lifts=True)
    found, felt = only_carry(outcome, watch)
    assert max(heights_m) > heights_m[0] + HIGH_m
    assert any("it slipped out of the fingers" in told for told in watch.told)
    assert any("dropped from 10 mm" in told for told in watch.told)
    assert np.abs(sigmas_off(found, felt)).max() < 3.0


def overload(monkeypatch: pytest.MonkeyPatch, cycles: Callable[[int], bool]) -> tuple[SessionOutcome, CarryWatch]:
    """The first finger's sensor is loaded beyond its range in some cycles of the carry."""
    measured, extra = Plant.wrenches, np.zeros((len(FINGERS), 6))

    def load(plant: Plant, cycle: int) -> None:
        extra[0, 2] = 50.0 if cycles(cycle) else 0.0

    monkeypatch.setattr(Plant, "wrenches", property(lambda plant: measured.fget(plant) + extra))
    return carry_with(load)


def test_a_sensor_that_saturates_now_and_then_is_named_and_the_noise_holds_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    outcome, watch = overload(monkeypatch, lambda cycle: LATER <= cycle < 100 and cycle % 10 < 2)
    found, felt = only_carry(outcome, watch)
    assert felt.void == ("FF",)
    assert any("FF without valid readings" in told for told in watch.told)
    assert np.abs(sigmas_off(found, felt)).max() < 3.0


def test_a_sensor_that_stays_saturated_stops_the_session_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    outcome, _ = overload(monkeypatch, lambda cycle: cycle >= LATER)
    assert outcome.ending is Ending.STOPPED
    assert "FF: its readings are invalid: sensor saturated" in outcome.reason
