"""The report's pictures of what the estimate says of itself: bands over the grasps, calibration curve, picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from tactile_lab.evaluation.trajectory import pose_errors
from tactile_lab.report.camera_picture import draw_on_picture
from tactile_lab.report.content import ReportContent
from tactile_lab.report.svg import Chart, Frame

SIGMAS = 2.0
_ELLIPSE_POINTS = 40


def error_over_grasps(content: ReportContent) -> tuple[str, str] | None:
    """Position error in millimetres and rotation error in degrees at each grasp, over the stated two-sigma bands.

    Without truth only the bands; None if neither is known.
    """
    truth = None if content.truth is None else content.truth.world_T_object
    errors = None if truth is None else pose_errors(content.results.trajectory.world_T_object, truth)
    found = () if errors is None else errors.per_grasp
    known = [[index + 1, error.mm, error.deg] for index, error in enumerate(found) if error is not None]
    table, stated = np.array(known).reshape(-1, 3), _stated(content)
    if not len(table) and not len(stated):
        return None
    grasps = len(content.results.trajectory.stamps_s)
    return (
        _series(table[:, [0, 1]], stated[:, [0, 1]], grasps, ("position", "mm")),
        _series(table[:, [0, 2]], stated[:, [0, 2]], grasps, ("rotation", "°")),
    )


def _stated(content: ReportContent) -> Array:
    """Number of each grasp with a covariance, and two standard deviations of position (mm) and rotation (°)."""
    sigmas = [(index + 1, *content.pose_sigma(index)) for index in range(len(content.results.trajectory.stamps_s))]
    rows = [[index, SIGMAS * mm, SIGMAS * deg] for index, mm, deg in sigmas if mm is not None and deg is not None]
    return np.array(rows).reshape(-1, 3)


def _series(points: Array, stated: Array, grasps: int, names: tuple[str, str]) -> str:
    """Errors as a line with dots over the grasp numbers, from zero up, and the stated bound as an area."""
    (name, unit), largest = names, float(np.concatenate([points[:, 1], stated[:, 1]]).max())
    chart = Chart(Frame(460, 230), (0.5, grasps + 0.5), (0.0, max(largest * 1.12, 1e-3)))
    chart.axes("grasp", f"{name}, {unit}", x_ticks=grasp_ticks(grasps))
    if len(stated):
        base = np.array([[stated[-1, 0], 0.0], [stated[0, 0], 0.0]])
        chart.area([np.concatenate([stated, base])], "band")
        chart.path(stated, "bound")
    chart.path(points, "estimate")
    for number, value in points:
        chart.dot((number, value), "mark", tip=f"grasp {number:.0f}: {value:.2f} {unit}")
    told = f"Two stated standard deviations are at most {stated[:, 1].max():.2f} {unit}." if len(stated) else ""
    ends = (
        f"The error ends at {points[-1, 1]:.2f} {unit}, largest {points[:, 1].max():.2f} {unit}. "
        if len(points)
        else ""
    )
    return chart.text(f"{name.capitalize()} over the grasps", ends + told)


def grasp_ticks(grasps: int) -> list[float]:
    """Numbers of grasps to write below an axis, about a dozen."""
    step = max(1, -(-grasps // 12))
    return [float(number) for number in range(1, grasps + 1, step)]


def ellipse_mm(covariance: Array) -> Array:
    """Outline of two standard deviations of x and y about the origin, shape (n, 2), millimetres."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    turns = np.linspace(0.0, 2 * np.pi, _ELLIPSE_POINTS, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    return np.asarray(1e3 * SIGMAS * circle * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def calibration_curve(consistency: Mapping[str, Any]) -> str | None:
    """Share of true values inside the stated regions against the stated probability; None if nothing was judged."""
    surface, poses = consistency.get("surface"), consistency.get("poses") or consistency.get("poses_common")
    if not surface and not poses:
        return None
    chart = Chart(Frame(460, 300), (0.0, 100.0), (0.0, 100.0))
    chart.axes("stated probability, %", "truth inside, %")
    chart.path(np.array([[0.0, 0.0], [100.0, 100.0]]), "ideal")
    said = []
    for name, found, levels, shares in (
        ("surface", surface, consistency.get("curve_levels"), "curve"),
        ("poses", poses, consistency.get("levels"), "inside"),
    ):
        if not found or not levels:
            continue
        points = 100 * np.column_stack([levels, found[shares]])
        chart.path(points, "estimate" if name == "surface" else "truth")
        for x, y in points:
            chart.dot(
                (x, y), "mark" if name == "surface" else "truth-dot", tip=f"{name}: {y:.0f} % of stated {x:.0f} %"
            )
        said.append(f"{name} {points[-1, 1]:.0f} % inside the stated {points[-1, 0]:.0f} %")
    words = f"On the diagonal the stated uncertainties are true; here {' and '.join(said)}."
    return chart.text("Calibration curve", words)


def camera_picture(content: ReportContent) -> str | None:
    """The camera's last picture of a grasp, with the estimated outline, two sigma beside it, truth and contacts."""
    view, contour_m = content.camera, content.contour_m
    if view is None:
        return None
    pose = content.results.trajectory.world_T_object[view.grasp]
    assert pose is not None
    outlines: list[tuple[str, Array]] = []
    truth = content.truth
    if (
        truth is not None
        and truth.outline_m is not None
        and (true_pose := truth.world_T_object[view.grasp]) is not None
    ):
        outlines.append(("truth", _in_world(content, true_pose, truth.outline_m)))
    if contour_m is not None and len(contour_m) > 2:
        outlines += [("bound", _in_world(content, pose, ring)) for ring in content.band_m()]
        outlines.append(("estimate", _in_world(content, pose, contour_m)))
    contacts = content.results.contacts[view.grasp].points_world_m
    words = (
        f"Grasp {view.grasp + 1} seen by the marker camera, with the estimated outline and {len(contacts)} contacts."
    )
    return draw_on_picture(view, outlines, contacts, words)


def _in_world(content: ReportContent, pose: Pose3, ring_m: Array) -> Array:
    """A ring of the object's frame in the world; in a planar session on the table, where the camera sees the foot."""
    world = transform_points(pose, np.pad(ring_m, ((0, 0), (0, 1))))
    if content.results.dimension == 2:
        world[:, 2] = 0.0
    return world
