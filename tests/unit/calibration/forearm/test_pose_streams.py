"""Two streams with an unknown delay: found from their motion, refined with the pose, or refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest

from calibration.forearm.pose_streams import PoseStream, PoseStreams
from calibration.forearm.recordings import load_data
from calibration.forearm.stream_problem import StreamProblem
from calibration.forearm.wizard import solve_forearm
from calibration.steps.quality import region_holds
from calibration.steps.refinement import BOARD, DELAY, MOUNT, SCALE
from drivers.core.errors import ConfigurationError
from tests.support.print_scale_table import MOUNT_T_CAMERA
from tests.support.stream_table import TARGET_Hz, simulated_streams


@pytest.mark.parametrize(("delay_s", "stamped"), [(0.043, True), pytest.param(-1.7, False, marks=pytest.mark.long)])
def test_region_and_delay_are_honest(delay_s: float, stamped: bool) -> None:
    solutions = [StreamProblem(simulated_streams(seed, delay_s, stamped=stamped)).solve() for seed in (1, 2, 3)]
    assert sum(region_holds(solution, MOUNT_T_CAMERA.inverse()) for solution in solutions) >= 2
    for solution in solutions:
        assert abs(solution.numbers["delay_s"] - delay_s) < 4 * solution.numbers["delay_sigma_s"] < 0.01


def test_a_print_of_another_size_is_told_from_a_delay() -> None:
    numbers = StreamProblem(simulated_streams(5, 0.2, larger=0.01)).solve().numbers
    assert numbers["print_larger_share"] == pytest.approx(0.01, abs=4 * numbers["print_larger_sigma"])
    assert numbers["delay_s"] == pytest.approx(0.2, abs=0.005)


def test_derivatives_are_those_of_the_residual() -> None:
    problem = StreamProblem(simulated_streams(4, 0.1))
    measurement = problem.measurement(17, np.eye(6))
    values = problem.solve().values
    residual, slopes = measurement.evaluate(values)
    for key, slope in zip((MOUNT, BOARD, SCALE, DELAY), slopes, strict=True):
        for column in range(slope.shape[1]):
            step = gtsam.VectorValues()
            step.insert(key, 1e-7 * np.eye(slope.shape[1])[column])
            moved, _ = measurement.evaluate(values.retract(step))
            np.testing.assert_allclose((moved - residual) / 1e-7, slope[:, column], atol=2e-4)


def test_streams_that_do_not_belong_together_are_refused() -> None:
    one, other = simulated_streams(1, 0.0), simulated_streams(2, 0.0)
    mixed = PoseStreams(one.mount_T_hand, other.camera_T_target, 2.0, where="mixed.json")
    with pytest.raises(ConfigurationError, match=r"mixed.json: .* do not turn alike at any delay up to 2 s"):
        StreamProblem(mixed)


def test_a_hand_that_stands_still_is_refused() -> None:
    streams = simulated_streams(1, 0.0)
    hand = PoseStream(streams.mount_T_hand.times_s, (streams.mount_T_hand.poses[0],) * len(streams.mount_T_hand.poses))
    with pytest.raises(ConfigurationError, match="do not turn alike"):
        StreamProblem(PoseStreams(hand, streams.camera_T_target))


def content(seed: int, delay_s: float) -> dict[str, Any]:
    """A file of the hand's stamped poses, every fourth, and the target's without stamps."""
    streams = simulated_streams(seed, delay_s, stamped=False)
    hand, target = streams.mount_T_hand, streams.camera_T_target
    return {
        "format": "tactile-pose-streams/1",
        "mount_T_hand": {
            "times_s": hand.times_s[::4].tolist(),
            "poses": [pose.matrix().tolist() for pose in hand.poses[::4]],
        },
        "camera_T_target": {"rate_hz": TARGET_Hz, "poses": [pose.matrix().tolist() for pose in target.poses]},
    }


def test_a_file_of_stamped_and_unstamped_streams_is_solved_and_judged(tmp_path: Path) -> None:
    file = tmp_path / "streams.json"
    file.write_text(json.dumps({**content(6, 0.0), "most_poses": 20}))
    data = load_data(file)
    assert data.streams is not None
    assert len(data.pairs) == 20
    result = solve_forearm(data)
    assert result.quality.passed, result.quality.judgements
    assert abs(result.solution.numbers["delay_s"]) < 0.01
    off = result.solution.world_T_mount.inverse().translation() - MOUNT_T_CAMERA.translation()
    assert np.linalg.norm(off) < 0.003


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times_s": [0.0] * 900, "rate_hz": None}, "do not increase"),
        ({"times_s": [0.0, 1.0], "rate_hz": None}, "2 times for 900 poses"),
        ({"times_s": [0.0, 1.0]}, "either times_s or rate_hz"),
        ({"rate_hz": -30.0}, "rate_hz"),
        ({"rate_hz": 3000.0}, r"camera_T_target: lasts 0\.3 s only"),
        (
            {"poses": [[[2.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]] * 900},
            "pose 1: a matrix is not a rigid",
        ),
    ],
)
def test_streams_that_cannot_be_are_refused_by_name(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    told = content(6, 0.0)
    told["camera_T_target"].update(change)
    file = tmp_path / "streams.json"
    file.write_text(json.dumps(told))
    with pytest.raises(ConfigurationError, match=words):
        load_data(file)
