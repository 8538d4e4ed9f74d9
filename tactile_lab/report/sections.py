"""The sections of a report, each from the gathered content to markup."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from tactile_lab.evaluation.files.properties_file import MeasuredBody
from tactile_lab.evaluation.table import UNKNOWN, size_in_words
from tactile_lab.report import figures
from tactile_lab.report.content import ReportContent, Surface
from tactile_lab.report.legend import legend
from tactile_lab.report.listings import loops_card, number
from tactile_lab.report.markup import Markup, badge, element, figure, join, markup
from tactile_lab.report.rendering import VIEWS, views
from tactile_lab.report.uncertainty_figures import camera_picture, error_over_grasps
from tactile_lab.report.viewer import surface_colours, viewer_data

_STATUS = {
    "complete": ("complete", "good"),
    "partial": ("partly known", "warn"),
    "ambiguous": ("ambiguous", "bad"),
    "lost": ("object lost", "bad"),
}


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
            element("h1", facts.headline),
            element("p", line, class_="facts"),
            *notes,
        ),
        element("div", join(_badges(content), " ")),
        class_="top",
    )


def _badges(content: ReportContent) -> list[Markup]:
    status, share = content.results.status, content.results.known_share
    text, kind = _STATUS.get(status, (status, "warn"))
    text += "" if share is None else f", {share:.0%} touched"
    found = [badge(text, kind)]
    if content.evaluation is None:
        found.append(badge("not evaluated", "warn"))
    elif content.evaluation.get("failed"):
        found.append(badge("registration above 5 mm", "bad"))
    if content.facts.status != "closed":
        found.append(badge(f"session {content.facts.status}", "bad" if content.facts.status == "failed" else "warn"))
    return found


def key_figures(content: ReportContent) -> Markup:
    """The row of key figures."""
    evaluation: Mapping[str, Any] = content.evaluation or {}
    shape, best = evaluation.get("shape") or {}, evaluation.get("shape_best_fit") or {}
    pose, time = evaluation.get("pose") or {}, evaluation.get("time") or {}
    contacts = sum(len(rows.fingers) for rows in content.results.contacts)
    placed = sum(world_T_object is not None for world_T_object in content.results.trajectory.world_T_object)
    grasps = len(content.results.trajectory.stamps_s)
    tiles = [
        ("Hausdorff distance", number(shape.get("hausdorff_mm")), "mm", _best(best.get("hausdorff_mm"))),
        ("Mean distance", number(shape.get("mean_distance_mm")), "mm", _best(best.get("mean_distance_mm"))),
        ("F-score at 1 mm", number(shape.get("fscore_1mm"), 3), "", _best(best.get("fscore_1mm"), 3, "")),
        *_size_tiles(evaluation.get("dimensions") or ()),
        *_mass_tile(content.measured),
        ("Position error", number(pose.get("rmse_mm")), "mm", _at_end(pose, "final_mm")),
        ("Rotation error", number(pose.get("rmse_deg")), "°", _at_end(pose, "final_deg")),
        ("Grasps", str(grasps), "", f"{placed} placed, {contacts} contacts"),
        ("SLAM step", number(time.get("step_ms_median"), 0), "ms", f"median; {number(time.get('total_s'))} s in total"),
    ]
    return element("dl", *(_tile(*tile) for tile in tiles), class_="strip")


def _size_tiles(extents: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Estimated dimensions with two standard deviations, and below them the true ones or what is only a guess."""
    return [(str(extent["name"]).capitalize(), *_size_tile(extent)) for extent in extents]


def _size_tile(extent: Mapping[str, Any]) -> tuple[str, str, str]:
    value, note = size_in_words(extent)
    true = "" if extent.get("true_mm") is None else f"true {extent['true_mm']:.1f} mm"
    told = [note, true] if extent.get("is_guess") else [true or note]
    return value, "mm", "; ".join(words for words in told if words)


def _mass_tile(measured: MeasuredBody) -> list[tuple[str, str, str, str]]:
    if (mass_kg := measured.mass_kg) is None:
        return []
    told = f"{1e3 * mass_kg.value:.0f} \u00b1 {2e3 * mass_kg.sigma:.0f}"
    how = "as weighed" if measured.hung_free else "as it stood on an edge"
    return [("Mass", told, "g", f"{how}; two standard deviations")]


def _tile(name: str, value: str, unit: str, under: str) -> Markup:
    figure_with_unit = element("dd", value, *([element("small", unit)] if unit and value != UNKNOWN else []))
    return element("div", element("dt", name), figure_with_unit, element("dd", under, class_="hint"))


def _at_end(pose: Mapping[str, Any], key: str) -> str:
    return f"RMS; {number(pose[key])} at the end" if pose else "needs two marker sightings"


