"""Tables that commands of the tests store row by row: of faults, fuzzing, replays and coverage."""

from __future__ import annotations

from pathlib import Path

import pytest

from tactile_lab.experiments.results.stored_result import StoredResult
from tests.support import package_coverage
from tests.support.stored_table import GrowingTable, Outline

OUTLINE = Outline("test", "It is shown.", ("run",), "", ("rig", "object", "result"), keys=2)
ORDER = [("sim", "cube"), ("sim", "box"), ("wire", "box")]


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    (tmp_path / "results" / "data").mkdir(parents=True)
    return tmp_path


def rows(docs: Path) -> list[tuple[str, ...]]:
    (part,) = StoredResult.read(docs / "results" / "data" / "test.json").parts
    return list(part.tables[0].rows)


def test_a_table_that_was_broken_off_goes_on_with_what_is_missing(docs: Path) -> None:
    table = GrowingTable(docs, OUTLINE, ORDER)
    table.put(("wire", "box"), ["identical"])
    table.put(("sim", "cube"), ["differ:\n  contacts"])
    assert rows(docs) == [("sim", "cube", "differ: contacts"), ("wire", "box", "identical")]
    again = GrowingTable(docs, OUTLINE, ORDER)
    assert again.missing == (("sim", "box"),)
    again.put(("sim", "box"), ["identical"])
    assert [row[:2] for row in rows(docs)] == ORDER
    assert GrowingTable(docs, OUTLINE, ORDER).missing == ()


def test_without_documents_rows_are_shown_only(capsys: pytest.CaptureFixture[str]) -> None:
    table = GrowingTable(None, OUTLINE, ORDER)
    table.put(("sim", "cube"), ["identical"])
    table.publish()
    assert "sim | cube | identical" in capsys.readouterr().out


def test_coverage_is_told_by_package_and_tactile_lab_by_its_parts() -> None:
    def file(lines: int, run: int, branches: int = 0, taken: int = 0) -> dict[str, dict[str, int]]:
        names = ("num_statements", "covered_lines", "num_branches", "covered_branches")
        return {"summary": dict(zip(names, (lines, run, branches, taken), strict=True))}

    found = package_coverage.rows(
        {
            "files": {
                "drivers/core/clock.py": file(10, 9, 4, 1),
                "drivers/ati/rdt.py": file(30, 21),
                "tactile_lab/slam/tactile_slam.py": file(5, 5),
                "tactile_lab/slam/shape/mesh.py": file(5, 0),
                "tactile_lab/__init__.py": file(0, 0),
            }
        }
    )
    assert found == {
        "drivers": ("2", "40", "75.0", "4", "25.0"),
        "tactile_lab.slam": ("2", "10", "50.0", "0", "–"),
        "tactile_lab": ("1", "0", "–", "0", "–"),
    }
