"""Guided measuring, step by step: shared by all wizards that move a rig. Nothing here prints or asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from drivers.core.errors import DeviceError


class Instructed(Protocol):
    """A planned observation with a textual instruction."""

    @property
    def instruction(self) -> str: ...


PlannedT = TypeVar("PlannedT", bound=Instructed)
ObservedT = TypeVar("ObservedT")
_AskedT = TypeVar("_AskedT", contravariant=True)
_AnsweredT = TypeVar("_AnsweredT", covariant=True)


class EmulatorHost(Protocol[_AskedT, _AnsweredT]):
    """Makes observations: a rig, or a person with one."""

    def measure(self, planned: _AskedT) -> _AnsweredT:
        """Make one planned observation. Raises TactileLabError if it failed."""


@dataclass(frozen=True)
class Step(Generic[PlannedT]):
    """One step to show.

    Attributes:
        number, count: of the planned ones, from 1.
        instruction: what is to be done, in words.
        planned: the observation.
    """

    number: int
    count: int
    instruction: str
    planned: PlannedT


class GuidedSteps(Generic[PlannedT, ObservedT]):
    """The planned steps and what has been observed in them.

    Attributes:
        plan: what to measure.
    """

    plan: Sequence[PlannedT]
    _taken: list[tuple[int, ObservedT]]

    def steps(self) -> tuple[Step[PlannedT], ...]:
        """All planned steps."""
        count = len(self.plan)
        return tuple(Step(n + 1, count, planned.instruction, planned) for n, planned in enumerate(self.plan))

    def measure(self, step: Step[PlannedT], measurer: EmulatorHost[PlannedT, ObservedT]) -> ObservedT:
        """Do one step; repeating a step replaces its observation. Raises TactileLabError."""
        observation = measurer.measure(step.planned)
        self._taken = [(number, old) for number, old in self._taken if number != step.number]
        self._taken.append((step.number, observation))
        return observation

    def measure_all(self, measurer: EmulatorHost[PlannedT, ObservedT]) -> int:
        """Do every step without asking, as ``--no-input`` does; returns how many failed and were skipped.

        Raises:
            SafetyError: a limit was exceeded.
        """
        left_out = 0
        for step in self.steps():
            try:
                self.measure(step, measurer)
            except DeviceError:
                left_out += 1
        return left_out

    def undo(self) -> int | None:
        """Undo the last observation. Returns its step's number, None if there is none."""
        return self._taken.pop()[0] if self._taken else None

    def observations(self) -> list[tuple[PlannedT, ObservedT]]:
        """What was planned with what was observed, in the order of the steps."""
        return [(self.plan[number - 1], found) for number, found in sorted(self._taken, key=lambda item: item[0])]
