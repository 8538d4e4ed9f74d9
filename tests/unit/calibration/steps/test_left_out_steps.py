"""Steps done without asking: those that do not come off are counted and left out, a limit ends them all."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from calibration.steps.guided_steps import GuidedSteps
from drivers.core.errors import DeviceError, SafetyError


@dataclass(frozen=True)
class Place:
    """Something to measure."""

    instruction: str


class Walk(GuidedSteps[Place, str]):
    """Four places."""

    def __init__(self) -> None:
        self.plan = [Place(name) for name in "abcd"]
        self._taken = []


class Measurer:
    """Measures a place, or raises what it was told to raise there."""

    def __init__(self, **failing: Exception) -> None:
        self._failing, self.asked = failing, ""

    def measure(self, planned: Place) -> str:
        self.asked += planned.instruction
        if planned.instruction in self._failing:
            raise self._failing[planned.instruction]
        return planned.instruction.upper()


def test_steps_that_do_not_come_off_are_counted_and_the_others_are_kept() -> None:
    walk, measurer = Walk(), Measurer(b=DeviceError("met nothing", where="touch"), d=DeviceError("lost", where="touch"))
    assert walk.measure_all(measurer) == 2
    assert measurer.asked == "abcd"
    assert [(place.instruction, found) for place, found in walk.observations()] == [("a", "A"), ("c", "C")]
    assert Walk().measure_all(Measurer()) == 0


def test_a_limit_that_was_passed_ends_the_steps() -> None:
    walk, measurer = Walk(), Measurer(b=SafetyError("too strong", where="hand"))
    with pytest.raises(SafetyError):
        walk.measure_all(measurer)
    assert measurer.asked == "ab"
    assert len(walk.observations()) == 1


def test_a_step_done_again_replaces_its_observation_and_is_the_one_taken_back() -> None:
    walk, measurer = Walk(), Measurer()
    first, second = walk.steps()[:2]
    assert (second.number, second.count) == (2, 4)
    walk.measure(second, measurer)
    walk.measure(first, measurer)
    assert [place.instruction for place, _ in walk.observations()] == ["a", "b"]
    walk.measure(second, measurer)
    assert len(walk.observations()) == 2
    assert walk.undo() == 2
    assert [place.instruction for place, _ in walk.observations()] == ["a"]
