"""The tracker of an extension or plug-in: what it raises, or gives that is no pose, is named with its file."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.core.errors import EstimationError, TactileLabError
from drivers.core.installed.entries import explain
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate

if TYPE_CHECKING:
    from drivers.core.contacts import Array, StepSigma
    from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
    from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
    from tactile_lab.slam.tracking.tracker import Tracker


class AddedTracker:
    """A :class:`~tactile_lab.slam.tracking.tracker.Tracker` around one that is not ours.

    Args:
        method: its name.
        file: that it comes from.
        make: makes it.

    Raises:
        EstimationError: by every method, where the tracker raises or answers what is not finite.
    """

    def __init__(self, method: str, file: str, make: Callable[[], Tracker]) -> None:
        self._method, self._file = method, file
        self._tracker: Tracker = self._ask(make)
        self._ask(lambda: self.map)

    @property
    def effective_count(self) -> float:
        return float(self._ask(lambda: self._tracker.effective_count))

    @property
    def map(self) -> ContactMap:
        return self._placed(lambda: self._tracker.map)

    @property
    def refined(self) -> ContactMap:
        return self._placed(lambda: self._tracker.refined)

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        """As the protocol says; the measured uncertainty is passed only to trackers that accept it."""
        self._ask(lambda: self._predict(motion, measured))

    def _predict(self, motion: Array, measured: StepSigma | None) -> None:
        if "measured" in signature(self._tracker.predict).parameters:
            self._tracker.predict(motion, measured)
        else:
            self._tracker.predict(motion)

    def weigh(self, contacts: ContactSet) -> bool:
        return bool(self._ask(lambda: self._tracker.weigh(contacts)))

    def estimate(self) -> PoseEstimate:
        found: PoseEstimate = self._ask(lambda: self._tracker.estimate())
        self._check(found.pose, found.covariance)
        return found

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        self._ask(lambda: self._tracker.update_shape(contacts, certain))

    def resample(self) -> None:
        self._ask(lambda: self._tracker.resample())

    def adopt(self, corrected: ContactMap) -> None:
        self._ask(lambda: self._tracker.adopt(corrected))

    def finish(self) -> None:
        self._ask(lambda: self._tracker.finish())

    def _placed(self, what: Callable[[], ContactMap]) -> ContactMap:
        found: ContactMap = self._ask(what)
        self._check(*(grasp.pose for grasp in found.placed))
        return found

    def _ask(self, question: Callable[[], Any]) -> Any:
        try:
            return question()
        except TactileLabError:
            raise
        except (Exception, SystemExit) as error:
            raise self._failure(f"raises {explain(error, self._file)}") from error

    def _check(self, *numbers: Any) -> None:
        if not all(np.isfinite(each).all() for each in numbers):
            raise self._failure("gives a pose that is not finite")

    def _failure(self, problem: str) -> EstimationError:
        hint = "What was recorded is kept: reconstruct it with another method"
        return EstimationError(f"the method {self._method!r} {problem}", where=self._file, hint=hint)
