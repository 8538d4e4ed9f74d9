"""What is done and told between a capture and the hand's opening."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.contacts import StepSigma
from sessions.conductor.carrier import Carrier
from sessions.conductor.estimator import Reorientation
from sessions.motion.lift import Lift, LiftEnd
from sessions.perception.carrying.forecast import Forecast
from sessions.perception.carrying.slip import Slip
from sessions.perception.carrying.vibration import HeardSlip
from sessions.perception.hand_odometry import HandMotion
from sessions.recording.recorder import Level

TURN, STAY = Reorientation(0.4, np.zeros(2)), Reorientation(0.0, np.zeros(2))
HELD = frozenset({"FF", "MF", "TH"})
FIRM = Forecast(force_N=1.2, slip_m=0.001, slip_rad=0.01, leans=False)
FELT = HandMotion(Pose3(Rot3(), np.array([0.01, 0.0, 0.0])), StepSigma(0.0004, 0.01))
SLIPPERY = Forecast(force_N=1.5, slip_m=0.012, slip_rad=0.2, leans=True)


class Bench:
    """A carrier with roles that only note what is asked of them."""

    def __init__(
        self,
        forecast=FIRM,
        touching=HELD,
        may_weigh=True,
        carry=None,
        jammed=(),
        can_weigh=True,
        end=LiftEnd.HUNG,
        slipped=None,
        heard=None,
        hung_free=False,
        allowed_N=2.0,
    ):
        self.done, self.told, self.logged, self.motions = [], [], [], []
        cycle = SimpleNamespace(
            plan=None,
            jammed=jammed,
            slipped=slipped,
            squeeze=lambda touching: self.done.append("squeeze"),
            reorient=lambda turn, shift, touching: self.done.append("re-orient") or Pose3(),
        )
        decisions = SimpleNamespace(may_weigh=lambda plan: may_weigh, on_carry=self.motions.append)
        roles = SimpleNamespace(
            supervisor=SimpleNamespace(count_contacts=lambda count: None),
            performer=cycle,
            decisions=decisions,
            weigh=(lambda touching: self.done.append("weigh") or Lift(end, 2.6, 0.8, allowed_N)) if can_weigh else None,
            forecast=lambda grasp, turn, shift: self.done.append("forecast") or forecast,
        )
        properties = SimpleNamespace(in_words=lambda: "mass 300 g", hung_free=hung_free)
        runtime = SimpleNamespace(
            perception=SimpleNamespace(carry=carry, heard_slip=heard, properties=properties, hand_motion=FELT),
            log=lambda level, source, text: self.logged.append(text),
        )
        self.grasp = SimpleNamespace(touching=touching, contacts=())
        self.carrier = Carrier(runtime, roles, self.done.append, lambda level, text: self.told.append((level, text)))

    def carry(self, wanted=TURN, weighed=False, last=False):
        self.carrier.carry(self.grasp, wanted, weighed=weighed, last=last)
        return self


def test_a_carry_is_foretold_before_the_squeeze():
    bench = Bench().carry()
    assert bench.done == ["forecast", "squeeze", "squeeze", "re-orient", "re-orient"]
    assert bench.told == []
    assert bench.logged == ["each finger holds the object with 1.20 N"]


def test_what_will_slip_or_tip_is_told():
    (told,) = Bench(SLIPPERY).carry().told
    assert told[0] is Level.WARNING
    assert "will slip by about 12 mm, 11 degrees" in told[1]
    assert "would tip over" in told[1]


def test_nothing_is_said_of_an_object_that_was_not_measured():
    bench = Bench(forecast=None).carry()
    assert bench.logged == bench.told == []
    assert "re-orient" in bench.done


@pytest.mark.parametrize(
    ("wanted", "touching", "last"), [(STAY, HELD, False), (TURN, frozenset({"MF"}), False), (TURN, HELD, True)]
)
def test_what_stays_is_neither_foretold_nor_squeezed(wanted, touching, last):
    bench = Bench(touching=touching).carry(wanted, last=last)
    assert bench.done == []
    assert [motion.world.equals(Pose3(), 1e-12) for motion in bench.motions] == [True]


def test_it_is_weighed_before_it_is_carried_unless_a_person_objects():
    assert Bench().carry(weighed=True).done[:3] == ["weigh", "weigh", "forecast"]
    refused = Bench(may_weigh=False).carry(weighed=True)
    assert "weigh" not in refused.done
    assert refused.told == [(Level.INFO, "the object is not weighed")]


def test_what_has_been_weighed_is_not_weighed_again_and_nobody_is_asked():
    bench = Bench(hung_free=True, may_weigh=False).carry(weighed=True)
    assert bench.done == ["forecast", "squeeze", "squeeze", "re-orient", "re-orient"]
    assert bench.told == []


@pytest.mark.parametrize("may_weigh", [False, True])
def test_a_session_that_cannot_weigh_carries_all_the_same_and_asks_nobody(may_weigh):
    bench = Bench(can_weigh=False, may_weigh=may_weigh).carry(weighed=True)
    assert bench.done == ["forecast", "squeeze", "squeeze", "re-orient", "re-orient"]
    assert bench.told == []


@pytest.mark.parametrize(("remarkable", "told"), [(True, [(Level.WARNING, "the object slipped by 9 mm")]), (False, [])])
def test_how_the_object_moved_is_what_the_fingertips_felt(remarkable, told):
    carry = SimpleNamespace(is_remarkable=remarkable, in_words=lambda: "slipped by 9 mm")
    bench = Bench(carry=carry).carry()
    assert bench.told == told
    assert ("the object slipped by 9 mm" in bench.logged) is not remarkable
    assert bench.motions == [FELT]


def test_a_slip_that_was_heard_is_logged_and_the_object_moved_with_the_palm():
    bench = Bench(heard=HeardSlip(("FF", "TH"), 0.8)).carry()
    assert bench.logged[-1] == "the object slips under FF and TH, for 0.8 s"
    assert [motion.world.equals(Pose3(), 1e-12) for motion in bench.motions] == [True]


def test_a_re_orientation_that_fingers_stopped_is_told():
    (told,) = Bench(jammed=("FF", "TH")).carry().told
    assert told == (Level.WARNING, "FF, TH pressed hard: re-orientation stopped early")


def test_what_is_not_held_any_more_when_it_was_weighed_is_not_carried():
    assert "squeeze" not in Bench(end=LiftEnd.LOST).carry(weighed=True).done
    assert "squeeze" not in Bench(end=LiftEnd.ABOVE).carry(weighed=True).done
    assert "squeeze" in Bench(end=LiftEnd.HELD).carry(weighed=True).done


def test_a_slip_that_ended_the_carry_is_told():
    ((level, words),) = Bench(slipped=Slip(0.0042, 0.05)).carry().told
    assert level is Level.INFO
    assert words == "the object slips (4 mm, 3 degrees): re-orientation stopped early"


def test_a_weighing_says_how_it_ended_and_what_it_found():
    ((level, words),) = Bench().carry(weighed=True).told
    assert level is Level.INFO
    assert words == f"weighed: {LiftEnd.HUNG}; mass 300 g"


def test_what_was_too_heavy_twice_is_lifted_no_more_and_carried_all_the_same():
    bench = Bench(end=LiftEnd.LOST, allowed_N=0.9)
    for _ in range(3):
        bench.carry(weighed=True)
    assert bench.done.count("weigh") == 2 * 2  # told as a phase, and done
    assert bench.done[-1] == "re-orient"
    assert [level for level, _ in bench.told] == [Level.INFO, Level.INFO, Level.WARNING]
    assert "at least 1.00 N needed, at most 0.90 N allowed" in bench.told[0][1]


def test_what_slips_but_may_be_held_more_firmly_is_lifted_again():
    bench = Bench(end=LiftEnd.LOST, allowed_N=2.0)
    for _ in range(3):
        bench.carry(weighed=True)
    assert bench.done.count("weigh") == 3 * 2
