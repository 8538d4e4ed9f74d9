"""Whether a link without a sensor has hit something: the motors of its finger or of the wrist show it.

While the hand moves evenly through free space each motor's strain gauge shows the same but for noise. What pushes on a
knuckle or on the palm changes that: first the wrist's motor, then the finger's. A lone reading says little, as every
jerk of the positioner is one too: on the simulated rig 2 to 4 N of a push from the side at 20 to 50 mm/s show. Several
in a row tell less, where joints stand still: 0.7 to 1.5 N of a link that comes down on something. On real tendons
expect several times as much. So this is the last guard: plans keep links away from what is known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_JERK_ns = 250_000_000
"""A motion starts with a jerk, as long on every rig: readings until then are not judged."""

_APART_ns = 8_000_000
"""What is heard sooner than so long after the last reading is averaged into the next one: a hand that answers 500 or
1000 times a second shows its controllers' noise in single readings, and what follows counts readings of one that
answers 100 times."""

_SIGMAS, _LEAST_COUNTS = 8.0, 250.0
_READINGS = 2
"""In a row: a lone one is no touch. A positioner that gets a target late jerks, and the wrist with it. A motor is read
more rarely than the hand answers: a value that comes again is the same reading."""

_STILL = (3.0, 18.0, 3)
_STILL_WRIST = (4.0, 60.0, 5)
"""The same for the motor of a joint that stands still, of the fingers and of the wrist."""

_BOTH = (60.0, 2)
"""The same for the wrist's two motors together: jerks show in one of them, 51 counts at most in both."""

_MOVING = (60.0, 2)
"""The same for the motor of a finger that moves a little, as when it is laid on something: what its tip feels is 0.7 N
there, and shows as 45 counts at most; 1 N on a link shows as 90."""

_BOTH_MOVING = 3
"""Readings in a row for the wrist while fingertips are laid on: up to two show what they feel."""

_COMPARED, _LEAST_COMPARED = 200, 5
"""Newest readings that tell what is usual, and the fewest."""

_MAD_TO_SIGMA = 1.48


class LinkWatch:
    """Compares the motors' strain gauges with what they showed since the motion began.

    What is usual are the median and the median deviation of the newest readings: a push that grows slowly, or a jerk,
    hardly changes them. At the beginning of a motion the motors' noise in the one before counts, too.

    Args:
        is_wrist: which motors move the wrist, shape (20,).
    """

    def __init__(self, is_wrist: NDArray[np.bool_]) -> None:
        self._is_wrist = is_wrist
        self._sigmas, self._counts, self._in_a_row = np.where(is_wrist, *np.array([_STILL_WRIST, _STILL])[..., None])
        self._readings, self._compared = np.empty((len(is_wrist), _COMPARED)), 0
        """The newest ones of each motor, in no order, and how many there have been."""
        self._usual_before: tuple[Array, Array] | None = None
        """Median and standard deviation in the last motion that was long enough to tell them."""
        self.restart()

    def restart(self) -> None:
        """A new even motion begins."""
        if self._compared >= _COMPARED:
            self._usual_before = self._usual()
        self._began_ns: int | None = None
        self._newest: tuple[int, Array] | None = None
        self._heard_ns: int | None = None
        self._since: list[Array] = []
        """What was heard since the newest reading."""
        self._compared = 0
        self._kept: tuple[Array, Array] | None = None
        self._far, self._leaning, self._both, self._off = 0, 0, 0, np.zeros(len(self._counts), dtype=int)
        """Readings in a row in which any motor is far off, a finger's is a little, or both of the wrist are; and for
        each motor, in which it is off at all."""

    def keep_usual(self) -> None:
        """The motion has ended: what leans hard is compared with it from now on, as what leans on does not go by.

        Where it was too short to tell, with the one before it.
        """
        self._kept = self._usual() if self._compared >= _LEAST_COMPARED else self._usual_before

    @property
    def is_touched(self) -> bool:
        """Whether something pushes so hard on a link that any motor shows it."""
        return self._far >= _READINGS

    @property
    def is_leaning(self) -> bool:
        """Whether something pushes on a link of a finger that is moved a little."""
        return self._leaning >= _MOVING[1]

    @property
    def is_leaning_hard(self) -> bool:
        """Whether something pushes harder on the hand than fingertips that are laid on: the wrist's motors alone may
        show it.
        """
        return self.is_touched or self._both >= _BOTH_MOVING

    @property
    def pushed(self) -> NDArray[np.bool_]:
        """Motors that show a push if they stand still, shape (20,)."""
        return np.asarray((self._off >= self._in_a_row) | (self._is_wrist & (self._both >= _BOTH[1])))

    def take(self, torques: Array | None, stamp_ns: int | None) -> None:
        """Judge the newest reading.

        Args:
            torques: counts of all motors, shape (20,), None if the hand reports none.
            stamp_ns: when it arrived. A reading that was judged before is not a second one that says so.
        """
        if torques is None or stamp_ns is None or stamp_ns == self._heard_ns:
            return
        self._heard_ns = stamp_ns
        self._since.append(torques)
        if self._newest is not None and stamp_ns - self._newest[0] < _APART_ns:
            return
        torques = np.mean(self._since, axis=0)
        self._since.clear()
        before = torques if self._newest is None else self._newest[1]
        self._newest = stamp_ns, torques
        if self._began_ns is None:
            self._began_ns = stamp_ns
        if stamp_ns - self._began_ns < _JERK_ns:
            return
        if self._compared >= _LEAST_COMPARED:
            self._judge(torques, torques != before)
        self._readings[:, self._compared % _COMPARED] = torques
        self._compared += 1

    def _judge(self, torques: Array, is_new: NDArray[np.bool_]) -> None:
        usual, sigma = self._usual()
        kept, kept_sigma = self._kept or (usual, sigma)
        off_kept = np.abs(torques - kept)
        far = off_kept > np.maximum(_LEAST_COUNTS, _SIGMAS * kept_sigma)
        self._far = self._far + bool(is_new[far].any()) if far.any() else 0
        both = self._is_wrist & (off_kept > _BOTH[0])
        self._both = self._both + bool(is_new[both].any()) if np.count_nonzero(both) > 1 else 0
        off = np.abs(torques - usual)
        leans = (off > np.maximum(_MOVING[0], _SIGMAS * sigma)) & ~self._is_wrist
        self._leaning = self._leaning + bool(is_new[leans].any()) if leans.any() else 0
        is_off = off > np.maximum(self._counts, self._sigmas * sigma)
        self._off = np.where(is_off, self._off + is_new, 0)

    def _usual(self) -> tuple[Array, Array]:
        """Median of each motor's readings, and their standard deviation by the median one; shape (20,) each."""
        known = self._readings[:, : self._compared]
        usual = _medians(known)
        sigma = _MAD_TO_SIGMA * _medians(np.abs(known - usual[:, None]))
        if self._compared < _COMPARED and self._usual_before is not None:  # ten readings may happen to be alike
            sigma = np.maximum(sigma, self._usual_before[1])
        return usual, sigma


def _medians(rows: Array) -> Array:
    """The median of each row of finite numbers; a third of numpy's time, which looks for others."""
    rising, middle = np.sort(rows, axis=1), rows.shape[1] // 2
    if rows.shape[1] % 2:
        return np.asarray(rising[:, middle])
    return np.asarray((rising[:, middle - 1] + rising[:, middle]) / 2)
