"""The bounding box felt before the first grasp: on a disc without physics, and what grasps make of it."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.conductor import Conductor
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.motion import Motion
from sessions.motion.probing.bounding_box import SIDES, BoundingBox
from sessions.motion.probing.box_prober import BoxProber, ProbingSettings
from sessions.motion.probing.raking import Raker
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.variance_planner import ExplorationSettings
from tactile_lab.experiments.data.outlines import first_crossing
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_world import Disc, DiscWorld, TIP_CENTRE_m

TIP = HandShape((0.0085, 0.0085, 0.0085), tuple(TIP_CENTRE_m))
QUICK = CycleSettings(finger_rad_s=20.0, travel_m_s=1.0, turn_rad_s=5.0)
ONE_LANE = ProbingSettings(lanes_m=(0.0,), enabled=True)
WINDOW_rad = (-1.31, 1.31)


def prober(world: DiscWorld, settings: ProbingSettings = ONE_LANE) -> BoxProber:
    supervisor = SafetySupervisor(world, SafetySettings(), world.cycle_ns)
    supervisor.on_approach()
    toucher = Raker(Motion(world, supervisor), QUICK, TIP)  # type: ignore[arg-type]
    return BoxProber(toucher, settings, WINDOW_rad, (0.0, 0.0))


def test_box_of_a_disc_is_felt_on_all_sides() -> None:
    disc = Disc(np.array([0.01, -0.005]), radius_m=0.035, height_m=0.045)
    box = prober(DiscWorld(disc)).feel()
    assert box.missing == {}
    assert box.top_m == pytest.approx(0.045, abs=3e-3)
    np.testing.assert_allclose(box.low_m, disc.centre_m - 0.035, atol=6e-3)
    np.testing.assert_allclose(box.high_m, disc.centre_m + 0.035, atol=6e-3)
    assert "bounding box" in box.in_words()
    assert "not found" not in box.in_words()


def test_empty_table_finds_nothing_and_says_so_of_every_side() -> None:
    box = prober(DiscWorld(None)).feel()
    assert not box.is_found
    assert box.top_m is None
    assert set(box.missing) == set(SIDES)
    assert "top not found" in box.in_words()
    assert "left not found: nothing touched in 1 lanes" in box.in_words()


def test_only_the_top_is_felt_of_what_the_palm_passes_over_unless_the_sides_are_wanted() -> None:
    box = prober(DiscWorld(Disc(np.zeros(2), height_m=0.045)), ProbingSettings()).feel()
    assert box.top_m == pytest.approx(0.045, abs=3e-3)
    assert box.is_found
    assert not box.has_sides
    assert box.in_words().startswith("the object is 4")


@pytest.mark.parametrize("enabled", [pytest.param(True, marks=pytest.mark.long), False])
def test_what_the_palm_does_not_pass_over_is_felt_from_its_sides(enabled: bool) -> None:
    disc = Disc(np.array([0.006, -0.004]), radius_m=0.035, height_m=0.15)
    box = prober(DiscWorld(disc), ONE_LANE.model_copy(update={"enabled": enabled})).feel()
    assert box.missing == {}
    assert box.has_sides
    assert box.top_m == pytest.approx(0.15, abs=3e-3)
    np.testing.assert_allclose(box.centre_world_m, disc.centre_m, atol=9e-3)
    np.testing.assert_allclose(box.high_m - box.low_m, [0.07, 0.07], atol=1e-2)


def test_top_is_looked_for_around_where_it_is_expected() -> None:
    box = prober(DiscWorld(Disc(np.array([0.06, 0.0]), radius_m=0.02)), ProbingSettings()).feel()
    assert box.top_m == pytest.approx(0.04, abs=3e-3)


def test_object_beyond_the_search_is_told() -> None:
    wide = Disc(np.zeros(2), radius_m=0.16, height_m=0.04)
    box = prober(DiscWorld(wide)).feel()
    assert "something stands 130 mm from where the object is expected" in box.missing["left"]


def test_probing_can_be_interrupted_between_sides() -> None:
    asked = iter([False, False, True, True, True])
    box = prober(DiscWorld(Disc(np.zeros(2), radius_m=0.035))).feel(lambda: next(asked))
    assert box.top_m is not None
    assert [box.missing.get(side) for side in SIDES[1:]] == ["interrupted"] * 3


class TurnedBoxToucher:
    """Feels a box of 80 x 50 mm that is turned on the table: where tips on straight ways first meet its outline."""

    def __init__(self, turn_rad: float) -> None:
        corners = np.array([[0.04, 0.025], [-0.04, 0.025], [-0.04, -0.025], [0.04, -0.025]])
        c, s = np.cos(turn_rad), np.sin(turn_rad)
        self.outline_m = corners @ np.array([[c, s], [-s, c]])

    first_finger_side = 1.0

    def expect_tallest(self, height_m: float) -> None:
        """Nothing is in the way here."""

    def on_top(self, height_m: float) -> None:
        """Nothing is in the way here."""

    def tap(self, frame: GraspFrame) -> np.ndarray:
        return np.array([[frame.x_m, frame.y_m, 0.04]])

    def rake(self, frame: GraspFrame, from_m: float) -> np.ndarray:
        """Whatever reaches farthest toward the row, which is wide."""
        way = np.array([np.cos(frame.yaw_rad), np.sin(frame.yaw_rad)])
        foremost = self.outline_m[np.argmax(self.outline_m @ way)]
        return np.array([[*foremost, 0.02]])

    def close_thumb(self, frame: GraspFrame) -> np.ndarray:
        thumb = closing("pinch", 0.028, TIP).path("TH")
        start, way = frame.pose.transformFrom(thumb.start_m), frame.pose.rotation().rotate(thumb.direction)
        beside = np.cross([0.0, 0.0, 1.0], way)[:2]
        lines = [
            first_crossing(self.outline_m, start[:2] + aside * beside, way[:2], 0.12) for aside in (-0.008, 0.0, 0.008)
        ]
        points = [np.array([*hit[0], 0.02]) for hit in lines if hit is not None]
        return np.array(sorted(points, key=lambda point: point[0])[:1]).reshape(-1, 3)


@pytest.mark.parametrize("turn_deg", [0.0, 25.0, 35.0, 50.0, 65.0, -25.0, -50.0])
def test_back_corner_of_a_turned_box_is_felt(turn_deg: float) -> None:
    """One lane in the middle would stop at the flank, up to 20 mm short of the corner."""
    toucher = TurnedBoxToucher(np.deg2rad(turn_deg))
    box = BoxProber(toucher, ProbingSettings(enabled=True), WINDOW_rad, (0.0, 0.0)).feel()  # type: ignore[arg-type]
    assert "back" not in box.missing
    assert box.low_m[0] == pytest.approx(toucher.outline_m[:, 0].min(), abs=0.0095)


def test_thumb_that_stands_on_the_object_tells_its_place() -> None:
    """Too long for the hand: no way down for the thumb, but the object reaches at least as far as it stood."""
    world = DiscWorld(Disc(np.zeros(2), radius_m=0.060, height_m=0.045))
    box = prober(world).feel()
    assert "back" not in box.missing
    assert box.low_m[0] < -0.045


def felt(half_x_m: float = 0.06, half_y_m: float = 0.03) -> BoundingBox:
    high = np.array([half_x_m, half_y_m])
    return BoundingBox(Pose2(), -high, high, 0.008, 0.04, {})


def test_places_in_the_margin_are_not_clear() -> None:
    box = felt()
    assert box.is_clear(np.array([[0.07, 0.0], [0.0, 0.04]]))
    assert not box.is_clear(np.array([[0.066, 0.0], [0.0, 0.05]]))


def test_box_moves_with_the_object() -> None:
    box = felt().move(Pose2(0.1, 0.0, np.pi / 2))
    np.testing.assert_allclose(box.centre_world_m, [0.1, 0.0], atol=1e-12)
    assert box.is_clear(np.array([[0.15, 0.0]]))
    assert not box.is_clear(np.array([[0.1, 0.06]]))


class NoEstimate:
    """An estimation that knows nothing yet."""

    surface, world_T_object, is_lost, pose_covariance = None, None, False, None


def test_grasps_span_the_short_side_of_the_box() -> None:
    """The hand opens 140 mm less its fingertips: around a box of 120 x 60 mm and its margin only across."""
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0))
    planner = Planner(NoEstimate(), rule, ExplorationSettings(), 2, HandShape(), 2)  # type: ignore[arg-type]
    box = felt(half_x_m=0.03, half_y_m=0.06)
    planner.on_bounding_box(box)
    for index in range(4):
        plan = planner.plan(index)
        paths = closing(plan.closing, plan.height_m, HandShape()).paths
        tips = np.array([plan.frame.pose.transformFrom(p.centre_m(p.valid[0])) for p in paths.values()])
        assert box.is_clear(tips[:, :2])


def test_box_is_carried_with_the_object() -> None:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0))
    planner = Planner(NoEstimate(), rule, ExplorationSettings(), 2, HandShape(), 2)  # type: ignore[arg-type]
    planner.on_bounding_box(felt())
    planner.on_carry(HandMotion(Pose3(Rot3(), np.array([0.05, 0.0, 0.0]))))
    np.testing.assert_allclose(planner.centre_m, [0.05, 0.0], atol=1e-9)


def run(world: DiscWorld, grasps: int = 1) -> SessionOutcome:
    settings = SessionSettings(grasps=grasps, fixed_grasps=grasps, cycle=QUICK).model_copy(
        update={"probing": ONE_LANE.model_copy(update={"enabled": True})}
    )
    slam = TactileSlam(SlamSettings(), seed=1)
    roles = autonomous_roles(world, slam, settings, seed=3)  # type: ignore[arg-type]
    return Conductor(world, settings, roles).run()  # type: ignore[arg-type]


def test_a_session_begins_with_the_box_and_the_first_grasp_has_its_contacts() -> None:
    world = DiscWorld(Disc(np.array([0.005, 0.0]), radius_m=0.035))
    outcome = run(world)
    assert outcome.ending is Ending.COMPLETE
    assert world.log_lines[0][1].startswith("bounding box")
    assert sum(contact.probed for contact in outcome.grasps[0].contacts) >= 6


def test_a_session_without_an_object_ends_after_the_box_with_its_reason() -> None:
    outcome = run(DiscWorld(None))
    assert outcome.ending is Ending.OBJECT_LOST
    assert outcome.reason.startswith("no object was found where it is expected")
    assert outcome.grasps == ()
