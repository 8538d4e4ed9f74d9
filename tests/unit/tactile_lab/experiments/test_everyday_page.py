"""The catalogue of everyday objects: one entry and one picture an object, and what the picture shows."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tactile_lab.experiments import everyday_page
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.data.silhouettes import places, silhouettes

SVG = "{http://www.w3.org/2000/svg}"


def picture() -> dict[str, Any]:
    box = trimesh.creation.box((0.10, 0.06, 0.04))
    contacts = places(np.array([[0.05, 0.0, 0.01], [-0.05, 0.0, 0.01]]))
    return {"true": silhouettes(box), "model": silhouettes(box), "closed": contacts, "probed": places(np.zeros((1, 3)))}


def row(name: str, pose: str = "standing", seed: int = 1000, **figures: Any) -> Row:
    known = {"ending": "partial", "reason": "nothing left that the hand can reach", "hausdorff_mm": 4.25, **figures}
    return Row(Cell((("object", name), ("pose", pose), ("dimension", 3), ("grasps", 16)), seed), known)


def test_silhouettes_of_a_box_are_its_faces() -> None:
    found = silhouettes(trimesh.creation.box((0.10, 0.06, 0.04)))
    for view, size_mm in (("front", (100, 40)), ("above", (100, 60))):
        (line,) = found[view]
        np.testing.assert_allclose(np.ptp(np.array(line), axis=0), size_mm, atol=2.0)


def test_a_ring_has_a_hole_from_above() -> None:
    ring = trimesh.creation.annulus(r_min=0.02, r_max=0.04, height=0.02)
    assert len(silhouettes(ring)["above"]) == 2
    assert len(silhouettes(ring)["front"]) == 1


def test_each_object_and_pose_has_one_entry_with_its_figures_and_reason() -> None:
    rows = [
        row("ycb:sugar_box", picture=picture()),
        row("ycb:sugar_box", seed=1001),
        row("cup", "lying", touched_share=0.5),
    ]
    text = everyday_page.everyday_page(rows, "abc")
    assert text.count("\n## ") == 2
    assert "![Sugar box, standing](pictures/everyday/sugar-box-standing.svg)" in text
    assert "Ended partial: nothing left that the hand can reach." in text
    line = next(line for line in text.splitlines() if line.startswith("| cup "))
    assert [cell.strip() for cell in line.split("|")][7:9] == ["50", "4.2"]
    assert "There is no model." in text
    assert "2 of the experiment's 26 objects and poses have been run" in text
    assert "--seeds 1000 --only dimension=3 --grasps 16" in text
    assert "abc" in text


def test_a_picture_has_both_views_and_every_contact() -> None:
    drawn = ET.fromstring(everyday_page.draw_object(picture()))
    views = drawn.findall(f"{SVG}g")
    assert [len(view.findall(f"{SVG}circle")) for view in views] == [2, 2]
    assert [len(view.findall(f"{SVG}rect")) for view in views] == [1, 1]
    assert [text.text for text in drawn.findall(f"{SVG}text")] == [
        "from the front, 100 x 40 mm",
        "from above, 100 x 60 mm",
    ]


def test_page_and_pictures_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pictures").mkdir()
    monkeypatch.setattr(everyday_page, "DOCS", tmp_path)
    runs = tmp_path / "runs.jsonl"
    runs.write_text("\n".join(map(json.dumps, [{"version": "abc"}, row("cup", picture=picture()).as_json()])))
    everyday_page.main(str(runs))
    assert (tmp_path / "everyday-objects.md").read_text().startswith("# Everyday objects")
    assert (tmp_path / "pictures/everyday/cup-standing.svg").is_file()
