"""The report: one page that fetches nothing, shows everything and survives missing parts."""

from __future__ import annotations

import base64
import json
import re
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import trimesh
from gtsam import Pose3

from drivers.core.errors import SessionError
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.table_pull import TablePull
from sessions.perception.weighing.weighing import Dragging, Hanging
from sessions.recording.running_session import create_session
from sessions.recording.session import Session
from sessions.recording.traffic.reader import may_hold
from tactile_lab import report
from tactile_lab.colours import UNKNOWN, hex_colour, viridis
from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.evaluation import evaluate
from tactile_lab.evaluation.files.properties_file import write_properties
from tactile_lab.evaluation.files.result_files import write_results
from tactile_lab.evaluation.files.trajectory_file import Trajectory, trajectory_text
from tactile_lab.evaluation.truth.session_truth import TRUTH_TRAJECTORY
from tactile_lab.report.course import Course, Stop, read_course
from tactile_lab.report.listings import decisions_card, stops_card
from tactile_lab.report.rendering import VIEWS, render
from tactile_lab.report.svg import Chart, Frame, Scale, tick_label
from tests.support.synthetic_grasps import GRASPS, SIZE_m, box_grasps, result_of

VOID = {"meta", "img", "input", "circle", "path", "line", "rect"}
NASTY = "Table <b>3</b> & \"north\" </script><script>alert('x')</script>"


