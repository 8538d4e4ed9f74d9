"""The report's pictures, as SVG text in the page's colours."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import FINGERS, Array
from drivers.core.poses import planar
from tactile_lab.colours import hex_colour, viridis
from tactile_lab.evaluation.trajectory import aligned_poses
from tactile_lab.report.content import PlacedContacts, ReportContent
from tactile_lab.report.svg import Chart, Frame, tick_label
from tactile_lab.report.uncertainty_figures import ellipse_mm, grasp_ticks

MAP_WIDTH = 500.0
NORMAL_LENGTH_mm = 6.0
LEAST_COLUMNS = 8
"""Minimum width of the force map in grasps, so that a short session does not have very wide cells."""
FINGER_NAMES = dict(zip(FINGERS, ("first", "middle", "ring", "little", "thumb"), strict=True))


def sigma_scale_mm(sigma_m: Array) -> float:
    """Upper end of the colour scale: the 98th percentile of the standard deviations, rounded up."""
    known = sigma_m[np.isfinite(sigma_m)]
    if not len(known):
        return 1.0
    high = max(1e3 * float(np.percentile(known, 98)), 0.1)
    power = 10.0 ** np.floor(np.log10(high))
    return float(next(power * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if power * step >= high - 1e-9))


def sigma_colours(sigma_m: Array, high_mm: float) -> list[str]:
    """The colour of each standard deviation, ``#rrggbb``."""
    return [hex_colour(colour) for colour in viridis(np.asarray(sigma_m) * 1e3 / high_mm)]


def top_view(content: ReportContent) -> str | None:
    """Contour coloured by its uncertainty, two sigma band, true outline, contacts with normals; millimetres."""
    contacts, truth = content.placed_contacts(), content.truth_outline_m()
    outlines = [ring for ring in (content.contour_m, truth) if ring is not None and len(ring)]
    points = np.concatenate([*outlines, *(grasp.points_m[:, :2] for grasp in contacts), np.zeros((0, 2))])
    if not len(points):
        return None
    chart = Chart.map(MAP_WIDTH, 1e3 * points, margin=0.1)
    chart.axes("x in the object frame, mm", "y in the object frame, mm")
    if content.contour_m is not None and len(content.contour_m) > 2:
        _draw_contour(chart, content)
    if content.fitted_outline_m is not None:
        chart.path(1e3 * content.fitted_outline_m, "truth-fit", closed=True)
    if truth is not None:
        chart.path(1e3 * truth, "truth", closed=True)
    for grasp in contacts:
        _draw_contacts(chart, grasp)
    count = sum(len(grasp.rows.fingers) for grasp in contacts)
    return chart.text("Top view", f"Estimated contour, true outline and {count} contacts seen from above.")


def _draw_contour(chart: Chart, content: ReportContent) -> None:
    assert content.contour_m is not None
    ring, sigma_m = 1e3 * content.contour_m, content.contour_sigma_m
    if len(sigma_m) != len(ring):
        chart.path(ring, "estimate", closed=True)
        return
    outer, inner = content.band_m()
    chart.area([1e3 * outer, 1e3 * inner[::-1]], "band")
    high_mm = sigma_scale_mm(sigma_m)
    middle = (sigma_m + np.roll(sigma_m, -1)) / 2
    ends, known = np.roll(ring, -1, axis=0), np.isfinite(middle)
    for piece in _pieces(ring, ~known):
        chart.path(piece, "guess")
    colours = sigma_colours(middle[known], high_mm)
    for start, end, colour in zip(ring[known], ends[known], colours, strict=True):
        chart.segment(start, end, "contour", f"stroke:{colour}")


def _pieces(ring: Array, chosen: NDArray[np.bool_]) -> list[Array]:
    """The connected lines of a closed ring's chosen segments; segment i leads from point i to the next one."""
    if not chosen.any() or chosen.all():
        return [np.vstack([ring, ring[:1]])] if chosen.any() else []
    opening = int(np.argmin(chosen))  # starts at a gap, so that no piece is split at the end of the arrays
    order = np.roll(np.arange(len(ring)), -opening)
    steps = np.diff(chosen[order].astype(int), append=0)
    pairs = zip(np.flatnonzero(steps > 0) + 1, np.flatnonzero(steps < 0) + 1, strict=True)
    return [ring[order[np.arange(first, last + 1) % len(ring)]] for first, last in pairs]


def _draw_contacts(chart: Chart, grasp: PlacedContacts) -> None:
    rows = grasp.rows
    for finger, point, normal, force in zip(rows.fingers, grasp.points_m, grasp.normals, rows.force_N, strict=True):
        at = 1e3 * point[:2]
        chart.segment(at, at + NORMAL_LENGTH_mm * normal[:2], "normal")
        tip = f"grasp {grasp.grasp + 1}, {FINGER_NAMES[finger]} finger, {force:.2f} N".replace("thumb finger", "thumb")
        chart.dot(at, "contact", tip=tip)


