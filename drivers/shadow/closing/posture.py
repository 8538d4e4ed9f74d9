"""Postures of the hand with every fingertip's centre on a straight line above the table.

A small least-squares problem on the forward kinematics: fingertip centres on their lines, tips leaning inward (upright
tips touch with the middle phalanx first, which no force sensor sees), palm well above the object, the distal joint at
about 0.6 of the middle one as the coupled tendon shares its travel. First the palm is placed with the hand closed on an
object of typical width; then every point of the lines is solved from its neighbour's posture.

Frame: the grasp frame of :mod:`drivers.shadow.closing.closing`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose3, Rot3
from scipy.optimize import least_squares

from drivers.core.contacts import FINGERS, Array
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad, palm_T_distal_matrices

NODES = 16
"""Tabulated postures along a path."""

PROGRESS: Array = np.linspace(0.0, 1.0, NODES)
"""How far along it they are."""

LEAN_rad = float(np.deg2rad(25.0))
"""Inward lean of the fingertips against the vertical."""

LONG_FINGERS = ("FF", "MF", "RF", "LF")


@dataclass(frozen=True)
class TipEllipsoid:
    """The part of the fingertip's calibration that a posture needs.

    Attributes:
        semi_axes_m: semi-axes along the distal x, y, z.
        centre_distal_m: centre in the distal frame.
    """

    semi_axes_m: tuple[float, float, float] = (0.0085, 0.0085, 0.013)
    centre_distal_m: tuple[float, float, float] = (0.0, 0.0, 0.019)

    @property
    def radius_m(self) -> float:
        """Across the finger: as far from its centre it touches what it closes on."""
        return self.semi_axes_m[1]


@dataclass(frozen=True)
class HandShape(TipEllipsoid):
    """All that the way a hand closes depends on: its fingertips and its form.

    Attributes:
        form: side, fingers and joints.
    """

    form: HandForm = RIGHT_HAND

    @property
    def mirrored(self) -> HandShape:
        """The same hand of the other side."""
        return replace(self, form=self.form.mirrored)


@dataclass(frozen=True)
class Postures:
    """Solved postures along the lines of a right hand's fingers.

    Attributes:
        grasp_T_palm: the palm in the grasp frame, wrist straight.
        tables_rad: each finger's joint angles along its line, shape (NODES, joints of the finger), in the order of
            :func:`moved_joints`.
        valid: part of each line, as progress in 0..1, on which the tip keeps to it.
    """

    grasp_T_palm: Pose3
    tables_rad: Mapping[str, Array]
    valid: Mapping[str, tuple[float, float]]


def solve_postures(starts_m: Array, ends_m: Array, hand: HandShape) -> Postures:
    """Postures of a right hand with the tip centres on the lines from ``starts_m`` to ``ends_m``, grasp frame.

    Args:
        starts_m, ends_m: shape (n, 3), of the fingers that the hand has.
        hand: a right one.
    """
    return _Solver(starts_m, ends_m, hand).solve()


def finger_joints(finger: str) -> tuple[str, ...]:
    """Joints of one finger, from the palm outward."""
    numbers = (5, 4, 3, 2, 1) if finger in ("LF", "TH") else (4, 3, 2, 1)
    return tuple(f"{finger}J{number}" for number in numbers)


def moved_joints(finger: str, form: HandForm) -> tuple[str, ...]:
    """Those of them that a hand has, and a closing moves."""
    return tuple(joint for joint in finger_joints(finger) if joint in form.joints)


@dataclass(frozen=True)
class _Tips:
    """Tips of a batch of postures, grasp frame: centres (b, n, 3), rotations (b, n, 3, 3), lowest points (b, n)."""

    centres_m: Array
    rotations: Array
    lowest_m: Array


# Weights of the least squares, in metres of tip error for one unit of the quantity.
_AXIS, _PAD, _COUPLING, _ROLL, _REST, _PALM_HEIGHT = 0.006, 0.004, 0.002, 0.002, 4e-4, 0.3
_PATH = np.array([1.0, 0.5, 0.4])  # along x the line is kept tightly, aside and in height loosely
_PATH_AXIS, _SMOOTH = 0.0025, 0.0012
_PALM_MIN_m, _CLEARANCE_m, _CLEARANCE_SPAN_m = 0.105, 0.006, 0.030
_LOW_HEIGHT_m = 0.022  # tips higher than this raise the palm with them
_TOLERANCE_m = 0.004
_MID_WIDTH_m = 0.065  # a typical object's width: where the posture is optimised
_PALM_LOW = np.array([-0.3, -0.08, 0.02, -0.2, -0.5])  # x, y, z, nose-down tilt, roll
_PALM_HIGH = np.array([0.1, 0.08, 0.3, 1.4, 0.5])
_PALM_START = np.array([-0.06, 0.0, 0.10, 0.44, 0.0])
_REST_rad = {"J4": 0.0, "J3": 0.7, "J2": 0.7, "J1": 0.4, "LFJ5": 0.1}
_REST_THUMB_rad = {"THJ5": 0.9, "THJ4": 1.0, "THJ3": 0.0, "THJ2": 0.3, "THJ1": 0.5}
_PALM_DOWN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # palm down, fingers along +x


class _Solver:
    """First the palm with the hand half closed, then every node of the lines."""

    def __init__(self, starts_m: Array, ends_m: Array, hand: HandShape) -> None:
        self._starts_m, self._ends_m, self._hand = starts_m, ends_m, hand
        self._raised_m = max(0.0, float(np.mean(starts_m[:, 2])) - _LOW_HEIGHT_m)
        self._fingers = hand.form.fingers
        self._finger_rows = [FINGERS.index(finger) for finger in self._fingers]
        self._moved = [joint for finger in self._fingers for joint in moved_joints(finger, hand.form)]
        self._columns = np.array([JOINT_INDEX[name] for name in self._moved])
        self._low, self._high = JOINT_LIMITS_rad[self._columns].T + np.array([[1e-4], [-1e-4]])
        long_fingers = hand.form.long_fingers
        self._j1, self._j2 = ([self._moved.index(f"{f}J{number}") for f in long_fingers] for number in (1, 2))

    def solve(self) -> Postures:
        palm, joints = self._middle_posture()
        middle = int(np.rint(np.mean(self._middle_progress()) * (NODES - 1)))
        table = np.empty((NODES, len(self._moved)))
        for order in (range(middle, NODES), range(middle, -1, -1)):
            previous = joints
            for node in order:
                table[node] = previous = self._node_posture(palm, node / (NODES - 1), previous)
        return self._check(palm, table)

    def _middle_progress(self) -> Array:
        """Progress of each finger when the tips touch an object of typical width."""
        touch_m = np.where(np.array(self._fingers) == "TH", -1.0, 1.0) * (_MID_WIDTH_m / 2 + self._hand.radius_m)
        progress = (self._starts_m[:, 0] - touch_m) / (self._starts_m[:, 0] - self._ends_m[:, 0])
        return np.asarray(np.clip(progress, 0.0, 1.0))

    def _middle_posture(self) -> tuple[Array, Array]:
        """Palm (x, y, z, tilt, roll) and joint angles that put all tips at the middle of their lines."""
        targets_m = self._starts_m + self._middle_progress()[:, None] * (self._ends_m - self._starts_m)
        outward = np.array([[-1.0 if f == "TH" else 1.0, 0.0, 0.0] for f in self._fingers])
        axes = _leaning(-outward[:, :2])
        start = np.concatenate([_PALM_START, _rest_posture(self._moved)])

        def residuals(batch: Array) -> Array:
            palm, joints = batch[:, :5], batch[:, 5:]
            tips = self._tips(palm, joints)
            parts = [
                _flat(tips.centres_m - targets_m),
                _AXIS * _flat(tips.rotations[..., 2] - axes),
                _PAD * (1.0 - np.sum(tips.rotations[..., 1] * outward, axis=-1)),
                _COUPLING * (joints[:, self._j1] - 0.6 * joints[:, self._j2]),
                _ROLL * palm[:, 4:5],
                _REST * (joints - start[5:]),
                _PALM_HEIGHT * np.minimum(0.0, palm[:, 2:3] - _PALM_MIN_m - self._raised_m),
            ]
            return np.concatenate(parts, axis=1)

        solution = _minimise(
            residuals, start, np.concatenate([_PALM_LOW, self._low]), np.concatenate([_PALM_HIGH, self._high]), 200
        )
        return solution[:5], solution[5:]

    def _node_posture(self, palm: Array, u: float, previous: Array) -> Array:
        """Joint angles with every tip at progress ``u``, close to the neighbouring node's."""
        targets_m = self._starts_m + u * (self._ends_m - self._starts_m)
        axes = _leaning(self._ends_m[:, :2] - self._starts_m[:, :2])

        def residuals(joints: Array) -> Array:
            tips = self._tips(np.broadcast_to(palm, (len(joints), 5)), joints)
            spare_m = tips.lowest_m - _CLEARANCE_m
            parts = [
                _flat(_PATH * (tips.centres_m - targets_m)),
                2.0 * np.minimum(0.0, spare_m),
                np.maximum(0.0, spare_m - _CLEARANCE_SPAN_m - self._raised_m),
                _SMOOTH * (joints - previous),
                _PATH_AXIS * _flat(tips.rotations[..., 2] - axes),
                _COUPLING * (joints[:, self._j1] - 0.6 * joints[:, self._j2]),
            ]
            return np.concatenate(parts, axis=1)

        return _minimise(residuals, previous, self._low, self._high, 60)

    def _check(self, palm: Array, table: Array) -> Postures:
        """The solved table with the part of each line that is kept to :data:`_TOLERANCE_m`."""
        targets_m = self._starts_m + PROGRESS[:, None, None] * (self._ends_m - self._starts_m)
        tips = self._tips(np.broadcast_to(palm, (NODES, 5)), table)
        error_m = np.abs(tips.centres_m - targets_m) * [1.0, 0.5, 0.0]
        good = (error_m.max(axis=-1) < _TOLERANCE_m) & (tips.lowest_m > _CLEARANCE_m - 0.003)
        fingers, form = self._fingers, self._hand.form
        columns = {finger: [self._moved.index(joint) for joint in moved_joints(finger, form)] for finger in fingers}
        return Postures(
            Pose3(Rot3(palm_rotations(palm[None])[0]), palm[:3]),
            {finger: table[:, columns[finger]] for finger in fingers},
            {finger: _longest_run(good[:, index]) for index, finger in enumerate(fingers)},
        )

    def _tips(self, palm: Array, joints: Array) -> _Tips:
        vectors = np.zeros((len(joints), len(JOINTS)))
        vectors[:, self._columns] = joints
        palm_T_distal = palm_T_distal_matrices(vectors)[:, self._finger_rows]
        palm_rotation = palm_rotations(palm)[:, None]
        rotations = palm_rotation @ palm_T_distal[..., :3, :3]
        origins_m = (palm_rotation @ palm_T_distal[..., :3, 3, None])[..., 0] + palm[:, None, :3]
        centres_m = origins_m + rotations @ np.array(self._hand.centre_distal_m)
        reach_m = np.linalg.norm(rotations[..., 2, :] * np.array(self._hand.semi_axes_m), axis=-1)
        return _Tips(centres_m, rotations, centres_m[..., 2] - reach_m)