class Page(HTMLParser):
    """Checks nesting, collects elements and addresses."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID or tag in {"circle", "rect"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> without a beginning"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def make_session(root: Path, dimension: Literal[2, 3], *, with_truth: bool = True) -> Path:
    recorded = box_grasps()
    mesh = trimesh.creation.box(SIZE_m)
    session = create_session(
        root,
        rig="sim",
        rig_description={},
        object_name="box <10x6x4>",
        seeds={"session": 7},
        settings={"grasps": GRASPS},
        notes=NASTY,
        truth_mesh_ply=mesh.export(file_type="ply") if with_truth else None,
        started=datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC),
    )
    session.close(counts={"grasps": GRASPS})
    settings = {"method": "joint", "back_end": {"limits": [1, 2]}}
    write_results(session.results, result_of(dimension), recorded.grasps, settings)
    if with_truth:
        stamps = (0.0,) * GRASPS
        text = trajectory_text(Trajectory(stamps, recorded.truth))
        (session.results / TRUTH_TRAJECTORY).write_text(text)
        evaluation = evaluate(session.results, Truth(recorded.truth, mesh), session.manifest.object_name)
        (session.results / "evaluation.json").write_text(evaluation.as_text())
    return session.folder


@pytest.fixture(scope="module", params=[2, 3])
def text(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = make_session(tmp_path_factory.mktemp("session"), request.param)
    path = report.write(folder)
    assert path == folder / "results" / "report.html"
    return path.read_text(encoding="utf-8")


def test_page_is_well_formed(text: str) -> None:
    assert text.startswith("<!doctype html>")
    page = Page(text)
    assert page.open == []
    assert page.of("html")[0]["lang"] == "en"


def test_page_fetches_nothing(text: str) -> None:
    assert not re.search(r"https?://|@import|url\(", text)
    page = Page(text)
    addresses = [
        value for _, attributes in page.elements for key, value in attributes.items() if key in {"src", "href"}
    ]
    assert addresses
    assert all(address is not None and address.startswith("data:image/png;base64,") for address in addresses)
    policy = [meta["content"] for meta in page.of("meta") if meta.get("http-equiv")]
    assert policy[0] is not None
    assert "default-src 'none'" in policy[0]


def test_what_the_estimate_says_of_itself_is_drawn(text: str) -> None:
    words = Page(text).texts
    assert "Are the uncertainties true?" in words
    assert words.count("two stated standard deviations") == 2
    assert {"Length", "Width"} <= set(words)
    assert text.count('class="bound"') == 4  # both bands over the grasps, and their legends
    assert "Poses inside" in words


def test_texts_of_people_are_escaped(text: str) -> None:
    assert "alert('x')</script>" not in text
    page = Page(text)
    assert NASTY in page.texts
    assert "box <10x6x4>" in page.texts
    assert not page.of("b10x6x4")


def test_every_picture_has_words(text: str) -> None:
    page = Page(text)
    pictures = [svg for svg in page.of("svg") if svg.get("aria-hidden") != "true"]
    assert len(pictures) >= 6
    assert all(svg["aria-label"] and svg["role"] == "img" for svg in pictures)
    assert len(page.of("img")) == len(VIEWS)
    assert all(image["alt"] for image in page.of("img"))
    assert page.of("canvas")[0]["aria-label"]


def test_sections_figures_and_facts_are_there(text: str) -> None:
    words = Page(text).texts
    for heading in ("Shape", "Tracking", "Grasps", "Evaluation", "How it was made"):
        assert heading in words
    for fact in ("Hausdorff distance", "Registration error", "2026-03-04 05:06:07 UTC", "tracked", "version: gtsam"):
        assert fact in words


def test_what_a_weighed_object_holds_is_told(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 3)
    assert "Mass inside the object" not in Page(report.write(folder).read_text(encoding="utf-8")).texts
    weighed = Hanging(3.0, 0.05, np.array([0.002, 0.001]), np.array([0.001, 0.001]), 0.0)
    shape = result_of(3).mesh
    write_properties(folder / "results", ObjectProperties(hangings=[(0, weighed)]), [Pose3()], shape)
    words = Page(report.write(folder).read_text(encoding="utf-8")).texts
    assert "as weighed; two standard deviations" in words
    assert "Centre of mass, as weighed: x 2.0, y 1.0 ± 2.0 mm (two σ)." in words
    assert {"Mass inside the object", "moment of inertia, kg cm²", "direction x, y, z"} <= set(words)


def test_what_stood_on_an_edge_while_it_was_weighed_is_said_to(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 3)
    tipped = Hanging(2.5, 0.05, np.zeros(2), np.full(2, 0.001), held_back_N=0.2, pull=TablePull(0.2, 2.5))
    dragged = Dragging(1.0, 0.1, 0.0, TablePull(1.0, 0.0))
    write_properties(folder / "results", ObjectProperties([(0, tipped)], [(0, dragged)]), [Pose3()])
    words = Page(report.write(folder).read_text(encoding="utf-8")).texts
    assert "as it stood on an edge; two standard deviations" in words
    assert not any(each.startswith("Centre of mass") for each in words)


def test_nested_settings_have_dotted_names(text: str) -> None:
    words = Page(text).texts
    assert words[words.index("back_end.limits") + 1] == "[1, 2]"


def test_viewer_data_are_consistent_arrays(text: str) -> None:
    match = re.search(r'<script type="application/json" id="viewer-data">(.*?)</script>', text)
    assert match is not None
    data = json.loads(match.group(1))
    vertices = np.frombuffer(base64.b64decode(data["vertices"]), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(data["faces"]), "<u4").reshape(-1, 3)
    assert faces.max() < len(vertices)
    assert len(base64.b64decode(data["colours"])) == 3 * len(vertices)
    assert data["contact_counts"] == [5 * (index + 1) for index in range(GRASPS)]
    assert len(base64.b64decode(data["contact_normals"])) == 2 * len(base64.b64decode(data["contacts"]))
    assert len(base64.b64decode(data["truth"])) % 24 == 0


def test_same_session_gives_the_same_page(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 2)
    first = report.write(folder).read_bytes()
    assert report.write(folder).read_bytes() == first


def test_doubts_and_alternatives_are_on_the_page(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 2)
    path = folder / "results" / "slam.json"
    slam = json.loads(path.read_text(encoding="utf-8"))
    words = "the slip before grasp 3 is improbable (1e-07)"
    slam["doubts"] = [{"name": "unlikely-slip", "words": words, "grasps": [2], "grave": True}]
    placing = {"probability": 0.12, "turn_rad": 1.0, "shift_m": 0.021, "rms_m": 0.0042, "world_T_object": []}
    slam["alternatives"] = [{**placing, "grasps": [2, 3]}, {**placing, "grasps": [0, 3]}]
    path.write_text(json.dumps(slam), encoding="utf-8")
    texts = Page(report.write(folder).read_text(encoding="utf-8")).texts
    assert words in texts
    assert [text for text in texts if text in {"3 to 4", "1, 4", "12%", "57°", "21 mm", "4.2 mm"}] == [
        *("3 to 4", "12%", "57°", "21 mm", "4.2 mm"),
        *("1, 4", "12%", "57°", "21 mm", "4.2 mm"),
    ]


def test_session_without_truth_says_so(tmp_path: Path) -> None:
    words = Page(report.write(make_session(tmp_path, 2, with_truth=False)).read_text(encoding="utf-8")).texts
    assert "not evaluated" in words
    assert any("No marker camera saw the object" in word for word in words)


def test_session_that_ended_without_a_shape_still_has_a_page(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 2)
    for name in ("mesh.ply", "contour.csv"):
        (folder / "results" / name).unlink()
    page = Page(report.write(folder).read_text(encoding="utf-8"))
    assert not page.of("canvas")
    assert page.open == []


def decided(number: int, **changes: object) -> dict[str, object]:
    place = {"x_m": 0.012, "y_m": -0.03, "yaw_rad": 0.5, "closing": "pinch", "score": 1234.5}
    other = {**place, "closing": "radial", "score": None}
    content = {"number": number, "policy": "information", "outcome": "grasp", "chosen": 1, "promised_gain": 0.5}
    told = {"reason": f"the best <for> grasp {number}", "vetoed": [0], "ruled_out": {"no room": 3}}
    return {**content, **told, "candidates": [other, place], **changes}


def record(root: Path, *, stop: bool = False, decisions: tuple[dict[str, object], ...] = ()) -> Session:
    session = create_session(root, rig="sim", rig_description={}, object_name="box")
    for number, content in enumerate(decisions):
        session.recorder.decision(number, content)
    if stop:
        session.recorder.safety_stop(2_500_000_000, "force of 9 N at FF", [])
    session.close()
    return session


def test_course_of_a_session_comes_from_its_recording(tmp_path: Path) -> None:
    ended = decided(3, outcome="stop", chosen=None, promised_gain=None)
    again = decided(2, reason="second thoughts")  # grasp 2 was taken back and decided about anew
    course = read_course(record(tmp_path, stop=True, decisions=(decided(2), decided(3), again, ended)))
    assert [decision.number for decision in course.decisions] == [2, 3]
    assert course.decisions[0].reason == "second thoughts"
    assert course.stops == (Stop(2.5, "force of 9 N at FF"),)
    words = Page(decisions_card(course) + stops_card(course)).texts
    row = words[words.index("2") : words.index("3")]
    assert row == ["2", "pinch", "12", "-30", "29", "1.23e+03", "0.5", "2 of 5", "1", "second thoughts"]
    assert {"ended the session", "at 2.5 s", "  force of 9 N at FF"} <= set(words)


def test_session_without_decisions_and_stops_shows_none(tmp_path: Path) -> None:
    course = read_course(record(tmp_path))
    assert course == Course()
    assert decisions_card(course) == stops_card(course) == ""


def test_decisions_and_stops_are_on_the_page(tmp_path: Path) -> None:
    folder = make_session(tmp_path / "with", 2)
    course = record(tmp_path / "course", stop=True, decisions=(decided(4),))
    (course.folder / "traffic.mcap").replace(folder / "traffic.mcap")
    page = Page(report.write(folder).read_text(encoding="utf-8"))
    assert "Choice of the grasps" in page.texts
    assert "the best <for> grasp 4" in page.texts
    assert "at 2.5 s" in page.texts
    (folder / "traffic.mcap").unlink()
    assert "Choice of the grasps" not in Page(report.write(folder).read_text(encoding="utf-8")).texts


def test_torn_recording_still_tells_its_decisions(tmp_path: Path) -> None:
    session = record(tmp_path, decisions=(decided(2),))
    path = session.folder / "traffic.mcap"
    path.write_bytes(path.read_bytes()[:-40])
    assert may_hold(path, ("/decision",))
    assert len(read_course(session).decisions) == 1


def test_decision_of_another_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="/decision does not have the form of its topic"):
        read_course(record(tmp_path, decisions=(decided(2, chosen=7),)))


def test_report_without_results_is_a_session_error_with_a_hint(tmp_path: Path) -> None:
    session = create_session(tmp_path, rig="sim", rig_description={}, object_name="box")
    session.close()
    with pytest.raises(SessionError, match="Replay the session"):
        report.write(session.folder)


def test_report_of_a_replay_goes_beside_its_results(tmp_path: Path) -> None:
    folder = make_session(tmp_path, 2)
    (folder / "results").rename(tmp_path / "replayed")
    assert report.write(folder, tmp_path / "replayed") == tmp_path / "replayed" / "report.html"


@pytest.mark.parametrize("span", [(0.0, 1.0), (-75.0, 60.0), (0.0, 0.0037), (0.5, 16.5)])
def test_ticks_are_few_round_and_inside(span: tuple[float, float]) -> None:
    ticks = Scale(*span, 0.0, 100.0).ticks()
    assert 3 <= len(ticks) <= 9
    assert all(span[0] - 1e-9 <= tick <= span[1] + 1e-9 for tick in ticks)
    assert all(len(tick_label(tick)) <= 7 for tick in ticks)
    assert tick_label(-2.5) == "\u22122.5"


def test_map_has_equal_scales_on_both_axes() -> None:
    chart = Chart.map(500.0, np.array([[0.0, 0.0], [10.0, 90.0]]))
    assert chart.x(1.0) - chart.x(0.0) == pytest.approx(chart.y(0.0) - chart.y(1.0))


def test_chart_escapes_its_words() -> None:
    chart = Chart(Frame(100, 100), (0, 1), (0, 1))
    chart.dot((0.5, 0.5), "mark", tip="<FF> & co")
    assert "&lt;FF&gt; &amp; co" in chart.text("a < b", 'say "c"')
    assert "a &lt; b" in chart.text("a < b", "")


def test_colours_follow_the_scale_and_unknown_is_grey() -> None:
    colours = viridis(np.array([-1.0, 0.0, 0.5, 1.0, 2.0, np.nan]))
    assert [hex_colour(colour) for colour in colours[:2]] == ["#440154", "#440154"]
    assert hex_colour(colours[4]) == hex_colour(colours[3]) == "#fde725"
    assert colours[5].tolist() == UNKNOWN.tolist()


def test_still_picture_shows_the_near_side_on_a_clear_background() -> None:
    box = trimesh.creation.box(SIZE_m)
    above = (box.vertices[:, 2] > 0)[:, None]
    colours = np.where(above, [255, 0, 0], [0, 0, 255]).astype(np.uint8)
    known = np.zeros(len(box.vertices), dtype=bool)
    picture = render(np.asarray(box.vertices), np.asarray(box.faces), colours, known, VIEWS[2], 60)
    assert picture.shape == (60, 60, 4)
    assert picture[30, 30, 3] == 255
    assert picture[30, 30, 0] > 200
    assert picture[30, 30, 2] == 0
    assert picture[0, 0, 3] == 0
    assert picture[20:40, 20:40, 0].min() > 200


def test_a_guess_is_striped_in_the_still_picture() -> None:
    box = trimesh.creation.box(SIZE_m)
    grey = np.full((len(box.vertices), 3), UNKNOWN, dtype=np.uint8)
    guess = np.ones(len(box.vertices), dtype=bool)
    picture = render(np.asarray(box.vertices), np.asarray(box.faces), grey, guess, VIEWS[2], 60)
    middle = picture[20:40, 20:40, 0].astype(int)
    assert middle.max() - middle.min() > 0.25 * UNKNOWN[0]
    assert 0.3 < np.mean(middle < 0.85 * middle.max()) < 0.6
