"""The steps of the forearm-to-world wizard: plan, measure, check the motion, solve, assess.

Nothing here prints or asks: the command line shows these steps in a terminal, a page may show the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

from pydantic import Field

from calibration.forearm.board_problem import BoardNoise, BoardProblem
from calibration.forearm.pair_problem import PairNoise, PairProblem
from calibration.forearm.recordings import ForearmData
from calibration.forearm.stream_problem import StreamProblem
from calibration.forearm.touch_plan import PlannedTouch
from calibration.forearm.touch_problem import TouchNoise, TouchProblem
from calibration.forearm.view_plan import PlannedView
from calibration.steps.guided_steps import GuidedSteps
from calibration.steps.motion_check import MotionNeeds, MotionReport, check_pairs, check_touches, check_views
from calibration.steps.observations import Touch, View
from calibration.steps.quality import VIEW_LIMITS, Problem, Quality, QualityLimits, judge, judging_steps
from calibration.steps.refinement import Solution
from calibration.store.store import VALID_DAYS
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError

Method = Literal["touch", "marker", "pairs", "manual"]
Planned: TypeAlias = PlannedTouch | PlannedView
Observation: TypeAlias = Touch | View


class WizardSettings(StrictModel):
    """Settings of the wizard.

    Attributes:
        needs: the least motion.
        limits: of a result.
        touch, board, pairs: errors of the observations.
        valid_days: how long a result may be used.
    """

    needs: MotionNeeds = MotionNeeds()
    limits: QualityLimits = QualityLimits()
    touch: TouchNoise = TouchNoise()
    board: BoardNoise = BoardNoise()
    pairs: PairNoise = PairNoise()
    valid_days: float = Field(default=VALID_DAYS, gt=0.0)

    def limits_for(self, method: Method) -> QualityLimits:
        """The limits; for pictures and pairs with their own residuals unless these are given."""
        if method == "touch":
            return self.limits
        return QualityLimits.model_validate({**VIEW_LIMITS, **self.limits.model_dump(exclude_unset=True)})


@dataclass(frozen=True, eq=False)
class ForearmResult:
    """A solved calibration.

    Attributes:
        method: how it was found.
        solution: the result.
        quality: its checks against the limits.
        limits: those limits.
        motion: the motion it was solved from.
    """

    method: Method
    solution: Solution
    quality: Quality
    limits: QualityLimits
    motion: MotionReport


@dataclass
class ForearmWizard(GuidedSteps[Planned, Observation]):
    """One run through the wizard.

    Attributes:
        method: touch or marker.
        plan: what to measure.
        data: what has been measured so far, and what solving needs.
        settings: see there.
    """

    method: Literal["touch", "marker"]
    plan: Sequence[Planned]
    data: ForearmData
    settings: WizardSettings = field(default_factory=WizardSettings)
    _taken: list[tuple[int, Observation]] = field(default_factory=list)

    @property
    def measured(self) -> ForearmData:
        """The data with everything measured so far."""
        found = [observation for _, observation in self.observations()]
        touches = tuple(item for item in found if isinstance(item, Touch))
        views = tuple(item for item in found if isinstance(item, View))
        return replace(self.data, touches=touches, views=views)

    def motion(self) -> MotionReport:
        """Whether the motion is sufficient, and what is missing."""
        return motion_of(self.measured, self.method, self.settings.needs)

    def solve(self, each: Callable[[], object] = lambda: None) -> ForearmResult:
        """Check the motion, solve, and assess. Raises ConfigurationError if the motion is insufficient."""
        return solve_forearm(self.measured, self.settings, each)


# --- from data to a result -----------------------------------------------------------------------------------------


def method_of(data: ForearmData) -> Method:
    """The method that recorded data belong to."""
    return "touch" if data.touches else "marker" if data.views else "pairs"


def motion_of(data: ForearmData, method: Method, needs: MotionNeeds) -> MotionReport:
    """The motion in some data."""
    if method == "touch":
        return check_touches(data.touches, needs)
    return check_views(data.views, data.link, needs) if method == "marker" else check_pairs(data.pairs, needs)


def solving_steps(data: ForearmData) -> int:
    """How often :func:`solve_forearm` calls ``each``."""
    return judging_steps(len(data.touches) + len(data.views) + len(data.pairs))


def solve_forearm(
    data: ForearmData, settings: WizardSettings | None = None, each: Callable[[], object] = lambda: None
) -> ForearmResult:
    """Check the motion, solve, and judge.

    Raises:
        ConfigurationError: the motion is not enough, or the data cannot be solved.
    """
    settings, method = settings or WizardSettings(), method_of(data)
    motion = motion_of(data, method, settings.needs)
    motion.refuse(f"{method} method")
    problem = problem_of(data, settings)
    solution = problem.solve()
    limits = settings.limits_for(method)
    return ForearmResult(method, solution, judge(problem, solution, limits, each), limits, motion)


def problem_of(data: ForearmData, settings: WizardSettings) -> Problem:
    """The problem for some data. Raises ConfigurationError if something is missing."""
    if data.touches:
        return TouchProblem(data.touches, settings.touch, data.guess)
    if data.streams is not None:
        return StreamProblem(data.streams, settings.pairs)
    if data.pairs:
        return PairProblem(data.pairs, settings.pairs)
    if data.camera is None or data.markers is None:
        raise ConfigurationError("pictures need the camera's lens and the markers", where="marker method")
    return BoardProblem(data.views, data.camera, data.markers, data.link, settings.board)