def _best(value: float | None, digits: int = 1, unit: str = " mm") -> str:
    return "" if value is None else f"{number(value, digits)}{unit} at best fit"


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
            "The horizontal outline of the object in the frame defined by the first grasp. The solid is that outline, "
            "extruded from the table to the highest contact: a planar session does not measure the top."
        )
    return (
        "The object's surface in the frame defined by the first grasp, and its section at the height of the contacts."
    )


def _top_view_card(content: ReportContent, picture: str) -> Markup:
    keys = [("contour", "estimate"), ("contour_band", "two standard deviations"), ("contact", "contact with normal")]
    if not np.isfinite(content.contour_sigma_m).all():
        keys.insert(1, ("guess", "guess: nothing was touched near it"))
    if content.truth_outline_m() is not None:
        keys.insert(1, ("truth", "true outline, aligned at the first grasp"))
    if content.fitted_outline_m is not None:
        keys.insert(2, ("truth-fit", "at best fit"))
    bar = _scale(content.contour_sigma_m)
    caption = (
        "Point at a contact to see its finger and force. The dashed outline is aligned by the marker pose of the first"
        " grasp, the dotted one is fitted to the estimate."
    )
    return figure(picture, caption, "Seen from above", legend(keys), bar)


def _scale(sigma_m: np.ndarray[Any, Any]) -> Markup:
    if not len(sigma_m):
        return Markup("")
    scale = Markup(figures.colour_bar(figures.sigma_scale_mm(sigma_m)))
    return element("div", "uncertainty σ, mm", scale, class_="scale")


def _surface_card(content: ReportContent, surface: Surface) -> Markup:
    high_mm = figures.sigma_scale_mm(surface.sigma_m)
    data = viewer_data(content, surface, high_mm).replace("</", "<\\/")
    stills = views(surface.vertices_m, surface.faces, surface_colours(surface, high_mm), np.isnan(surface.sigma_m), 360)
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
        element(
            "figcaption", f"{_grey(surface)}Drag to turn, wheel to zoom. The file mesh.ply holds σ at every vertex."
        ),
        Markup(f'<script type="application/json" id="viewer-data">{data}</script>'),
        class_="card",
        id="viewer",
    )


def _grey(surface: Surface) -> str:
    return "" if np.isfinite(surface.sigma_m).all() else "Striped grey is a guess: nothing was touched near it. "


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
    """Errors over the grasps and the object's path on the table."""
    errors, way = error_over_grasps(content), figures.trajectory_view(content)
    keys = [("estimate", "error")] if content.truth is not None else []
    keys += [("bound", "two stated standard deviations")] if content.results.trajectory.covariances else []
    cards = []
    if errors is not None:
        cards += [
            figure(errors[0], "Distance between true and estimated object origin.", "Position", legend(keys)),
            figure(errors[1], "Angle between true and estimated object frame.", "Rotation", legend(keys)),
        ]
    parts = [element("h2", "Tracking"), element("p", _tracking_lead(content), class_="lead")]
    if cards:
        parts.append(element("div", *cards, class_="pair"))
    if way is not None:
        caption = (
            "The short line at each pose is the object's heading; the large dot is the first grasp. Ellipses are two "
            "stated standard deviations."
        )
        seen = [("truth", "marker camera")] if content.truth is not None else []
        shown = legend([("estimate", "estimate"), *seen])
        picture = _picture_card(content)
        cards = [figure(way, caption, "On the table", shown), *([] if picture is None else [picture])]
        parts.append(element("div", *cards, loops_card(content), class_="pair wide"))
    if content.camera_problem:
        text = f"No picture of the camera can be shown: {content.camera_problem}"
        parts.append(element("p", text, class_="note"))
    return join(parts)


def _picture_card(content: ReportContent) -> Markup | None:
    """The camera's last picture with the estimate in it; None without one."""
    picture = camera_picture(content)
    if content.camera is None or picture is None:
        return None
    where = "on the table" if content.results.dimension == 2 else "at the height of the contacts"
    caption = (
        f"The outline is drawn {where}, where the estimated pose places it; thin lines are two standard deviations."
    )
    keys = legend([("estimate-seen", "estimate"), ("truth-seen", "truth, by the marker"), ("seen", "contacts")])
    return figure(picture, caption, f"The camera's picture of grasp {content.camera.grasp + 1}", keys)


def _tracking_lead(content: ReportContent) -> str:
    if content.truth is None:
        return "No marker camera saw the object: there is no ground truth to compare with."
    return (
        "The object's pose at each grasp compared with the marker camera. The object frames are aligned at the "
        "first grasp known to both, where the error is therefore zero."
    )


def resource(name: str) -> str:
    """A text file next to this module in the package."""
    return files("tactile_lab.report").joinpath(name).read_text(encoding="utf-8")