def _minimise(residuals: Callable[[Array], Array], start: Array, low: Array, high: Array, evaluations: int) -> Array:
    """Bounded least squares with forward differences; all columns of the Jacobian in one batch."""
    step = 1e-7

    def single(x: Array) -> Array:
        return np.asarray(residuals(x[None])[0])

    def jacobian(x: Array) -> Array:
        values = residuals(np.concatenate([x[None], x + step * np.eye(len(x))]))
        return np.asarray((values[1:] - values[0]).T / step)

    start = np.clip(start, low + 1e-6, high - 1e-6)
    return np.asarray(least_squares(single, start, jac=jacobian, bounds=(low, high), max_nfev=evaluations).x)


def _leaning(direction_xy: Array) -> Array:
    """Unit tip axes (n, 3) that point down and lean by :data:`LEAN_rad` along horizontal directions (n, 2)."""
    unit = direction_xy / np.linalg.norm(direction_xy, axis=1, keepdims=True)
    return np.column_stack([np.sin(LEAN_rad) * unit, np.full(len(unit), -np.cos(LEAN_rad))])


def palm_rotations(palm: Array) -> Array:
    """Rotations (b, 3, 3) of palms (b, 5): nose-down tilt about y after roll about x, from palm down."""
    (ct, st), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (palm[:, 3], palm[:, 4]))
    zero = np.zeros_like(ct)
    rows = [[ct, st * sr, st * cr], [zero, cr, -sr], [-st, ct * sr, ct * cr]]
    return np.asarray(np.moveaxis(np.array(rows), -1, 0) @ _PALM_DOWN)


def _rest_posture(joints: Sequence[str]) -> Array:
    return np.array(
        [_REST_THUMB_rad.get(joint, _REST_rad.get(joint, _REST_rad.get(joint[2:], 0.0))) for joint in joints]
    )


def _flat(values: Array) -> Array:
    return np.asarray(values.reshape(len(values), -1))


def _longest_run(good: Array) -> tuple[float, float]:
    """Progress at both ends of the longest run of usable nodes; both 0 when there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    if not len(edges):
        return 0.0, 0.0
    starts, ends = edges[::2], edges[1::2] - 1
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]) / (NODES - 1), int(ends[longest]) / (NODES - 1)
