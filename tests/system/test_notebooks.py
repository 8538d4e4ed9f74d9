"""The notebooks of the documentation run from top to bottom, as a person would run them."""

from __future__ import annotations

import ast
import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from tactile_lab.slam.exploration.policies import POLICIES
from tests.support.repository import REPOSITORY

NOTEBOOKS = REPOSITORY / "docs" / "notebooks"


def run(name: str) -> tuple[dict[str, Any], str, list[Any]]:
    """Run every code cell. Returns the variables, what was printed, and the values that cells end with."""
    variables: dict[str, Any] = {"__name__": "__main__"}
    shown: list[Any] = []
    with redirect_stdout(StringIO()) as printed:
        for cell in json.loads((NOTEBOOKS / f"{name}.ipynb").read_text())["cells"]:
            if cell["cell_type"] == "code":
                _run_cell("".join(cell["source"]), variables, shown)
    return variables, printed.getvalue(), shown


def _run_cell(text: str, variables: dict[str, Any], shown: list[Any]) -> None:
    module = ast.parse(text)
    last = module.body.pop() if isinstance(module.body[-1], ast.Expr) else None
    exec(compile(module, "cell", "exec"), variables)
    if isinstance(last, ast.Expr):
        shown.append(eval(compile(ast.Expression(last.value), "cell", "eval"), variables))


def test_there_are_three_and_none_keeps_outputs() -> None:
    found = {path.stem: json.loads(path.read_text()) for path in NOTEBOOKS.glob("*.ipynb")}
    assert set(found) == {"contacts-to-a-shape", "three-methods", "a-new-policy"}
    assert not any(cell.get("outputs") for content in found.values() for cell in content["cells"])


def test_own_contacts_become_a_shape_in_fifteen_lines() -> None:
    _, printed, shown = run("contacts-to-a-shape")
    assert printed.startswith(("29.", "30."))
    assert shown[0]._repr_svg_().count("<polygon") == 1
    cells = json.loads((NOTEBOOKS / "contacts-to-a-shape.ipynb").read_text())["cells"]
    code = "".join(next(cell for cell in cells if cell["cell_type"] == "code")["source"])
    assert len([line for line in code.splitlines() if line]) <= 15


@pytest.mark.long  # quicker: own contacts become a shape
def test_a_recorded_session_through_three_methods(
    recorded_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs").symlink_to(recorded_root)
    variables, printed, shown = run("three-methods")
    assert set(variables["finished"]) == {"odometry", "icp", "joint"}
    assert printed.count("\n") == 3
    outlines = [file for file in variables["found"].values() if file.is_file()]
    assert shown[-1]._repr_svg_().count("<polygon") == len(outlines) > 0


def test_a_new_policy_on_simulated_sessions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SESSIONS", "1")
    monkeypatch.setenv("POLICY_NAMES", "quickest")
    try:
        variables, printed, _ = run("a-new-policy")
    finally:
        POLICIES.withdraw("cell")
    assert variables["results"]["quickest"][0]["contacts"] >= 4
    assert printed.startswith("quickest")
