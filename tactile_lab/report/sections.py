"""The sections of a report, each from the gathered content to markup."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from tactile_lab.evaluation.loops import first_in_map
from tactile_lab.evaluation.table import EvaluationRow, evaluation_rows
from tactile_lab.report import figures
from tactile_lab.report.content import ReportContent, Surface
from tactile_lab.report.markup import Markup, badge, element, figure, join, markup, table
from tactile_lab.report.rendering import VIEWS, views
from tactile_lab.report.viewer import surface_colours, viewer_data

UNKNOWN = "\u2013"
_STATUS = {"ok": ("tracked", "good"), "lost": ("object lost", "bad")}


def head(content: ReportContent) -> Markup:
    """Object, rig, method, seed, date and how it ended."""
    facts, slam = content.facts, content.results.slam
    parts = [
        ("rig", facts.rig),
        ("method", f"{slam['method']}, {slam['dimension']}-D"),
        ("seed", str(slam["seed"])),
        ("date", facts.started),
    ]
    line = join((join((f"{name} ", element("b", value))) for name, value in parts if value), "  ·  ")
    notes = [element("p", text, class_="facts") for text in (facts.notes, facts.problem) if text]
    return element(
        "header",
        element(
            "div",
            element("p", "Tactile SLAM session", class_="kicker"),
            element("h1", facts.object_name),
            element("p", line, class_="facts"),
            *notes,
        ),
        element("div", join(_badges(content), " ")),
        class_="top",
    )


def _badges(content: ReportContent) -> list[Markup]:
    text, kind = _STATUS.get(str(content.results.slam["status"]), (str(content.results.slam["status"]), "warn"))
    found = [badge(text, kind)]
    if content.evaluation is None:
        found.append(badge("not evaluated", "warn"))
    elif content.evaluation.get("failed"):
        found.append(badge("registration above 5 mm", "bad"))
    if content.facts.status != "closed":
        found.append(badge(f"session {content.facts.status}", "warn"))
    return found


def key_figures(content: ReportContent) -> Markup:
    """The strip of large numbers."""
    evaluation: Mapping[str, Any] = content.evaluation or {}
    shape, best = evaluation.get("shape") or {}, evaluation.get("shape_best_fit") or {}
    pose, time = evaluation.get("pose") or {}, evaluation.get("time") or {}
    contacts = sum(len(rows.fingers) for rows in content.results.contacts)
    placed = sum(world_T_object is not None for world_T_object in content.results.trajectory.world_T_object)
    grasps = len(content.results.trajectory.stamps_s)
    tiles = [
        ("Hausdorff distance", _number(shape.get("hausdorff_mm")), "mm", _best(best.get("hausdorff_mm"))),
        ("Mean distance", _number(shape.get("mean_distance_mm")), "mm", _best(best.get("mean_distance_mm"))),
        ("F-score at 5 mm", _number(shape.get("fscore_5mm"), 3), "", _best(best.get("fscore_5mm"), 3, "")),
        ("Position error", _number(pose.get("rmse_mm")), "mm", f"RMS; {_number(pose.get('final_mm'))} at the end"),
        ("Rotation error", _number(pose.get("rmse_deg")), "°", f"RMS; {_number(pose.get('final_deg'))} at the end"),
        ("Grasps", str(grasps), "", f"{placed} placed, {contacts} contacts"),
        ("SLAM step", _number(time.get("step_ms_median"), 0), "ms", f"median; {_number(time.get('total_s'))} s in all"),
    ]
    return element("dl", *(_tile(*tile) for tile in tiles), class_="strip")


def _tile(name: str, value: str, unit: str, under: str) -> Markup:
    number = element("dd", value, *([element("small", unit)] if unit and value != UNKNOWN else []))
    return element("div", element("dt", name), number, element("dd", under, class_="hint"))


def _best(value: float | None, digits: int = 1, unit: str = " mm") -> str:
    return "" if value is None else f"{_number(value, digits)}{unit} at best fit"


def _number(value: float | None, digits: int = 1) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def shape_section(content: ReportContent) -> Markup:
    """Top view and surface."""
    picture = figures.top_view(content)
    parts = [element("h2", "Shape"), element("p", _shape_lead(content), class_="lead")]
    cards = [] if picture is None else [_top_view_card(content, picture)]
    if content.surface is not None:
        cards.append(_surface_card(content, content.surface))
    if not cards:
        return join([*parts, element("p", "The session ended without a shape.")])
    return join([*parts, element("div", *cards, class_="pair")])


def _shape_lead(content: ReportContent) -> str:
    if content.results.dimension == 2:
        return (
            "The horizontal outline of the object in the frame born at the first grasp. The solid is that outline, "
            "extruded from the table to the highest contact: a planar session feels no top."
        )
    return "The object's surface in the frame born at the first grasp, and its section at the height of the contacts."


def _top_view_card(content: ReportContent, picture: str) -> Markup:
    keys = [("contour", "estimate"), ("contour_band", "two standard deviations"), ("contact", "contact with normal")]
    if content.truth_outline_m() is not None:
        keys.insert(1, ("truth", "true outline"))
    bar = _scale(content.contour_sigma_m)
    caption = (
        "Hold the pointer over a contact to see its finger and force."
        " The true outline is placed by the first grasp's marker pose alone."
    )
    return figure(picture, caption, "Seen from above", legend(keys), bar)


def _scale(sigma_m: np.ndarray[Any, Any]) -> Markup:
    if not len(sigma_m):
        return Markup("")
    scale = Markup(figures.colour_bar(figures.sigma_scale_mm(sigma_m)))
    return element("div", "uncertainty σ, mm", scale, class_="scale")


_SAMPLES = {
    "contour": '<line class="contour" x1="3" y1="6" x2="21" y2="6" style="stroke:#21918c"/>',
    "contour_band": '<rect class="band" x="1" y="1" width="22" height="10"/>',
    "estimate": '<path class="estimate" d="M1 6H23"/>',
    "truth": '<path class="truth" d="M1 6H23"/>',
    "contact": '<line class="normal" x1="6" y1="6" x2="21" y2="6"/><circle class="contact" cx="6" cy="6" r="4"/>',
}


def legend(keys: list[tuple[str, str]]) -> Markup:
    """Samples of marks with their meaning."""
    samples = [Markup(f'<svg viewBox="0 0 24 12" aria-hidden="true">{_SAMPLES[kind]}</svg>') for kind, _ in keys]
    return element("ul", *map(lambda s, k: element("li", s, k[1]), samples, keys), class_="legend")


def _surface_card(content: ReportContent, surface: Surface) -> Markup:
    high_mm = figures.sigma_scale_mm(surface.sigma_m)
    data = viewer_data(content, surface, high_mm).replace("</", "<\\/")
    stills = views(surface.vertices_m, surface.faces, surface_colours(surface, high_mm), 360)
    return element(
        "figure",
        element("h3", "Surface coloured by its uncertainty"),
        Markup(
            '<canvas tabindex="0" role="img" aria-label="Interactive view of the estimated surface. '
            'Drag or use the arrow keys to turn, the wheel or plus and minus to zoom."></canvas>'
        ),
        element("div", *map(_still, stills, (view.name for view in VIEWS)), class_="stills"),
        _controls(content),
        _scale(surface.sigma_m),
        element("figcaption", "Drag to turn, wheel to zoom. The file mesh.ply holds σ at every vertex."),
        Markup(f'<script type="application/json" id="viewer-data">{data}</script>'),
        class_="card",
        id="viewer",
    )


def _still(address: str, name: str) -> Markup:
    picture = Markup(f'<img src="{address}" alt="{markup(f"Estimated surface {name}")}">')
    return element("figure", picture, element("figcaption", name))


def _controls(content: ReportContent) -> Markup:
    names = ["surface", "contacts", *(["truth"] if content.truth_mesh() is not None else [])]
    boxes = [Markup(f'<label><input type="checkbox" name="{name}" checked>{name}</label>') for name in names]
    last = len(content.results.contacts)
    slider = (
        f'<label>up to grasp <input type="range" name="grasp" min="1" max="{last}" value="{last}">'
        f"<output>{last}</output></label>"
    )
    return element("div", *boxes, Markup(slider if last else ""), class_="controls")


def tracking_section(content: ReportContent) -> Markup:
    """Errors over the grasps and the object's way over the table."""
    errors, way = figures.error_over_grasps(content), figures.trajectory_view(content)
    cards = []
    if errors is not None:
        cards += [
            figure(errors[0], "Distance between true and estimated object origin.", "Position"),
            figure(errors[1], "Angle between true and estimated object frame.", "Rotation"),
        ]
    parts = [element("h2", "Tracking"), element("p", _tracking_lead(content), class_="lead")]
    if cards:
        parts.append(element("div", *cards, class_="pair"))
    if way is not None:
        caption = "The short line at each pose is the object's heading; the large dot is the first grasp."
        keys = legend([("estimate", "estimate"), ("truth", "marker camera")] if cards else [("estimate", "estimate")])
        parts.append(
            element("div", figure(way, caption, "On the table", keys), loops_card(content), class_="pair wide")
        )
    return join(parts)


