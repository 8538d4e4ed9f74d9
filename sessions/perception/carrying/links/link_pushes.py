"""Links that push the object while the hand comes down, closes and opens: they have no sensors, but their motors work.

What a motor shows beyond its finger's free motion (:mod:`sessions.perception.carrying.links.free_motions`) is a
link's. A joint near one of its ends is left out: there the hand presses against its own stop. What friction hides
remains hidden, and is larger on real tendons; the scatter of the free motions sets the limit.

While the open hand comes down its fingers stand still, and every motor shows one number. A link that lands on the
object changes it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples, SAMPLE_ns
from sessions.perception.carrying.links.free_motions import Closing, FreeMotions, terms_of
from sessions.perception.carrying.net_wrench import tip_loads_N

_CLOSINGS = 6
"""So many of the newest tell how a free finger moves."""
_LIKE_EACH_OTHER = ("FF", "MF", "RF", "LF")
"""Fingers whose joints of one name have motors and tendons of one kind."""
_SMOOTHING = 3.0
"""Samples, of the joint angles; two thirds of it for counts and forces."""
_UNTOUCHED_N = 0.12
_NEAR_END_rad = 0.05
_NEAR_END_SAMPLES = 15
_PUSH_SAMPLES = 6
"""Of a push, in a row."""
_LANDED_COUNTS, _STILL_rad_s = 30.0, 0.15
"""Of a landing; open fingers that come down freely stay within 30 counts."""
_LOWEST_m = 0.002
"""The hand is as low as it comes, or where it let go, up to here above that place."""


class LinkPushes:
    """Learns how the motors move free fingers, and tells how long links have pushed.

    Args:
        motors: which motor pulls which joint.
        fingertips: that measure forces while they move, by finger.
        side: of the hand.
    """

    def __init__(self, motors: MotorMap, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> None:
        self._motors, self._fingertips, self._side = motors, fingertips, side
        fingers = [name[:2] for name in motors.names]
        self._finger = np.array([FINGERS.index(finger) if finger in FINGERS else 0 for finger in fingers])
        self._watched = np.array([finger in fingertips for finger in fingers])
        joints = [name[2:] if name[:2] in _LIKE_EACH_OTHER else name for name in motors.names]
        self._alike = np.array([[float(joint == other) for other in joints] for joint in joints])
        self._closings, self._openings = (deque[Closing](maxlen=_CLOSINGS) for _ in range(2))

    def closed_s(self, samples: CarrySamples) -> float:
        """How long links of untouched fingers pushed in this closing, the fingers' times added."""
        return self._pushed_s(samples, self._closings)

    def opened_s(self, samples: CarrySamples) -> float:
        """How long links of fingers that have let go pushed in this opening, the fingers' times added.

        The samples end where the hand rises: :func:`until_it_rises`.
        """
        return self._pushed_s(samples, self._openings)

    def _pushed_s(self, samples: CarrySamples, before: deque[Closing]) -> float:
        if samples.motor_counts is None or np.isnan(samples.motor_counts).any():
            return 0.0
        before.append(newest := self._closing(samples, samples.motor_counts))
        return self._time_s(FreeMotions.of(before, self._alike).pushes(newest))

    def landed_s(self, samples: CarrySamples) -> float:
        """How long links were on something while the open hand came down, the fingers' times added.

        The way up again does not count, on which the fingers may be arranged otherwise and weigh on other motors.
        """
        down = _way_down(samples)
        if down is None or down.motor_counts is None or np.isnan(down.motor_counts).any():
            return 0.0
        speeds = _speeds(down.joints_rad @ self._motors.from_joints.T, down)
        counts = _smooth(down.motor_counts, 2 / 3 * _SMOOTHING)
        off = np.abs(counts - np.median(counts, axis=0)) > _LANDED_COUNTS
        return self._time_s(off & (np.abs(speeds) < _STILL_rad_s) & self._watched)

    def _time_s(self, flags: NDArray[np.bool_]) -> float:
        """How long a motor of each finger is flagged, for at least :data:`_PUSH_SAMPLES` in a row, added up."""
        by_finger = np.stack([flags[:, self._finger == at].any(axis=1) for at in range(len(FINGERS))], axis=1)
        return float(_runs(by_finger).sum() * SAMPLE_ns / NANOSECONDS)

    def _closing(self, samples: CarrySamples, motor_counts: Array) -> Closing:
        angles_rad = samples.joints_rad @ self._motors.from_joints.T
        speeds = _speeds(angles_rad, samples)
        loads_N = _smooth(tip_loads_N(samples, self._fingertips, self._side), 2 / 3 * _SMOOTHING)
        lower_rad, upper_rad = self._motors.limits_rad.T + _NEAR_END_rad * np.array([[1.0], [-1.0]])
        at_end = maximum_filter1d((angles_rad < lower_rad) | (angles_rad > upper_rad), _NEAR_END_SAMPLES, axis=0)
        untouched = (loads_N < _UNTOUCHED_N)[:, self._finger]
        counts = _smooth(motor_counts * self._motors.sign, 2 / 3 * _SMOOTHING)
        return Closing(terms_of(speeds, _step_s(samples)), counts, untouched & ~at_end & self._watched)


def _way_down(samples: CarrySamples) -> CarrySamples | None:
    """Until the hand leaves the lowest place that it comes to; None for too little."""
    heights_m = samples.world_T_forearm[:, 2, 3]
    lowest = np.flatnonzero(heights_m < heights_m.min() + _LOWEST_m)
    return samples.until(int(samples.stamps_ns[lowest[-1]]))


def until_it_rises(samples: CarrySamples) -> CarrySamples | None:
    """Until the hand is above where it let go; None for too little."""
    heights_m = samples.world_T_forearm[:, 2, 3]
    above = np.flatnonzero(heights_m > heights_m[0] + _LOWEST_m)
    return samples.until(int(samples.stamps_ns[above[0]])) if len(above) else samples


def _runs(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Only what is true at least :data:`_PUSH_SAMPLES` times in a row, along the first axis."""
    kept = minimum_filter1d(flags, _PUSH_SAMPLES, axis=0, mode="constant")
    return np.asarray(maximum_filter1d(kept, _PUSH_SAMPLES, axis=0, origin=-1))


def _step_s(samples: CarrySamples) -> float:
    return float(np.diff(samples.stamps_ns).mean()) / NANOSECONDS


def _speeds(angles_rad: Array, samples: CarrySamples) -> Array:
    return np.asarray(np.gradient(_smooth(angles_rad, _SMOOTHING), _step_s(samples), axis=0))


def _smooth(values: Array, samples: float) -> Array:
    return np.asarray(gaussian_filter1d(values, samples, axis=0, mode="nearest"))
