"""What a running session takes for the object's surface in space: the best model's, known where it was felt."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3
from scipy.spatial import cKDTree

from drivers.core.contacts import FINGERS, Contact, Grasp
from drivers.core.poses import planar
from drivers.shadow.closing.posture import HandShape
from tactile_lab.autonomy.estimate_messages import surface_message
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.unknown_part import describe_unknown
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, known_shape
from tactile_lab.slam.exploration.rewards import explored_share
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.box_shapes import solid_contacts

CORNERS_m = np.array([[x, y, 0.04] for x in (-0.05, 0.05) for y in (-0.03, 0.03)])


def touched(points_m: np.ndarray, normals: np.ndarray, shape_model: str = "auto") -> TactileSlam:
    """An estimation of an object that lies still, touched in these places by five fingers at a time."""
    order = np.random.default_rng(0).permutation(len(points_m))
    grasps = [
        Grasp(
            index,
            index,
            tuple(
                Contact(finger, points_m[i], normals[i], 1e-6 * np.eye(3), 0.05, 0.5)
                for finger, i in zip(FINGERS, order[first : first + 5], strict=False)
            ),
            Pose3(),
        )
        for index, first in enumerate(range(0, len(order), 5))
    ]
    settings = SlamSettings.model_validate({"method": "known-pose", "dimension": 3, "shape_model": shape_model})
    slam = TactileSlam(settings, 0, [Pose3()] * len(grasps))
    for grasp in grasps:
        slam.add_grasp(grasp)
    return slam


def planned_with(slam: TactileSlam) -> KnownShape:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0), 3)
    known = Planner(slam, rule, ExplorationSettings(), 1, HandShape(), 3).known_shape()
    assert known is not None
    return known


def off_corners_m(known: KnownShape, slam: TactileSlam) -> float:
    """How far the surface stays away from the box's upper corners."""
    assert known.surface is not None
    assert slam.world_T_object is not None
    corners = np.array([slam.world_T_object.transformTo(corner) for corner in CORNERS_m])
    return float(cKDTree(known.surface.points_m).query(corners)[0].max())


@pytest.fixture(scope="module")
def box() -> TactileSlam:
    """10 x 6 x 4 cm, touched on five sides."""
    return touched(*solid_contacts())


def test_a_box_that_was_touched_on_five_sides_has_corners_for_the_planner(box: TactileSlam) -> None:
    known = planned_with(box)
    assert off_corners_m(known, box) < 0.002
    assert known.top_height_m == pytest.approx(0.04, abs=0.001)
    assert box.surface is not None
    smooth = known_shape(box.surface, 3, box.origin_height_m, ExplorationSettings())
    assert off_corners_m(smooth, box) > 0.004
    assert known.field is box.surface  # by which grasps keep clear of the object, as ever


def test_what_a_model_concludes_is_not_explored() -> None:
    points_m, normals = solid_contacts()
    felt = (np.abs(normals[:, 1]) < 0.5) | (points_m[:, 0] < -0.015)  # the long walls only at one end
    slam = touched(points_m[felt], normals[felt])
    model, known = slam.shape(0.006), planned_with(slam)
    assert isinstance(model, SurfaceMesh)
    assert known.surface is not None
    assert slam.world_T_object is not None
    walls_m = np.array([slam.world_T_object.transformTo(np.array([0.02, y, 0.02])) for y in (-0.03, 0.03)])
    away_m, nearest = cKDTree(known.surface.points_m).query(walls_m)
    assert away_m.max() < 0.012  # it is where the model puts it
    assert model.sigma_m[nearest].max() < 0.002
    assert known.surface.sigma_m[nearest].min() > 0.003
    assert known.explored < explored_share(model) - 0.15


def test_a_session_shows_the_surface_it_goes_by(box: TactileSlam) -> None:
    known = planned_with(box)
    message = surface_message(known)
    assert known.surface is not None
    np.testing.assert_allclose(message["vertices_m"], known.surface.points_m, atol=1e-5)
    np.testing.assert_allclose(message["sigma_m"], known.surface.sigma_m, atol=1e-6)
    assert message["faces"] == known.surface.cells.tolist()
    assert message["explored"] == known.explored


def test_the_field_stands_in_where_a_model_has_no_surface() -> None:
    angles, heights = np.meshgrid(np.linspace(-np.pi, np.pi, 12, endpoint=False), np.linspace(-0.9, 0.9, 5))
    level = np.sqrt(1.0 - heights**2)
    outward = np.stack([level * np.cos(angles), level * np.sin(angles), heights], axis=-1).reshape(-1, 3)
    sphere = touched(0.03 * outward + [0.0, 0.0, 0.03], outward, shape_model="facets")
    assert sphere.shape(0.006) is None  # so many faces are none
    known = planned_with(sphere)
    assert known.surface is not None
    assert known.top_height_m == pytest.approx(0.06, abs=0.002)


def test_the_side_that_nobody_touched_is_named() -> None:
    points_m, normals = solid_contacts()
    felt = normals[:, 0] < 0.5
    slam = touched(points_m[felt], normals[felt])
    assert slam.world_T_object is not None
    assert describe_unknown(planned_with(slam), planar(slam.world_T_object)).endswith("least known is the far side")
