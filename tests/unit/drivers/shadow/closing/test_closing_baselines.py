"""How hands close, in numbers: palms, lines of the fingertips, postures, bodies of the links, small moves."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.closing import CLOSINGS, Closing, closing, motor_targets
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import HandShape, moved_joints
from drivers.shadow.closing.tip_motion import motor_rates
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.motors import DRIVEN_JOINTS
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

HEIGHT_m = 0.034
NARROW = HandForm("right", tuple(name for name in DRIVEN_JOINTS if not name.startswith(("LF", "WR"))))


def told(table: Closing) -> dict[str, object]:
    """What a closing says of itself; its postures at four places of each line."""
    postures = {f: [table.angles_rad(f, u) for u in (0.0, 0.31, 0.62, 1.0)] for f in table.fingers}
    return {
        "palm": plain(table.grasp_T_palm),
        "radius": table.radius_m,
        "approach": table.approach,
        "sideways": table.is_sideways,
        "lines": plain(dict(table.paths)),
        "postures": postures,
        "motors": {f: motor_targets(table.angles_rad(f, 0.4)) for f in table.fingers},
    }


@pytest.mark.parametrize("name", sorted(CLOSINGS))
def test_closings_of_a_right_hand(name: str) -> None:
    table = closing(name, HEIGHT_m, HandShape())
    assert_baseline(f"closing/{name}", told(table), rtol=1e-4, atol=1e-3)


def test_closings_of_other_hands() -> None:
    left = told(closing("radial-from-left", HEIGHT_m, HandShape(form=HandForm("left"))))
    narrow = told(closing("radial", HEIGHT_m, HandShape(form=NARROW)))
    assert_baseline("closing/other_hands", {"left": left, "narrow": narrow}, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("side", ["right", "left"])
def test_bodies_of_the_links_and_of_the_open_hand(side: str) -> None:
    hand = HandShape(form=HandForm(side))
    links, envelope = link_balls("pinch", HEIGHT_m, hand), open_hand("pinch", HEIGHT_m, hand)
    near = np.abs(links.centres_m[:, :, 1]) - 0.02
    free = np.ones((len(links.centres_m), 5), bool)
    found = {
        "centres": [links.centres_m[node] for node in (0, 7)],
        "radii": links.radii_m,
        "fingers": links.fingers,
        "usable": links.usable.sum(axis=0),
        "collides": [links.collides(near + off, free) for off in (-0.01, 0.0, 0.01, 0.03)],
        "open": [envelope.centres_m, envelope.radii_m, envelope.lowest_m],
    }
    assert_baseline(f"closing/bodies_{side}", found, rtol=1e-4, atol=1e-4)


def test_how_motors_turn_for_small_moves_of_the_fingertips() -> None:
    hand = HandShape()
    table = closing("pinch", HEIGHT_m, hand)
    ways = {
        name: motor_rates(table, dict.fromkeys(FINGERS, 0.5), np.array(way), hand)
        for name, way in {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}.items()
    }
    moved = {form.side: [moved_joints(f, form) for f in form.fingers] for form in (HandForm("right"), NARROW)}
    assert_baseline("closing/rates", {"rates": ways, "moved": moved}, rtol=1e-3, atol=1e-2)
