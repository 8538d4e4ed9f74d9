"""Fingers pressed hard or held up: the hand gives way and goes on, where pressing on would end the session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.kinematics import JOINT_INDEX
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.grasp_fingers import CLEAR_m
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySettings, SafetySupervisor
from tests.support.disc_world import Disc, DiscWorld, TIP_CENTRE_m

TIP = HandShape((0.0085, 0.0085, 0.0085), tuple(TIP_CENTRE_m))
QUICK = CycleSettings(finger_rad_s=20.0, travel_m_s=1.0, turn_rad_s=5.0)
PLAN = GraspPlan(GraspFrame(0.0, 0.0, 0.3), "pinch", 0.022)
TURN_rad = 0.4


class Strain:
    """A world, a grasp in it, and forces and bends on fingers that the world itself knows nothing of."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.world = DiscWorld(Disc(np.zeros(2)))
        supervisor = SafetySupervisor(self.world, SafetySettings(), self.world.cycle_ns)
        supervisor.on_approach()
        self.motion = Motion(self.world, supervisor)  # type: ignore[arg-type]
        self.cycle = GraspCycle(self.motion, QUICK, TIP)
        self.extra_N: dict[str, float] = {}
        self.held_rad: dict[str, float] = {}
        felt, joints = self.motion.loads_N, self.motion._fingers._measured_rad

        def loads_N() -> dict[str, float]:
            return {finger: load_N + self.extra_N.get(finger, 0.0) for finger, load_N in felt().items()}

        def measured() -> dict[str, float]:
            found = joints()
            return found | {name: found[name] + off for name, off in self.held_rad.items()}

        monkeypatch.setattr(self.motion, "loads_N", loads_N)
        monkeypatch.setattr(self.motion._fingers, "_measured_rad", measured)

    def grasp(self) -> frozenset[str]:
        """Down, closed, settled and captured: the fingers that touch."""
        assert self.cycle.descend(PLAN)
        self.cycle.close()
        self.cycle.settle()
        return self.cycle.capture().touching


@pytest.fixture
def strain(monkeypatch: pytest.MonkeyPatch) -> Strain:
    return Strain(monkeypatch)


def ways(cycle: GraspCycle) -> Mapping[str, float]:
    return dict(cycle.fingers.progress)


def test_a_finger_bent_on_the_way_down_has_landed(strain: Strain) -> None:
    """Its fingertip may hang beside the object while a transport above stands on it."""
    bent_at_m = 0.03

    def bend(world: DiscWorld) -> None:
        low = world.base_q[2] < strain.motion.base_joints(PLAN.frame, strain.cycle._table(), bent_at_m)[2]
        first = not strain.cycle.landings_world_m
        strain.held_rad = {"RFJ3": 0.2} if low and first else {}

    strain.cycle._plan = PLAN
    strain.world.before_cycle = bend
    strain.world.disc = None
    assert strain.cycle.descend(PLAN)
    assert len(strain.cycle.landings_world_m) == 1
    aside_m = np.linalg.norm(
        [strain.cycle.plan.frame.x_m - PLAN.frame.x_m, strain.cycle.plan.frame.y_m - PLAN.frame.y_m]
    )
    assert aside_m == pytest.approx(QUICK.landing_shift_m, rel=1e-6)


def test_a_finger_that_is_held_up_closes_no_farther_and_the_others_do(strain: Strain) -> None:
    assert strain.cycle.descend(PLAN)
    opened = ways(strain.cycle)
    strain.held_rad = {"MFJ0": 0.3}
    strain.cycle.close()
    closed = ways(strain.cycle)
    assert closed["MF"] == opened["MF"]
    assert all(closed[finger] > opened[finger] for finger in FINGERS if finger != "MF")
    assert "MF" not in strain.cycle.fingers.touching


def test_fingers_that_stay_open_do_not_close_and_the_others_do(strain: Strain) -> None:
    assert strain.cycle.descend(replace(PLAN, stays_open=frozenset({"LF", "MF"})))
    opened = ways(strain.cycle)
    strain.cycle.close()
    closed = ways(strain.cycle)
    assert {finger for finger in FINGERS if closed[finger] == opened[finger]} == {"LF", "MF"}
    assert strain.cycle.fingers.touching == frozenset(FINGERS) - {"LF", "MF"}


def test_all_fingers_stop_closing_where_one_is_pressed_hard(strain: Strain) -> None:
    assert strain.cycle.descend(PLAN)
    opened = ways(strain.cycle)
    strain.extra_N = {"TH": QUICK.closing_most_N + 0.1}
    strain.cycle.close()
    assert ways(strain.cycle) == opened


