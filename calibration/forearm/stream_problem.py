"""Hand-eye calibration from two streams of poses whose clocks differ by an unknown delay.

As :mod:`calibration.forearm.pair_problem`, with the delay as one more unknown: the hand's pose at each of the target's
times moves along the hand's own stream as the delay changes. So the region of the result includes what the delay leaves
open.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np

from calibration.forearm.pair_problem import PairNoise, PairProblem, evaluate_pair
from calibration.forearm.pose_streams import PoseStreams
from calibration.steps.observations import PosePair
from calibration.steps.refinement import BOARD, DELAY, MOUNT, SCALE, Measurement, marginal
from drivers.core.contacts import Array


class StreamProblem(PairProblem):
    """Both streams of one calibration; the world is the camera's frame.

    Args:
        streams: see there.
        known: what is known of the print beforehand.

    Raises:
        ConfigurationError: the streams do not fit each other at any delay.
    """

    unknowns = PairProblem.unknowns + 1

    def __init__(self, streams: PoseStreams, known: PairNoise | None = None) -> None:
        self._streams = streams
        super().__init__(streams.pairs_at(streams.first_delay_s), known)

    def first_values(self) -> gtsam.Values:
        """The delay that the motion suggests."""
        values = gtsam.Values()
        values.insert(DELAY, np.array([self._streams.first_delay_s]))
        return values

    def pairs_at(self, values: gtsam.Values) -> tuple[PosePair, ...]:
        """The pairs at a delay."""
        return self._streams.pairs_at(float(values.atVector(DELAY)[0]))

    def measurement(self, index: int, noise: Array) -> Measurement:
        """One of the target's poses as an observation, with the covariance of its residual, shape (6, 6)."""
        target, time_s = self.pairs[index].camera_T_target, float(self._streams.used_s[index])

        def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
            hand, velocity = self._streams.mount_T_hand.at(time_s + float(values.atVector(DELAY)[0]))
            residual, (by_mount, by_board, by_scale) = evaluate_pair(PosePair(hand, target), values)
            by_delay = by_board @ values.atPose3(BOARD).inverse().AdjointMap() @ velocity
            return residual, [by_mount, by_board, by_scale, by_delay[:, None]]

        return Measurement((MOUNT, BOARD, SCALE, DELAY), noise, evaluate)

    def further_numbers(self, measured: Sequence[Measurement], values: gtsam.Values) -> dict[str, float]:
        """The delay: the hand's clock minus the target's, seconds, and its standard deviation."""
        sigma_s = float(np.sqrt(marginal(measured, values, DELAY)[0, 0]))
        return {"delay_s": float(values.atVector(DELAY)[0]), "delay_sigma_s": sigma_s}
