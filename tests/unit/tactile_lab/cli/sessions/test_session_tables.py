"""Sessions, recoveries and evaluations as people read them on the command line."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from sessions.recording.listing import SessionSummary
from sessions.recording.recovery import Recovery, TopicRecovery
from sessions.recording.traffic.loss import Loss
from tactile_lab.cli import console
from tactile_lab.cli.sessions.evaluation_table import UNKNOWN, show_evaluation
from tactile_lab.cli.sessions.tables import losses_in_words, recovery_document, show_recovery, show_sessions

BARE = {"dimension": 3, "method": "joint", "seed": 4, "grasps": 1, "contacts": 9, "object": "cube-6"}


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], None]], str]:
    """What people read of an answer, on both outputs."""

    def tell(act: Callable[[], None]) -> str:
        people = Console(file=io.StringIO(), width=120, color_system=None, highlight=False)
        monkeypatch.setattr(console, "_answers", people)
        monkeypatch.setattr(console, "people", people)
        monkeypatch.setattr(console, "_json_only", False)
        act()
        assert isinstance(people.file, io.StringIO)
        return people.file.getvalue()

    return tell


def test_a_list_of_sessions_tells_losses_origins_and_problems(told: Callable[[Callable[[], None]], str]) -> None:
    made = [
        SessionSummary("one", Path("one"), "closed", grasps=12, traffic_bytes=2_340_000, data_loss=True),
        SessionSummary("two", Path("two"), "recovered", derived=("recovered", "piece")),
        SessionSummary("three", Path("three"), "damaged", problem="the manifest is missing"),
    ]
    text = told(lambda: show_sessions(Path("runs"), made))
    assert "closed !" in text
    assert "2.3" in text
    assert "recovered, piece" in text
    assert "! with data loss: see tactile-lab session show" in text
    assert "three: the manifest is missing" in text


def test_losses_are_counted_in_words() -> None:
    assert losses_in_words({"lost_cycles": 3, "truncated": 1}) == "3 lost cycles, the file ends too early"
    assert losses_in_words({}) == ""


@pytest.mark.parametrize("lost", [(), ("joints.yaml",)])
def test_a_recovery_says_what_was_lost_and_where_the_results_are(
    lost: tuple[str, ...], told: Callable[[Callable[[], None]], str]
) -> None:
    topics = {"/hand": TopicRecovery(40, 0, 3, 1.25)}
    recovery = Recovery(Path("old"), Path("new"), topics, Loss(), ("results",), lost)
    text = told(lambda: show_recovery(recovery))
    assert "1.250" in text
    assert "results of the damaged session stay there (results)" in text
    assert ("nothing was lost" in text) != bool(lost)
    assert recovery_document(recovery)["topics"] == {
        "/hand": {"read": 40, "lost": 0, "at_most_more": 3, "last_s": 1.25}
    }


def test_a_complete_session_needs_no_recovery(told: Callable[[Callable[[], None]], str]) -> None:
    assert "nothing to recover" in told(lambda: show_recovery(Recovery(Path("old"), None, {}, Loss())))


def test_an_evaluation_without_truth_shows_dashes_and_no_verdict(told: Callable[[Callable[[], None]], str]) -> None:
    text = told(lambda: show_evaluation(BARE))
    assert "Evaluation of cube-6 (3-D, method joint, seed 4; 1 grasp, 9 contacts)" in text
    assert "unknown without ground truth" in text
    assert "truth inside the stated" not in text
    (hausdorff,) = (line for line in text.splitlines() if line.startswith("Hausdorff distance"))
    assert hausdorff.count(UNKNOWN) == 2


def test_an_evaluation_shows_each_figure_with_its_unit(told: Callable[[Callable[[], None]], str]) -> None:
    content = BARE | {
        "shape": {"hausdorff_mm": 4.0},
        "shape_best_fit": {"hausdorff_mm": 3.125},
        "pose": {"rmse_mm": 1.5, "final_deg": 2.25},
        "consistency": {"levels": [0.5, 0.95], "poses": {"nees": 3.1, "inside": [0.4, 0.9]}},
        "registration_rms_mm": 0.5,
        "known_share": 0.5,
        "status": "partial",
    }
    text = told(lambda: show_evaluation(content))
    for words in ("4.00 mm", "3.12 mm", "1.50 mm", "2.25 °", "95 %", "NEES 3.10", "50% of the shape was touched"):
        assert words in text
