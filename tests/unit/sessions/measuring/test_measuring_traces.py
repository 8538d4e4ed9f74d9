"""Calibration touches and wrenches taken in a world of discs, cycle by cycle, compared with before."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from calibration.fingertip.plan import PlannedFree, plan_wrenches
from calibration.forearm.touch_plan import PlannedTouch
from calibration.forearm.view_plan import PlannedView
from calibration.steps.geometry import Patch
from calibration.steps.observations import Plane
from drivers.force.force_fingertip import ForceTip
from drivers.shadow.closing.posture import HandShape
from sessions.measuring.calibration_measurer import CalibrationMeasurer
from sessions.measuring.fingertip_measurer import FingertipMeasurer, FingertipMeasurerSettings
from tests.support.baseline import assert_baseline
from tests.support.disc_world import Disc, DiscTip, TIP_CENTRE_m
from tests.support.motion_trace import TracedWorld
from tests.support.said import said

TIP = HandShape((0.0085, 0.0085, 0.0085), tuple(TIP_CENTRE_m))
HEIGHT_m = 0.06


class WeighingTip(DiscTip, ForceTip):
    """The disc's fingertip as a force sensor, whose readings drift with the time."""

    def __init__(self, finger: str, world: TracedWorld, every: int = 1) -> None:
        DiscTip.__init__(self, finger, world)
        self.every = every

    @property
    def newest(self) -> Any:
        now_ns = self._world.clock.now_ns() // (self.every * 10_000_000) * (self.every * 10_000_000)
        return SimpleNamespace(
            stamp_ns=now_ns, wrench=np.array([0.0, 0.1, self._world.load_N(self.finger), 1e-9 * now_ns, 0.0, 0.0])
        )


def touch(finger: str, x_m: float, lean_rad: float, height_m: float = HEIGHT_m) -> PlannedTouch:
    top = Plane("block top", np.array([0.0, 0.0, height_m]), np.array([0.0, 0.0, 1.0]), 1e-4)
    down = next(each for each in plan_wrenches(finger, 4) if isinstance(each, PlannedTouch)).world_R_distal
    place = np.array([x_m, 0.01, height_m])
    return PlannedTouch(finger, Patch(top, place, np.zeros((2, 3))), place, Rot3.Yaw(lean_rad).matrix() @ down)


def test_touches_of_a_face() -> None:
    """Found where they should be, lower, so low that the search ends, and without a valid contact."""
    world = TracedWorld(Disc(np.zeros(2), radius_m=0.3, height_m=HEIGHT_m))
    measurer = CalibrationMeasurer(world, Pose3(), {"FF": TIP, "MF": TIP})  # type: ignore[arg-type]
    told: dict[str, Any] = {}
    plans = {
        "first": touch("FF", 0.0, 0.0),
        "turned": touch("MF", 0.02, 0.4),
        "lower": touch("FF", 0.01, 0.0, HEIGHT_m + 0.015),
    }
    plans |= {"too low": touch("FF", 0.01, 0.0, HEIGHT_m + 0.05)}
    for name, planned in plans.items():
        world.part(name)
        found = said(lambda planned=planned: measurer.measure(planned))
        if isinstance(found, str):
            told[name] = found
        else:
            pose = found.pose
            told[name] = [
                found.finger,
                pose.base_q,
                pose.joints_rad.sum(),
                found.point_distal_m,
                found.normal_distal,
                found.force_N,
            ]
    world.perception.fingertips["FF"].contact = lambda rotation: None  # type: ignore[method-assign,assignment]
    told["no contact"] = said(lambda: measurer.measure(plans["first"]))
    told["no camera"] = said(lambda: measurer.measure(PlannedView(Pose3(), np.zeros(24))))
    world.part("close")
    measurer.close()
    told["scale"] = measurer.supervisor.speed_scale
    assert_baseline("sessions/measuring/touches", told | {"trace": world.summary()}, rtol=1e-5, atol=1e-8)


def test_wrenches_of_a_fingertip() -> None:
    """Free and pressed, with as many readings as are needed and with one less, and of a tip without a force sensor."""
    told: dict[str, Any] = {}
    for every in (1, 4, 5):
        world = TracedWorld(Disc(np.zeros(2), radius_m=0.3, height_m=0.0))
        tip = WeighingTip("FF", world, every)
        world.perception.fingertips["FF"] = tip
        settings = FingertipMeasurerSettings(capture_s=0.4, travel_m_s=0.5)
        measurer = FingertipMeasurer(world, Pose3(), {"FF": TIP}, settings)  # type: ignore[arg-type]
        for name, planned in {"free": PlannedFree("FF", 0.3, -0.2), "pressed": plan_wrenches("FF", 4)[-1]}.items():
            world.part(name)
            found = said(lambda planned=planned, measurer=measurer: measurer.measure(planned))
            told[f"{name}, every {every}"] = found if isinstance(found, str) else [vars(each) for each in found]
            if every > 1:
                break
        told[f"trace, every {every}"] = world.summary()
    told["other kind"] = said(lambda: measurer.measure(PlannedFree("MF", 0.3, -0.2)))
    assert_baseline("sessions/measuring/wrenches", told, rtol=1e-5, atol=1e-8)
