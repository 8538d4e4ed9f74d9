"""The benchmark of a session's memory measures every grasp, in stretches."""

from __future__ import annotations

from tactile_lab.benchmarks.session_memory import measure_memory


def test_every_stretch_has_its_memory_and_time() -> None:
    shares: list[float] = []
    stretches = measure_memory(5, every=2, waiting=shares.append)
    assert [one.last for one in stretches] == [2, 4, 5]
    assert all(one.memory_MB > 50 and one.step_ms > 0 for one in stretches)
    assert shares[-1] == 1.0
