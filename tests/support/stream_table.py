"""Hand-eye calibration from two streams with an unknown delay: is the region honest, and the delay found?

python -m tests.support.stream_table [--runs 100]
"""

from __future__ import annotations

import argparse
from itertools import product

import numpy as np
from gtsam import Pose3, Rot3

from calibration.forearm.pose_streams import PoseStream, PoseStreams
from calibration.forearm.stream_problem import StreamProblem
from calibration.steps.quality import region_holds
from tests.support.print_scale_table import HAND_T_TARGET, MOUNT_T_CAMERA, NOISE

DURATION_s, HAND_Hz, TARGET_Hz = 30.0, 100.0, 30.0
MOST_DELAY_s = 2.0
LARGER = (0.0, 0.02)


def moving_hand(rng: np.random.Generator) -> PoseStream:
    """A hand that wanders about: sums of a few slow waves in every coordinate, up to about 1 rad/s and 0.2 m/s."""
    waves_Hz, phases = rng.uniform(0.05, 0.35, (6, 4)), rng.uniform(0, 2 * np.pi, (6, 4))
    sizes = np.repeat([0.3, 0.06], 3)[:, None] * rng.uniform(0.5, 1.0, (6, 4))
    times_s = np.arange(-5.0, DURATION_s + 5.0, 1 / HAND_Hz)
    waves = np.sin(2 * np.pi * waves_Hz[..., None] * times_s + phases[..., None])
    coordinates = np.sum(sizes[..., None] * waves, axis=1)
    return PoseStream(times_s, tuple(Pose3(Rot3.Expmap(each[:3]), each[3:]) for each in coordinates.T))


def simulated_streams(seed: int, delay_s: float, *, stamped: bool = True, larger: float = 0.0) -> PoseStreams:
    """What two programs record: with stamps that jitter by 2 ms, or without, where only a rate is known."""
    rng = np.random.default_rng(seed)
    hand = moving_hand(rng)
    true_s = np.arange(0.0, DURATION_s, 1 / TARGET_Hz)
    seen = []
    for time_s in true_s:
        noise = Pose3.Expmap(NOISE * rng.standard_normal(6))
        pose = MOUNT_T_CAMERA.inverse() * hand.at(time_s)[0] * HAND_T_TARGET * noise
        seen.append(Pose3(pose.rotation(), pose.translation() / (1.0 + larger)))
    jitter_s = 0.002 * rng.uniform(-1, 1, len(true_s)) if stamped else np.zeros(len(true_s))
    shaken = tuple(pose * Pose3.Expmap(0.1 * NOISE * rng.standard_normal(6)) for pose in hand.poses)
    return PoseStreams(PoseStream(hand.times_s, shaken), PoseStream(true_s + jitter_s - delay_s, tuple(seen)))


def outcome(seed: int, stamped: bool, larger: float) -> tuple[bool, float, float]:
    """Whether the 95 % region holds the truth; the camera's error, millimetres; the delay's, milliseconds."""
    delay_s = float(np.random.default_rng(seed).uniform(-MOST_DELAY_s, MOST_DELAY_s))
    solution = StreamProblem(simulated_streams(seed, delay_s, stamped=stamped, larger=larger)).solve()
    off = solution.world_T_mount.inverse().translation() - MOUNT_T_CAMERA.translation()
    late_ms = 1e3 * (solution.numbers["delay_s"] - delay_s)
    return region_holds(solution, MOUNT_T_CAMERA.inverse()), 1e3 * float(np.linalg.norm(off)), abs(late_ms)


def main() -> None:
    """Print a line for each kind of stream and size of the print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=1000, help="first seed")
    chosen = parser.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.runs)
    for stamped, larger in product((True, False), LARGER):
        rows = [outcome(seed, stamped, larger) for seed in seeds]
        held, error_mm, late_ms = (np.array(column) for column in zip(*rows, strict=True))
        kind = "stamped" if stamped else "unstamped"
        print(
            f"{kind}, print {100 * larger:.1f} % larger: held in {held.sum()} of {chosen.runs}; "
            f"{np.median(error_mm):.2f} mm, at most {error_mm.max():.2f} mm; "
            f"delay off {np.median(late_ms):.2f} ms, at most {late_ms.max():.2f} ms",
            flush=True,
        )


if __name__ == "__main__":
    main()