def _tracking_lead(content: ReportContent) -> str:
    if content.truth is None:
        return "No marker camera saw the object: there is no truth to compare with."
    return (
        "The object's pose at each grasp against the marker camera, after the estimate's object frame is aligned "
        "at the first grasp that both know (zero by construction)."
    )


def loops_card(content: ReportContent) -> Markup:
    """Similar grasps that were tested and what came of them."""
    loops = content.results.slam["loops"]
    if not loops:
        text = element("p", "No grasp was similar enough to an earlier one to be tested.", class_="lead")
        return element("div", element("h3", "Similar grasps"), text, class_="card")
    born = first_in_map(content.results.trajectory.world_T_object)
    rows = [_loop_row(loop, born) for loop in loops]
    titles = ["grasps", "faces", "test value", "limit", "verdict", "reason"]
    accepted = sum(bool(loop["accepted"]) for loop in loops)
    told = f"{accepted} of {len(loops)} went into the pose graph."
    return element(
        "div",
        element("h3", "Similar grasps"),
        element("p", told, class_="lead"),
        element("div", table(titles, rows, (0, 4, 5)), class_="tall"),
        class_="card",
    )


def _loop_row(loop: Mapping[str, Any], born: int) -> list[str | Markup]:
    verdict = badge("accepted", "good") if loop["accepted"] else badge("refused", "warn")
    return [
        f"{born + loop['earlier'] + 1} \u2013 {born + loop['later'] + 1}",
        str(loop["faces"]),
        _number(loop["test_value"]),
        _number(loop["limit"]),
        verdict,
        str(loop["reason"]),
    ]


