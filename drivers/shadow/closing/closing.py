"""Closing paths of the hand: where each fingertip starts, where it ends, and the joint angles in between.

A closing is described in the *grasp frame*: origin on the table below the middle of the grasp, z up, the four fingers
on the +x side and the thumb on the -x side, the first finger towards +y. Every fingertip's centre runs along a
straight line, horizontal where the hand is upright; the palm stands still above. A left hand closes as the mirror
image in the frame's x-z plane: its first finger is towards -y. The whole grasp is then three numbers (x, y, yaw of the
grasp frame in the world) and one progress ``u`` in 0..1 for each finger, so that a contact is
predicted by intersecting a line with a surface.

The postures are solved once for each closing and height (:mod:`drivers.shadow.closing.posture`, a fraction of a second)
and kept in memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.posture import LONG_FINGERS, NODES, HandShape, moved_joints, solve_postures
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm

Point = tuple[float, float]

LOWEST_m, HIGHEST_m = 0.015, 0.12
"""Heights of the fingertips' centres above the table at which the hand can work from above."""

HIGHEST_SIDEWAYS_m = 0.25
"""The same where the palm is upright: as tall as objects may be."""


@dataclass(frozen=True)
class TipPath:
    """The straight line of one fingertip's centre, in the grasp frame.

    Attributes:
        start_m: open end, shape (3,).
        end_m: closed end, shape (3,).
        valid: smallest and largest progress ``u`` that the hand can take up with the tip on the line.
    """

    start_m: Array
    end_m: Array
    valid: tuple[float, float]

    @property
    def length_m(self) -> float:
        """Distance from start to end."""
        return float(np.linalg.norm(self.end_m - self.start_m))

    @property
    def direction(self) -> Array:
        """Unit direction of closing, shape (3,)."""
        return np.asarray((self.end_m - self.start_m) / self.length_m)

    def centre_m(self, u: float) -> Array:
        """Centre of the tip at progress ``u``, shape (3,)."""
        return np.asarray(self.start_m + u * (self.end_m - self.start_m))


@dataclass(frozen=True)
class Closing:
    """One way to close the hand at one height.

    Attributes:
        name: one of :data:`CLOSINGS`.
        height_m: height of the fingertip centres above the table; where the hand leans, of the lowest one.
        radius_m: of the fingertips, across the finger.
        grasp_T_palm: the palm in the grasp frame, wrist straight.
        paths: each finger's line.
        tables: each finger's joint angles along its line, shape (NODES, joints of the finger), radians, in the order
            of :func:`moved_joints`.
        approach: unit direction in which the open hand comes to the grasp, grasp frame.
        form: of the hand.
    """

    name: str
    height_m: float
    radius_m: float
    grasp_T_palm: Pose3
    paths: Mapping[str, TipPath]
    tables: Mapping[str, Array]
    approach: tuple[float, float, float] = (0.0, 0.0, -1.0)
    form: HandForm = RIGHT_HAND

    @property
    def fingers(self) -> tuple[str, ...]:
        """The fingers that close, in the order of :data:`~drivers.core.contacts.FINGERS`."""
        return self.form.fingers

    @property
    def is_sideways(self) -> bool:
        """Whether the hand comes from the side, its palm upright."""
        return self.approach[2] == 0.0

    def path(self, finger: str) -> TipPath:
        """The line of one finger's tip centre in the grasp frame, with its valid range."""
        return self.paths[finger]

    def angles_rad(self, finger: str, u: float) -> dict[str, float]:
        """Joint angles of one finger at progress ``u``, clipped to the valid range."""
        low, high = self.paths[finger].valid
        position = min(max(u, low), high) * (NODES - 1)
        index = min(int(position), NODES - 2)
        fraction = position - index
        table = self.tables[finger]
        row = (1 - fraction) * table[index] + fraction * table[index + 1]
        return dict(zip(moved_joints(finger, self.form), row.tolist(), strict=True))

    def joints(self, finger: str, u: float) -> dict[str, float]:
        """Targets of one finger's motors at progress ``u``: the coupled distal pair as J0 = J1 + J2, radians."""
        return motor_targets(self.angles_rad(finger, u))


@dataclass(frozen=True)
class Preshape:
    """Start and end of the fingertip centres in the grasp frame's x, y, metres."""

    starts_m: Mapping[str, Point]
    ends_m: Mapping[str, Point]


