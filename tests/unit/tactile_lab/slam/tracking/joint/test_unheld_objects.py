"""Objects that the hand does not carry between grasps, followed by the whole method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.poses import planar
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.planar_hand import PlanarHand
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.joint import deferred_association

PALMS = [Pose2(0.0, 0.0, float(yaw)) for yaw in np.deg2rad([0, 60, -60, 30, -30, 90, 15, 75])]
MOTION = {"translation_m": 0.007, "rotation_rad": 0.21, "unheld": 0.15}
PUSHED_AT = 3


@pytest.mark.parametrize("turn_deg", [13.0, *(pytest.param(turn, marks=pytest.mark.long) for turn in (0.0, -18.0))])
def test_an_object_that_a_closing_hand_turned_is_followed(turn_deg: float) -> None:
    """Nothing carries it; it lies still but for one grasp, in which the fingers turn it."""
    hand = PlanarHand(OUTLINES_m["rectangle"], np.random.default_rng(4))
    slam = TactileSlam(SlamSettings.model_validate({"method": "joint", "dimension": 2, "motion": MOTION}), seed=4)
    where, errors_deg = Pose2(0.004, -0.003, 0.2), []
    for index, palm in enumerate(PALMS):
        if index == PUSHED_AT:
            where = where.compose(Pose2(0.006, 0.002, float(np.deg2rad(turn_deg))))
        step = slam.add_grasp(hand.grasp(index, palm, where))
        assert step.verdict in ("first", "tracked"), (index, step.reason)
        assert slam.world_T_object is not None
        errors_deg.append(np.rad2deg(planar(slam.world_T_object).rotation().theta() - where.rotation().theta()))
    assert not slam.is_lost
    assert np.ptp(np.unwrap(errors_deg, period=360)) < 6


@pytest.mark.parametrize(
    ("unheld", "turn_deg", "is_asked"), [(0.15, 0.0, False), (0.15, 15.0, True), (1.0, 15.0, False)]
)
def test_a_push_is_looked_for_only_where_a_grasp_on_an_object_left_lying_fits_badly(
    monkeypatch: pytest.MonkeyPatch, unheld: float, turn_deg: float, is_asked: bool
) -> None:
    hand = PlanarHand(OUTLINES_m["rectangle"], np.random.default_rng(4))
    motion = MOTION | {"unheld": unheld}
    slam = TactileSlam(SlamSettings.model_validate({"method": "joint", "dimension": 2, "motion": motion}), seed=4)
    for index, palm in enumerate(PALMS[:3]):
        slam.add_grasp(hand.grasp(index, palm, Pose2()))
    asked, propose = [], deferred_association.propose
    monkeypatch.setattr(deferred_association, "propose", lambda *given: asked.append(given) or propose(*given))
    slam.add_grasp(hand.grasp(3, PALMS[3], Pose2(0.006, 0.002, float(np.deg2rad(turn_deg)))))
    assert bool(asked) is is_asked


def test_pushes_stay_with_their_steps_when_a_session_is_read_backwards() -> None:
    """What came before a grasp came after it then, and what moved freely here did so."""
    none = np.empty((0, 2))
    contacts = ContactSet(none, none, np.empty(0), np.empty(0))
    grasp = PlacedGrasp(contacts, np.zeros(3), np.eye(3), np.zeros(3))
    ahead = ContactMap((grasp, grasp, replace(grasp, moved=Moved.FREELY), grasp), GpisSettings())
    pushed_between_1_and_0 = ContactMap((grasp, grasp, grasp, replace(grasp, moved=Moved.PUSHED)), GpisSettings())
    assert ahead.reread(pushed_between_1_and_0).moved == (
        Moved.AS_MEANT,
        Moved.PUSHED,
        Moved.FREELY,
        Moved.AS_MEANT,
    )