def grasp_section(content: ReportContent) -> Markup:
    """Forces and one line a grasp."""
    picture = figures.force_map(content)
    parts = [element("h2", "Grasps")]
    if picture is not None:
        parts.append(figure(picture, "Newton; a dashed place is a finger that did not touch.", "Contact forces"))
    rows = [_grasp_row(content, index) for index in range(len(content.results.contacts))]
    titles = ["grasp", "time, s", "contacts", "verdict", "reason", "σ, mm", "σ, °", "error, mm", "error, °"]
    note = "σ is the estimate's own standard deviation of position and heading; the error is against the marker camera."
    parts.append(element("div", table(titles, rows, (0, 3, 4)), element("p", note, class_="note"), class_="card wide"))
    return join(parts)


_VERDICTS = {"first": "good", "tracked": "good", "uncertain": "warn", "untracked": "bad"}


def _grasp_row(content: ReportContent, index: int) -> list[str | Markup]:
    """One grasp: when, what was felt, what SLAM made of it, how well."""
    results = content.results
    step: Mapping[str, Any] = _entry(results.slam["steps"], index)
    error: Mapping[str, Any] = _entry(((content.evaluation or {}).get("pose") or {}).get("per_grasp"), index)
    covariances = results.slam.get("covariances") or ()
    sigma_mm, sigma_deg = _pose_sigma(covariances[index] if index < len(covariances) else None)
    verdict = str(step.get("verdict", UNKNOWN))
    return [
        str(index + 1),
        f"{results.trajectory.stamps_s[index]:.1f}",
        f"{step.get('contacts_used', UNKNOWN)} of {len(results.contacts[index].fingers)}",
        badge(verdict, _VERDICTS.get(verdict, "warn")),
        str(step.get("reason", "")),
        _number(sigma_mm, 2),
        _number(sigma_deg, 2),
        _number(error.get("mm"), 2),
        _number(error.get("deg"), 2),
    ]


def _entry(entries: Sequence[Mapping[str, Any] | None] | None, index: int) -> Mapping[str, Any]:
    """An entry of a list that may be too short or hold nulls."""
    return (entries[index] if entries and index < len(entries) else None) or {}


def _pose_sigma(covariance: Sequence[Sequence[float | None]] | None) -> tuple[float | None, float | None]:
    """Standard deviations of position and heading, millimetres and degrees, from a covariance of (x, y, yaw)."""
    if covariance is None or any(entry is None for row in covariance for entry in row):
        return None, None
    x, y, yaw = np.diag(np.array(covariance, dtype=float))
    return 1e3 * float(np.sqrt(x + y)), float(np.degrees(np.sqrt(yaw)))


def evaluation_section(content: ReportContent) -> Markup:
    """The evaluation as a table with what each figure means."""
    parts = [element("h2", "Evaluation")]
    if content.evaluation is None:
        return join([*parts, element("p", "The session has not been evaluated. Run: tactile-lab evaluate SESSION")])
    rows = [_evaluation_row(row) for row in evaluation_rows(content.evaluation)]
    return join([*parts, element("div", table(["figure", "value", "meaning"], rows, (0, 2)), class_="card")])


def _evaluation_row(row: EvaluationRow) -> list[str | Markup]:
    value = join((row.value, element("span", row.unit, class_="unit") if row.unit else Markup("")))
    return [row.label, value, row.note]


def origin_section(content: ReportContent) -> Markup:
    """How the session was made: seeds, versions, calibrations, and all settings of the estimation."""
    rows = [[name, element("code", value)] for name, value in content.facts.made_with]
    rows += [[f"calibration: {role}", element("code", digest)] for role, digest in content.facts.calibrations]
    settings = [[name, element("code", value)] for name, value in flat(content.results.slam.get("settings") or {})]
    folded = element(
        "details", element("summary", "Settings of the estimation"), table(["setting", "value"], settings, (0, 1))
    )
    card = element("div", table(["item", "value"], rows, (0, 1)), folded if settings else "", class_="card wrap")
    return join([element("h2", "How it was made"), card])


def flat(settings: Mapping[str, Any], above: str = "") -> list[tuple[str, str]]:
    """Nested settings as dotted names with their values as text."""
    rows = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            rows += flat(value, f"{above}{name}.")
        else:
            rows.append((f"{above}{name}", str(value)))
    return rows


def resource(name: str) -> str:
    """A text file that lies beside this module in the package."""
    return files("tactile_lab.report").joinpath(name).read_text(encoding="utf-8")