PRESHAPES: Mapping[str, Preshape] = {
    "pinch": Preshape(
        starts_m={
            "FF": (0.078, 0.034),
            "MF": (0.078, 0.011),
            "RF": (0.078, -0.011),
            "LF": (0.078, -0.036),
            "TH": (-0.070, 0.020),
        },
        ends_m={
            "FF": (-0.010, 0.030),
            "MF": (-0.010, 0.010),
            "RF": (-0.010, -0.010),
            "LF": (-0.010, -0.030),
            "TH": (0.004, 0.010),
        },
    ),
    "radial": Preshape(
        starts_m={
            "FF": (0.060, 0.056),
            "MF": (0.080, 0.013),
            "RF": (0.078, -0.015),
            "LF": (0.050, -0.060),
            "TH": (-0.070, 0.024),
        },
        ends_m={
            "FF": (0.012, 0.014),
            "MF": (-0.010, 0.008),
            "RF": (-0.010, -0.012),
            "LF": (0.010, -0.016),
            "TH": (0.004, 0.006),
        },
    ),
}
"""The closings: four parallel fingers against the thumb, and first and little finger coming in from the sides."""


NARROW_PRESHAPES: Mapping[str, Preshape] = {
    "pinch": Preshape(
        starts_m={finger: (x, y - 0.010) for finger, (x, y) in PRESHAPES["pinch"].starts_m.items()},
        ends_m={finger: (x, y - 0.010) for finger, (x, y) in PRESHAPES["pinch"].ends_m.items()},
    ),
    "radial": Preshape(
        starts_m={**PRESHAPES["radial"].starts_m, "RF": (0.062, -0.042)},
        ends_m={**PRESHAPES["radial"].ends_m, "RF": (0.012, -0.014)},
    ),
}
"""The same for hands without a little finger: the others stand about the middle, and the ring finger comes in from the
side in its place."""


def preshape_of(name: str, form: HandForm) -> Preshape:
    """The lines of an upright closing's fingertips."""
    return (PRESHAPES if "LF" in form.fingers else NARROW_PRESHAPES)[name]


@dataclass(frozen=True)
class Leaning:
    """A hand that comes from the side: an upright closing turned about the grasp frame's x axis, first finger down.

    Attributes:
        upright: a key of :data:`PRESHAPES`.
        height_m: of that closing; its postures are those of a low grasp, however high the leaning hand stands.
        lean_rad: how far it is turned.
    """

    upright: str
    height_m: float
    lean_rad: float


LEANING: Mapping[str, Leaning] = {"aside": Leaning("pinch", 0.028, float(np.deg2rad(25.0)))}
"""Closings with the fingers one above the other. A lean of 40 degrees brings the fingers so far above the thumb that
they tip a box over by 6 degrees where the hand comes straight down, one of 25 degrees leaves it standing."""

_LOW_m = {"pinch": 0.028, "radial": 0.022}  # postures of low grasps: the palm is as far from the fingertips in all

SIDEWAYS: Mapping[str, Leaning] = {
    f"{upright}-from-{side}": Leaning(upright, height_m, lean_rad)
    for upright, height_m in _LOW_m.items()
    for side, lean_rad in (("left", np.pi / 2), ("right", -np.pi / 2))
}
"""Closings of a right hand with the palm upright, the fingertips one above the other. The hand comes along the grasp
frame's -y axis from its left, first finger down, or along +y from its right, first finger up (decision 45). The
forearm, 100 mm thick, keeps the lowest fingertip at 18 mm with the first finger down and at 30 mm with it up."""

SIDES = ("left", "right")
"""Where the palm may stand in a closing of :data:`SIDEWAYS`, seen along the grasp frame's x axis."""

CLOSINGS = frozenset({*PRESHAPES, *LEANING, *SIDEWAYS})
"""Names of all closings."""


def sideways(upright: str, side: str) -> str:
    """The name of an upright closing taken from the left or the right."""
    return f"{upright}-from-{side}"


def side_with_first_finger_down(form: HandForm) -> str:
    """From which of :data:`SIDES` the hand comes lowest."""
    return "right" if form.is_left else "left"


def mirrored_closing(name: str) -> str:
    """The closing of the other hand whose mirror image has that name; left and right are exchanged."""
    upright, found, side = name.rpartition("-from-")
    return sideways(upright, SIDES[1 - SIDES.index(side)]) if found else name


MIRROR = np.array([1.0, -1.0, 1.0])
"""What mirrors places in the grasp frame's x-z plane, one hand's into the other's."""


