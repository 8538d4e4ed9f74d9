"""What the hand does to weigh an object, and when it sets it down early."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.weighing import Grip, LiftEnd, Weigher, WeighingSettings

ALL = frozenset({"FF", "MF", "TH"})


class RecordingMotion:
    """Keeps the heights and what is told to the runtime."""

    def __init__(self, held_N=3.0):
        told = self.told = []
        names = ("begin_hold", "begin_dragging", "end_dragging", "begin_hanging", "end_hanging")
        verbs = {name: lambda name=name: told.append(name) for name in names}
        self.runtime = SimpleNamespace(perception=SimpleNamespace(held_N=lambda: held_N), **verbs)
        self.heights_m = []

    def base_joints(self, frame, closing, above_m=0.0):
        return np.array([frame.x_m, frame.y_m, above_m])

    def cycles(self, duration_s):
        return max(1, round(duration_s / 0.01))

    def tick(self):
        pass

    def follow(self, pose_at, duration_s, each):
        made = 0.0
        for step in range(1, self.cycles(duration_s) + 1):
            if not each():
                break
            made = step / self.cycles(duration_s)
            self.heights_m.append(pose_at(made)[2])
        return made


def weigh(motion, holding=lambda: ALL, is_pressed=lambda: False):
    grip = Grip(lambda force_N: None, holding, is_pressed)
    return Weigher(motion, WeighingSettings(), grip).weigh(GraspFrame(0.0, 0.0, 0.3), None)


def test_an_object_is_dragged_lifted_and_set_down():
    motion = RecordingMotion()
    assert weigh(motion) is LiftEnd.HUNG
    assert motion.told == ["begin_hold", "begin_dragging", "end_dragging", "begin_hanging", "end_hanging"]
    assert max(motion.heights_m) == pytest.approx(WeighingSettings().lift_m)
    assert motion.heights_m[-1] == pytest.approx(0.0)


def test_one_that_is_too_heavy_is_lifted_no_further():
    motion = RecordingMotion(held_N=20.0)
    assert weigh(motion) is LiftEnd.HEAVY
    assert "begin_hanging" not in motion.told
    assert max(motion.heights_m) < 0.001


def test_one_that_slips_out_is_let_down_and_not_weighed():
    motion = RecordingMotion()
    end = weigh(motion, holding=lambda: ALL if len(motion.heights_m) < 60 else frozenset({"TH"}))
    assert end is LiftEnd.LOST
    assert "end_hanging" not in motion.told
    assert motion.heights_m[-1] == pytest.approx(0.0)


def test_a_single_jerk_ends_nothing():
    jerks = iter([True, True] + [False] * 1000)
    assert weigh(RecordingMotion(), is_pressed=lambda: next(jerks)) is LiftEnd.HUNG


def test_a_fingertip_that_stays_pressed_ends_it():
    assert weigh(RecordingMotion(), is_pressed=lambda: True) is LiftEnd.PRESSED
