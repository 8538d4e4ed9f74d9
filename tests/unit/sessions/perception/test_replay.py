from __future__ import annotations

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.contacts import Grasp
from drivers.core.errors import SessionError
from sessions.perception.event_outcomes import TareReport, TruthFrame
from sessions.perception.replay import Replay
from sessions.recording.recorder import Recorder
from sessions.recording.running_session import create_session
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.writer import TrafficWriter
from tests.support.session_fakes import make_interpreter, make_rig, play_session, same_grasp


def record(path, **options):
    writer = TrafficWriter(path)
    rig = make_rig(Recorder(writer), **options)
    grasps = play_session(rig)
    rig.runtime.close()
    writer.close()
    return rig, grasps


def replay(path):
    interpreter = make_interpreter()
    run = Replay(TrafficReader(path), interpreter)
    return interpreter, list(run.outcomes()), run.loss


@pytest.mark.parametrize(("seed", "damage"), [(0, 0.0), (1, 0.1), (2, 0.1)])
def test_replayed_grasps_are_bit_equal_to_the_live_ones(tmp_path, seed, damage):
    rig, live = record(tmp_path / "t.mcap", seed=seed, damage=damage, start_ns=5_000_000_000)
    interpreter, outcomes, loss = replay(tmp_path / "t.mcap")
    replayed = [outcome for outcome in outcomes if isinstance(outcome, Grasp)]
    assert len(live) == len(replayed) == 3
    assert all(same_grasp(one, other) for one, other in zip(live, replayed, strict=True))
    assert all(len(grasp.contacts) == 5 for grasp in live)
    assert interpreter.undecodable == rig.interpreter.undecodable
    assert bool(interpreter.undecodable) == bool(damage)
    assert interpreter.clock.now_ns() == rig.interpreter.clock.now_ns()
    assert interpreter.perception.hand.joints_rad.tobytes() == rig.runtime.perception.hand.joints_rad.tobytes()
    assert interpreter.perception.loads_N() == rig.runtime.perception.loads_N()
    assert not loss


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_a_paced_replay_gives_the_same_grasps_at_the_original_pace_or_so_many_times_faster(tmp_path, speed):
    _, live = record(tmp_path / "t.mcap")
    run = Replay(TrafficReader(tmp_path / "t.mcap"), make_interpreter(), speed, VirtualClock())
    grasps = [outcome for outcome in run.outcomes() if isinstance(outcome, Grasp)]
    assert run.factor == pytest.approx(speed, rel=1e-6)
    assert all(same_grasp(one, other) for one, other in zip(live, grasps, strict=True))


def test_a_replay_gives_frames_and_reports_in_the_order_of_the_session(tmp_path):
    record(tmp_path / "t.mcap")
    _, outcomes, _ = replay(tmp_path / "t.mcap")
    assert [type(outcome) for outcome in outcomes] == [TareReport, *[Grasp, TruthFrame] * 3]
    assert [outcome.grasp_index for outcome in outcomes if isinstance(outcome, TruthFrame)] == [0, 1, 2]


def test_a_session_that_was_cut_off_replays_up_to_the_cut(tmp_path):
    _, live = record(tmp_path / "t.mcap")
    content = (tmp_path / "t.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(content[: int(0.6 * len(content))])
    _, outcomes, loss = replay(tmp_path / "torn.mcap")
    replayed = [outcome for outcome in outcomes if isinstance(outcome, Grasp)]
    assert 0 < len(replayed) < 3
    assert all(same_grasp(one, other) for one, other in zip(live, replayed, strict=False))
    assert loss.truncated


def test_neither_truth_nor_samples_nor_transmitted_bytes_touch_a_replay(tmp_path):
    _, live = record(tmp_path / "t.mcap")
    writer = TrafficWriter(tmp_path / "bare.mcap")
    for message in TrafficReader(tmp_path / "t.mcap").messages():
        if message.topic.endswith("/rx") or message.topic == "/marks":
            writer.write(message.topic, message.data, message.stamp_ns)
    writer.close()
    _, outcomes, _ = replay(tmp_path / "bare.mcap")
    replayed = [outcome for outcome in outcomes if isinstance(outcome, Grasp)]
    assert all(same_grasp(one, other) for one, other in zip(live, replayed, strict=True))


def test_other_bytes_give_other_grasps(tmp_path):
    _, first = record(tmp_path / "a.mcap", seed=1)
    _, second = record(tmp_path / "b.mcap", seed=2)
    assert not same_grasp(first[0], second[0])


def test_a_session_folder_replays(tmp_path):
    with create_session(tmp_path, rig="fake", rig_description={}, object_name="box") as session:
        rig = make_rig(session.recorder)
        live = play_session(rig)
        rig.runtime.close()
    replayed = [outcome for outcome in Replay(session, make_interpreter()).outcomes() if isinstance(outcome, Grasp)]
    assert all(same_grasp(one, other) for one, other in zip(live, replayed, strict=True))
    assert session.manifest.counts["/marks"] > 10


def test_links_that_the_rig_does_not_know_are_left_alone():
    interpreter = make_interpreter()
    interpreter.on_received("ft/XX", b"anything", 5)
    assert not interpreter.perception.hand.ready
    assert not interpreter.undecodable


def test_marks_of_another_version_stop_the_replay_with_the_file_named(tmp_path):
    writer = TrafficWriter(tmp_path / "t.mcap")
    writer.write("/link/hand/rx", np.zeros(24).tobytes(), 0)
    writer.write("/marks", b'{"kind":"pirouette","stamp_ns":1}', 1)
    writer.close()
    with pytest.raises(SessionError, match=r"t\.mcap: not a session event"):
        replay(tmp_path / "t.mcap")