@lru_cache(maxsize=64)
def closing(name: str, height_m: float, hand: HandShape | None = None) -> Closing:
    """The closing path table of one preshape at one height of the fingertip centres; kept in memory.

    Where the hand leans it is the height of the lowest fingertip's centre.

    Args:
        name: one of :data:`CLOSINGS`.
        height_m: see above.
        hand: that closes; the right one with five usual fingertips unless given.

    Raises:
        ConfigurationError: no such closing, or a height the hand cannot work at.
    """
    if name not in CLOSINGS:
        raise ConfigurationError(f"there is no closing {name!r}", hint=f"Choose from {', '.join(sorted(CLOSINGS))}")
    highest_m = HIGHEST_SIDEWAYS_m if name in SIDEWAYS else HIGHEST_m
    if not LOWEST_m <= height_m <= highest_m:
        allowed = f"{LOWEST_m * 1e3:.0f} to {highest_m * 1e3:.0f} mm"
        raise ConfigurationError(
            f"contact height {height_m * 1e3:.0f} mm is outside {allowed}", hint="Choose a height in that range"
        )
    hand = hand or HandShape()
    if hand.form.is_left:
        return mirrored(name, closing(mirrored_closing(name), height_m, hand.mirrored))
    if name in LEANING:
        return _leaning(name, LEANING[name], height_m, hand)
    if name in SIDEWAYS:
        side = 1.0 if SIDEWAYS[name].lean_rad > 0.0 else -1.0
        return replace(_leaning(name, SIDEWAYS[name], height_m, hand), approach=(0.0, -side, 0.0))
    return _upright(name, height_m, hand)


def _upright(name: str, height_m: float, hand: HandShape) -> Closing:
    fingers, preshape = hand.form.fingers, preshape_of(name, hand.form)
    starts_m, ends_m = (
        np.array([(*points[finger], height_m) for finger in fingers]) for points in (preshape.starts_m, preshape.ends_m)
    )
    postures = solve_postures(starts_m, ends_m, hand)
    paths = {
        finger: TipPath(starts_m[index], ends_m[index], postures.valid[finger]) for index, finger in enumerate(fingers)
    }
    return Closing(name, height_m, hand.radius_m, postures.grasp_T_palm, paths, postures.tables_rad, form=hand.form)


def mirrored(name: str, table: Closing) -> Closing:
    """A right hand's closing as the left hand does it."""
    x, y, z = table.approach
    turn, place = table.grasp_T_palm.rotation().matrix(), table.grasp_T_palm.translation()
    grasp_T_palm = Pose3(Rot3(MIRROR[:, None] * turn * _PALM_MIRROR), MIRROR * place)
    paths = {f: TipPath(MIRROR * path.start_m, MIRROR * path.end_m, path.valid) for f, path in table.paths.items()}
    form = table.form.mirrored
    return replace(table, name=name, grasp_T_palm=grasp_T_palm, paths=paths, approach=(x, -y, z), form=form)


_PALM_MIRROR = np.array([-1.0, 1.0, 1.0])  # a left palm is the mirror image in x = 0 of its own frame


def _leaning(name: str, leaning: Leaning, height_m: float, hand: HandShape) -> Closing:
    upright = closing(leaning.upright, leaning.height_m, hand)
    turn, middle_m = Rot3.Rx(-leaning.lean_rad), np.array([0.0, 0.0, upright.height_m])
    lowest_m = min(float(turn.rotate(path.start_m - middle_m)[2]) for path in upright.paths.values())
    lean = Pose3(turn, np.array([0.0, 0.0, height_m - lowest_m]) - turn.rotate(middle_m))
    paths = {
        finger: TipPath(lean.transformFrom(path.start_m), lean.transformFrom(path.end_m), path.valid)
        for finger, path in upright.paths.items()
    }
    return replace(upright, name=name, height_m=height_m, grasp_T_palm=lean * upright.grasp_T_palm, paths=paths)


_COUPLED = {f"{finger}{joint}": f"{finger}J0" for finger in LONG_FINGERS for joint in ("J1", "J2")}


def motor_targets(angles_rad: Mapping[str, float]) -> dict[str, float]:
    """Joint angles as motor targets: J1 and J2 of the four fingers share the tendon J0."""
    targets: dict[str, float] = {}
    for name, angle in angles_rad.items():
        motor = _COUPLED.get(name, name)
        targets[motor] = targets.get(motor, 0.0) + angle
    return targets