def colour_bar(high_mm: float) -> str:
    """The colour scale of the standard deviations, 0 to ``high_mm``."""
    chart = Chart(Frame(260, 34, left=4, right=22, top=2, bottom=20), (0.0, high_mm), (0.0, 1.0))
    edges = np.linspace(0.0, high_mm, 53)
    for low, high, colour in zip(edges[:-1], edges[1:], sigma_colours(edges[:-1] / 1e3, high_mm), strict=True):
        chart.box((low, 0.0), (high, 1.0), "bar", style=f"fill:{colour}")
    for value in chart.x.ticks(4):
        chart.label(value, 0.0, tick_label(value), "tick", "middle", dy=15)
    return chart.text("Colour scale", f"Standard deviation of the surface from 0 to {tick_label(high_mm)} millimetres.")


def trajectory_view(content: ReportContent) -> str | None:
    """The object's pose on the table at each grasp: estimate with its two-sigma ellipse, and truth, with headings."""
    truth = content.truth.world_T_object if content.truth else (None,) * len(content.results.trajectory.stamps_s)
    estimate = content.results.trajectory.world_T_object
    shown = aligned_poses(estimate, truth)
    shown = estimate if all(pose is None for pose in shown) else shown
    known = [pose for pose in (*shown, *truth) if pose is not None]
    if not known:
        return None
    corners = np.array([[1e3 * pose.x(), 1e3 * pose.y()] for pose in known])
    chart = Chart.map(460, corners, margin=0.18)
    chart.axes("x on the table, mm", "y on the table, mm")
    for pose, covariance in zip(shown, content.results.trajectory.covariances, strict=False):
        if pose is not None and covariance is not None:
            chart.area([1e3 * np.array([pose.x(), pose.y()]) + ellipse_mm(covariance)], "band")
    _draw_path(chart, truth, "truth")
    _draw_path(chart, shown, "estimate")
    placed = sum(pose is not None for pose in shown)
    return chart.text("Object on the table", f"{placed} estimated poses of the object, with the true poses.")


def _draw_path(chart: Chart, poses: tuple[Pose3 | None, ...], kind: str) -> None:
    known = [(index, planar(pose)) for index, pose in enumerate(poses) if pose is not None]
    places = 1e3 * np.array([[pose.x(), pose.y()] for _, pose in known]).reshape(-1, 2)
    chart.path(places, kind)
    reach = 0.035 * (chart.x.high - chart.x.low)
    for (index, pose), place in zip(known, places, strict=True):
        heading = place + reach * np.array([np.cos(pose.theta()), np.sin(pose.theta())])
        chart.segment(place, heading, f"{kind}-heading")
        radius = 5.0 if index == known[0][0] else 3.2
        chart.dot(place, f"{kind}-dot", radius=radius, tip=f"grasp {index + 1}, {kind}")


def force_map(content: ReportContent) -> str | None:
    """Contact force of each finger at each grasp; an empty cell is a finger without contact."""
    forces = [dict(zip(rows.fingers, rows.force_N, strict=True)) for rows in content.results.contacts]
    largest = max((max(found.values()) for found in forces if found), default=0.0)
    if largest <= 0.0:
        return None
    grasps = len(forces)
    chart = Chart(
        Frame(940, 196, left=64, bottom=36), (0.5, max(grasps, LEAST_COLUMNS) + 0.5), (0.0, float(len(FINGERS)))
    )
    for row, finger in enumerate(reversed(FINGERS)):
        chart.label(0.45, row + 0.5, FINGER_NAMES[finger], "tick", "end", dy=3.5)
        for index, found in enumerate(forces):
            _force_cell(chart, index, row, finger, found.get(finger), float(largest))
    for number in grasp_ticks(grasps):
        chart.label(number, 0.0, tick_label(number), "tick", "middle", dy=15)
    chart.label((grasps + 1) / 2, 0.0, "grasp", "axis", "middle", dy=31)
    return chart.text("Contact forces", f"Force of every finger at every grasp, up to {largest:.2f} newton.")


def _force_cell(chart: Chart, index: int, row: int, finger: str, force: float | None, largest: float) -> None:
    low, high = (index + 0.54, row + 0.06), (index + 1.46, row + 0.94)
    where = f"grasp {index + 1}, {FINGER_NAMES[finger]}"
    if force is None:
        chart.box(low, high, "empty", f"{where}: no contact")
        return
    share = force / largest
    chart.box(low, high, "cell", f"{where}: {force:.2f} N", f"fill:{hex_colour(viridis(np.array([share]))[0])}")
    kind = "on-light" if share > 0.55 else "on-dark"
    chart.label(index + 1, row + 0.5, f"{force:.1f}", kind, "middle", dy=3.5)
