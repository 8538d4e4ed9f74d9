"""Whether a link without a sensor has hit something: the motors of its finger or of the wrist show it, late.

While the hand moves evenly through free space each motor's strain gauge shows the same but for noise. What pushes on a
knuckle or on the palm changes that: first the wrist's motor, then the finger's. On the simulated rig it shows 2 to
4 N of a push from the side at 20 to 50 mm/s; on real tendons expect several times as much. So this is the last guard:
plans keep links away from what is known.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

_JERK_ns = 250_000_000
"""A motion starts with a jerk, as long on every rig: readings until then are not judged."""

_SIGMAS, _LEAST_COUNTS = 8.0, 250.0
_READINGS = 2
"""In a row: a lone one is no touch. A positioner that gets a target late jerks, and the wrist with it. A motor is read
more rarely than the hand answers: a value that comes again is the same reading."""


class LinkWatch:
    """Compares the motors' strain gauges with what they showed since the motion began."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """A new even motion begins."""
        self._learned, self._suspicious = 0, 0
        self._began_ns: int | None = None
        self._newest: tuple[int, Array] | None = None
        self._mean: Array | None = None
        self._squares: Array | None = None

    def is_touched(self, torques: Array | None, stamp_ns: int | None) -> bool:
        """Take the newest reading; whether something pushes on a link.

        Args:
            torques: counts of all motors, shape (20,), None if the hand reports none.
            stamp_ns: when it arrived. A reading that was judged before is not a second one that says so.
        """
        if torques is None or stamp_ns is None or (self._newest is not None and stamp_ns == self._newest[0]):
            return self._suspicious >= _READINGS
        before = torques if self._newest is None else self._newest[1]
        self._newest = stamp_ns, torques
        if self._began_ns is None:
            self._began_ns = stamp_ns
        if stamp_ns - self._began_ns < _JERK_ns:
            return False
        if self._mean is None or self._squares is None:
            self._mean, self._squares = torques.astype(float), np.zeros(len(torques))
            return False
        off = np.abs(torques - self._mean)
        far = off > np.maximum(_LEAST_COUNTS, _SIGMAS * self._sigma())
        if far.any():
            self._suspicious += bool((torques != before)[far].any())
            return self._suspicious >= _READINGS
        self._suspicious = 0
        self._learn(torques)
        return False

    def _sigma(self) -> Array:
        assert self._squares is not None
        return np.asarray(np.sqrt(self._squares / max(1, self._learned)))

    def _learn(self, torques: Array) -> None:
        assert self._mean is not None
        assert self._squares is not None
        self._learned += 1
        before = torques - self._mean
        self._mean = self._mean + before / (self._learned + 1)
        self._squares = self._squares + before * (torques - self._mean)
