"""The benchmark of the program's start: what it compares, and how it knows that a session has begun."""

from __future__ import annotations

from tactile_lab.benchmarks import start_times
from tests.support.flipped_bytes import make_recording


def test_every_start_is_compared_with_a_python_that_does_nothing(monkeypatch):
    begun: list[str] = []

    def run(words: list[str]) -> start_times.Start:
        begun.append(" ".join(words[-2:]))
        return start_times.Start(0.02 if words[-1] == "pass" else 0.3, 0.5)

    monkeypatch.setattr(start_times, "_run", run)
    monkeypatch.setattr(start_times, "first_cycle", lambda: start_times.Start(2.0, 2.5))
    table = start_times.start_table(repeats=2)
    assert [row[2] for row in table.rows()] == ["1", "15", "15", "100"]
    assert [timing.repeats for timing in table.timings] == [2] * 4
    assert table.timings[3].note.endswith("; 2500 ms in all on this machine")
    assert begun == 3 * ["-c pass", "tactile_lab.cli.main --help", "run --help"]


def test_a_recording_has_messages_once_its_first_chunk_is_written(tmp_path):
    made = make_recording(tmp_path)
    path = tmp_path / "traffic.mcap"
    path.write_bytes(made.content[: made.spans[0][0]])
    assert not start_times.has_messages(path)
    path.write_bytes(made.content)
    assert start_times.has_messages(path)