def test_a_jammed_object_is_carried_no_farther_and_let_go_there(strain: Strain) -> None:
    touching = strain.grasp()
    start = strain.cycle.plan.frame
    strain.extra_N = {"LF": 20.0}
    motion = strain.cycle.reorient(TURN_rad, np.array([0.02, 0.0]), touching)
    assert strain.cycle.jammed == ("LF",)
    assert abs(motion.rotation().yaw()) < 0.1 * TURN_rad
    assert strain.cycle.plan.frame.yaw_rad - start.yaw_rad == pytest.approx(motion.rotation().yaw(), abs=1e-6)
    strain.extra_N = {}
    strain.cycle.reorient(TURN_rad, np.zeros(2), touching)
    assert strain.cycle.jammed == ()
    assert strain.cycle.plan.frame.yaw_rad - start.yaw_rad == pytest.approx(
        TURN_rad + motion.rotation().yaw(), abs=1e-6
    )


def test_a_short_knock_does_not_break_a_re_orientation_off(strain: Strain) -> None:
    touching, start = strain.grasp(), strain.cycle.plan.frame
    cycles = 0

    def knock(world: DiscWorld) -> None:
        nonlocal cycles
        cycles += 1
        strain.extra_N = {"LF": 20.0} if cycles % 20 < QUICK.pressed_cycles else {}

    strain.world.before_cycle = knock
    strain.cycle.reorient(TURN_rad, np.zeros(2), touching)
    assert strain.cycle.jammed == ()
    assert strain.cycle.plan.frame.yaw_rad - start.yaw_rad == pytest.approx(TURN_rad)


def test_a_finger_that_nothing_is_asked_of_gives_way_when_pressed(strain: Strain) -> None:
    touching = strain.grasp() - {"TH"}
    before = ways(strain.cycle)
    strain.extra_N = {"TH": 20.0}
    strain.cycle.squeeze(touching)
    after = ways(strain.cycle)
    assert after["TH"] < before["TH"]
    assert all(after[finger] <= before[finger] for finger in touching)  # nothing adds to it


def test_a_finger_that_is_held_up_is_not_wound_up(strain: Strain) -> None:
    """A force that never comes would drive its target on and on, and the hand could not let go for as long."""
    touching = strain.grasp()
    strain.extra_N, strain.held_rad = {"TH": -5.0}, {"THJ5": 0.3}
    before = ways(strain.cycle)
    strain.cycle.squeeze(touching)
    assert ways(strain.cycle)["TH"] <= before["TH"]


def test_strained_fingers_are_freed_first(strain: Strain) -> None:
    strain.grasp()
    closed, steps = ways(strain.cycle), list[Mapping[str, float]]()
    strain.extra_N = {"TH": 20.0}

    def watch(world: DiscWorld) -> None:
        steps.append(ways(strain.cycle))
        if len(steps) == 3:
            strain.extra_N = {}

    strain.world.before_cycle = watch
    strain.cycle.release()
    waited = steps[2]
    assert waited["TH"] < closed["TH"]
    assert all(waited[finger] == closed[finger] for finger in FINGERS if finger != "TH")
    opened = {finger: strain.cycle._table().path(finger).valid[0] for finger in FINGERS}
    assert ways(strain.cycle) == pytest.approx(opened)


def test_a_finger_that_stays_strained_does_not_keep_the_hand_closed(strain: Strain) -> None:
    strain.grasp()
    strain.extra_N = {"TH": 20.0}
    strain.cycle.release()
    opened = {finger: strain.cycle._table().path(finger).valid[0] for finger in FINGERS}
    assert ways(strain.cycle) == pytest.approx(opened)


def while_it_opens(
    strain: Strain, *, begun_N: float = 0.0, loads_N: float = 0.0, bent_rad: float = 0.0, until: int = 6
) -> tuple[float, list[Mapping[str, float]]]:
    """How far the hand rises if the thumb is pressed or held up from the third cycle on, and where fingers are then."""
    strain.grasp()
    strain.extra_N, steps = {"TH": begun_N}, list[Mapping[str, float]]()

    def watch(world: DiscWorld) -> None:
        steps.append(ways(strain.cycle))
        now = 3 <= len(steps) < until
        strain.extra_N = {"TH": loads_N if now else begun_N}
        strain.held_rad = {"THJ5": bent_rad} if now else {}

    before_m = float(strain.world.base_q[2])
    strain.world.before_cycle = watch
    strain.cycle.release()
    return abs(float(strain.world.base_q[2]) - before_m), steps


@pytest.mark.parametrize("begun_N", [-5.0, 0.0, 1.0])
def test_a_hand_that_opens_rises_where_a_finger_comes_upon_the_object(strain: Strain, begun_N: float) -> None:
    """Whether that finger had lost it or held it."""
    assert while_it_opens(strain, begun_N=begun_N, loads_N=5.0)[0] == pytest.approx(CLEAR_m, abs=1e-3)


def test_it_rises_where_a_link_is_held_up_as_it_opens(strain: Strain) -> None:
    assert while_it_opens(strain, bent_rad=0.3, until=9_999)[0] == pytest.approx(CLEAR_m, abs=1e-3)


def test_a_finger_that_falls_behind_waits_until_it_has_followed(strain: Strain) -> None:
    """Its tip would dip, where its joints are unlike late."""
    risen_m, steps = while_it_opens(strain, bent_rad=0.3, until=15)
    assert risen_m == pytest.approx(0.0, abs=1e-6)
    assert len({step["TH"] for step in steps[3:14]}) == 1
    assert len({step["FF"] for step in steps[3:14]}) > 5
    opened = {finger: strain.cycle._table().path(finger).valid[0] for finger in FINGERS}
    assert ways(strain.cycle) == pytest.approx(opened)


def test_it_stays_where_a_finger_is_pressed_no_harder_than_when_it_held(strain: Strain) -> None:
    assert while_it_opens(strain, begun_N=4.5, loads_N=5.0, until=9_999)[0] == pytest.approx(0.0, abs=1e-6)


def test_it_rises_no_farther_than_a_fingertip_is_held_back(strain: Strain) -> None:
    """A hook under an edge: the force grows with every cycle upward."""
    strain.grasp()
    begun_m = float(strain.world.base_q[2])

    def watch(world: DiscWorld) -> None:
        strain.extra_N = {"TH": 5.0 + 3_000.0 * abs(float(world.base_q[2]) - begun_m)}

    strain.world.before_cycle = watch
    strain.cycle.fingers.rise()
    assert abs(float(strain.world.base_q[2]) - begun_m) < 0.001


def test_a_finger_in_the_way_of_the_object_opens_last(strain: Strain) -> None:
    _, steps = while_it_opens(strain, loads_N=5.0, until=9_999)
    opened = {finger: strain.cycle._table().path(finger).valid[0] for finger in FINGERS}
    waits = [step for step in steps[6:] if step["TH"] > opened["TH"] + 1e-6]
    others = [max(step[finger] - opened[finger] for finger in FINGERS if finger != "TH") for step in waits]
    assert others[-1] == pytest.approx(0.0, abs=1e-6)
    assert ways(strain.cycle) == pytest.approx(opened)


def test_a_strained_finger_opens_no_farther_than_its_neighbour_leaves_room(strain: Strain) -> None:
    """The middle finger, opened alone from a radial grasp, came to where the first finger was: its sensor saturated."""
    cycle, gaps_m = strain.cycle, list[float]()
    assert cycle.descend(GraspPlan(GraspFrame(0.0, 0.0, 0.3), "radial", 0.034))
    cycle.fingers.progress = dict.fromkeys(FINGERS, 0.97)
    strain.world.disc = None
    strain.extra_N = {"MF": 20.0}

    def watch(world: DiscWorld) -> None:
        centres = [cycle._table().path(finger).centre_m(cycle.fingers.progress[finger]) for finger in ("FF", "MF")]
        gaps_m.append(float(np.linalg.norm(centres[0] - centres[1])))

    strain.world.before_cycle = watch
    cycle.release()
    assert min(gaps_m) > 2 * TIP.radius_m - 0.001
    assert ways(cycle) == pytest.approx({finger: cycle._table().path(finger).valid[0] for finger in FINGERS})


def test_a_finger_closes_no_farther_than_to_its_neighbour(strain: Strain) -> None:
    """The middle finger has stopped early on something narrow; the first would close to the same place."""
    assert strain.cycle.descend(replace(PLAN, closing="radial"))
    strain.cycle.fingers.progress["MF"] = 0.73
    strain.held_rad = {"MFJ0": 0.3}
    strain.world.disc = None
    strain.cycle.close()
    first, middle = (strain.cycle._table().path(f).centre_m(ways(strain.cycle)[f]) for f in ("FF", "MF"))
    assert np.linalg.norm(first - middle) > 2 * TIP.radius_m - 0.001


def test_coupled_joints_are_compared_together(strain: Strain) -> None:
    assert strain.cycle.descend(PLAN)
    assert strain.motion.bent(0.01) == ()
    strain.world.joints_rad[JOINT_INDEX["FFJ1"]] += 0.05
    strain.world.joints_rad[JOINT_INDEX["FFJ2"]] -= 0.05
    strain.world.cycle()
    assert strain.motion.bent(0.01) == ()
    strain.world.joints_rad[JOINT_INDEX["FFJ1"]] += 0.05
    strain.world.cycle()
    assert strain.motion.bent(0.01) == ("FF",)


@pytest.mark.parametrize(("is_gentle", "force_N"), [(False, QUICK.contact_force_N), (True, QUICK.gentle_force_N)])
def test_what_leans_easily_is_held_with_less_force(
    is_gentle: bool, force_N: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycle, settled_N = Strain(monkeypatch).cycle, []
    monkeypatch.setattr(cycle.fingers, "settle", settled_N.append)
    cycle._begin(GraspPlan(GraspFrame(0.0, 0.0, 0.0), "pinch", 0.022, is_gentle=is_gentle))
    cycle.settle()
    assert settled_N == [force_N]
    assert QUICK.gentle_force_N < QUICK.contact_force_N
