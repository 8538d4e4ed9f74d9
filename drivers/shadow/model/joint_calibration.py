"""From ADC counts to joint angles and back, by the tables in a hand's ``calibration.yaml``.

The file is Shadow's own format (protocols: Joint calibration files). ``sr_calibrations`` holds one table of (counts,
degrees) a joint, read piecewise linearly and continued with the end pair. ``sr_calibrations_coupled`` holds pairs of
joints whose two sensors both depend on both angles (the thumb's THJ1 and THJ2): points ((countsA, countsB), degreesA,
degreesB), read by linear interpolation on the Delaunay triangulation of the counts plane. THJ5 and WRJ1 have two
sensors each, averaged before the table is read. Every joint's own sensor is read, so J1 and J2 of a finger are both
known although one tendon drives their sum. What a hand does not have (a Lite hand's wrist) is not read: it stays at
zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.interpolation import Curves, Plane
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from drivers.shadow.protocol.palm_codec import OPTIONAL_CHANNELS, SENSORS

Table = Sequence[tuple[float, float]]
"""Calibration points (ADC counts, degrees) of one joint."""

CoupledTable = Sequence[tuple[tuple[float, float], float, float]]
"""Calibration points ((counts of A, counts of B), degrees of A, degrees of B) of two joints."""

_LARGEST_count, _LARGEST_deg = 4095, 180
_STEEPEST_deg = 3.0
"""Of one count. Published calibrations have at most 0.5 degrees; placeholders 7 and 11."""

_AVERAGED = {"THJ5": ("THJ5A", "THJ5B"), "WRJ1": ("WRJ1A", "WRJ1B")}


class _CalibrationFile(StrictModel):
    sr_calibrations: tuple[tuple[str, tuple[tuple[float, float], ...]], ...]
    sr_calibrations_coupled: tuple[
        tuple[tuple[str, str], tuple[tuple[tuple[float, float], float, float], ...]], ...
    ] = ()


class JointCalibration:
    """The calibration of one hand.

    Args:
        tables: table of each joint that has its own.
        coupled: tables of pairs of joints. Together every joint of the hand appears exactly once.
        where: the file, for error messages.
        joints: that the hand has, all 24 unless given; tables of others are not read.

    Attributes:
        has_joint: which of the 24 joints the hand has, shape (24,).
        turns: which of them have more than one angle, shape (24,). A joint that was fixed, as under some fingertips,
            has the same at every count; its sensor may be gone.
        range_counts: smallest and largest calibrated count of each joint, shape (24, 2), order of
            :data:`~drivers.shadow.model.kinematics.JOINTS`; of a joint with two sensors their average.
        range_rad: the same for the angles, radians. Zero for a joint that the hand does not have.

    Raises:
        ConfigurationError: a joint is missing, unknown or given twice, or a table cannot be used.
    """

    def __init__(
        self,
        tables: Mapping[str, Table],
        coupled: Mapping[tuple[str, str], CoupledTable],
        where: str = "calibration",
        joints: Collection[str] = JOINTS,
    ) -> None:
        _check_complete([*tables, *(joint for pair in coupled for joint in pair)], where, joints)
        self._where = where
        tables = {joint: table for joint, table in tables.items() if joint in joints}
        coupled = {pair: points for pair, points in coupled.items() if set(pair) <= set(joints)}
        self.has_joint: NDArray[np.bool_] = np.isin(JOINTS, list(joints))
        self._plain = np.array([JOINT_INDEX[joint] for joint in tables], dtype=np.intp)
        self._curves = Curves([_checked_table(joint, table, where) for joint, table in tables.items()])
        self._pairs = [
            (np.array([JOINT_INDEX[joint] for joint in pair]), _plane(pair, points, where))
            for pair, points in coupled.items()
        ]

        ends = {joint: _ends(table) for joint, table in tables.items()}
        for pair, points in coupled.items():
            ends |= {
                joint: _ends([(counts[at], angles[at]) for counts, *angles in points]) for at, joint in enumerate(pair)
            }
        in_order = np.array([ends.get(joint, ((0.0, 0.0), (0.0, 0.0))) for joint in JOINTS])
        self.range_counts: Array = in_order[:, 0]
        self.range_rad: Array = np.radians(in_order[:, 1])
        self.turns: NDArray[np.bool_] = self.range_rad[:, 0] < self.range_rad[:, 1]

    @classmethod
    def load(cls, path: Path, joints: Collection[str] = JOINTS) -> JointCalibration:
        """Read a ``calibration.yaml``, of a hand with these joints.

        Raises:
            ConfigurationError: the file or one of its tables cannot be used; names the joint.
        """
        content = load_parameters(path, _CalibrationFile)
        _refuse_repeats([joint for joint, _ in content.sr_calibrations], str(path))
        _refuse_repeats([joint for pair, _ in content.sr_calibrations_coupled for joint in pair], str(path))
        _refuse_typing_errors(content, str(path))
        return cls(dict(content.sr_calibrations), dict(content.sr_calibrations_coupled), str(path), joints)

    def angles_rad(self, sensors: NDArray[np.uint16] | Array) -> Array:
        """Joint angles from one set of readings.

        Args:
            sensors: ADC counts, shape (37,), the palm's channels.

        Returns:
            Angles, shape (24,), order of :data:`~drivers.shadow.model.kinematics.JOINTS`, radians.
        """
        counts = joint_counts(sensors)
        angles_deg = np.zeros(len(JOINTS))
        angles_deg[self._plain] = self._curves(counts[self._plain])
        for joints, plane in self._pairs:
            angles_deg[joints] = plane(counts[joints])
        return np.radians(angles_deg)

    def raw_counts(self, joints_rad: Array) -> Array:
        """The readings that would give these angles: the inverse of :meth:`angles_rad`, for emulated palms.

        Args:
            joints_rad: joint angles, shape (24,), radians.

        Returns:
            ADC counts before rounding and clipping, shape (37,). Channels without a joint read as in a palm
            without the optional sensors: their own index, or zero, which is what those of a missing joint read too.

        Raises:
            ConfigurationError: a coupled table does not determine both angles.
        """
        for joints, plane in self._pairs:
            if not plane.invertible:
                raise self._undetermined(joints)
        angles_deg = np.degrees(joints_rad)
        counts = np.zeros(len(JOINTS))
        counts[self._plain] = self._curves.inverse(angles_deg[self._plain])
        for joints, plane in self._pairs:
            counts[joints] = plane.inverse(angles_deg[joints])
        sensors = _IDLE_SENSORS.copy()
        sensors[SENSOR_HAS_JOINT] = counts[JOINT_OF_SENSOR]
        return sensors

    def _undetermined(self, pair: NDArray[np.intp]) -> ConfigurationError:
        first, second = (JOINTS[joint] for joint in pair)
        return ConfigurationError(
            f"sr_calibrations_coupled: the table of {first} and {second} does not determine both angles",
            where=self._where,
            hint="A real hand can use it as it is; an emulated one needs another calibration, in which both turn",
        )


def joint_counts(sensors: NDArray[np.uint16] | Array) -> Array:
    """Counts of each joint, shape (24,), from the palm's 37 channels: THJ5 and WRJ1 are averages of two sensors."""
    return np.asarray(_JOINT_FROM_SENSOR.dot(np.asarray(sensors, dtype=float)))


def _ends(points: Table) -> tuple[tuple[float, float], tuple[float, float]]:
    """Smallest and largest count, and smallest and largest angle in degrees, of a table."""
    counts, degrees = zip(*points, strict=True)
    return (min(counts), max(counts)), (min(degrees), max(degrees))


def _checked_table(joint: str, table: Table, where: str) -> Array:
    """The table by rising counts, shape (n, 2). Angles rise, fall or, for a fixed joint, stay."""
    points = np.array(sorted(table), dtype=float).reshape(-1, 2)
    if len(points) < 2:
        raise ConfigurationError(f"the table of {joint} needs two or more points", where=where)
    if not _is_monotonic(points):
        what = f"the table of {joint} is not monotonic{_contradiction(points)}"
        raise ConfigurationError(what, where=where, hint="Each count needs its own angle")
    _refuse_placeholders(joint, np.diff(points, axis=0), where)
    return points


def _is_monotonic(points: Array) -> bool:
    steps = np.diff(points, axis=0)
    same_way = (steps[:, 1] > 0).all() or (steps[:, 1] < 0).all() or not steps[:, 1].any()
    return bool(same_way and (steps[:, 0] > 0).all() and np.isfinite(points).all())


def _contradiction(points: Array) -> str:
    """In words, a count with several angles, or the only point of four or more that does not fit; else nothing."""
    counts, times = np.unique(points[:, 0], return_counts=True)
    if times.max() > 1:
        return f": {counts[times.argmax()]:g} counts stand for {times.max()} angles"
    without = [at for at in range(len(points)) if _is_monotonic(np.delete(points, at, axis=0))]
    if len(without) != 1 or len(points) < 4:
        return ""
    counts, degrees = points[without[0]]
    return f": {counts:g} counts at {degrees:g} degrees contradict the other points"


def _refuse_placeholders(joint: str, steps: Array, where: str) -> None:
    """Some published folders fill what was never calibrated with counts such as 9, 7, 5, 3: monotonic, but a joint
    would jump by many degrees from one count to the next.
    """
    steepest = max(steps, key=lambda step: abs(step[1]) / step[0])
    if abs(steepest[1]) > _STEEPEST_deg * steepest[0]:
        what = f"the table of {joint} has only {steepest[0]:g} counts for {abs(steepest[1]):g} degrees: placeholders"
        raise ConfigurationError(what, where=where, hint="Calibrate the joint")


def _plane(pair: tuple[str, str], points: CoupledTable, where: str) -> Plane:
    counts, degrees = np.array([point[0] for point in points]), np.array([point[1:] for point in points])
    try:
        return Plane(counts, degrees)
    except ValueError as error:
        raise ConfigurationError(f"the table of {pair[0]} and {pair[1]} {error}", where=where) from error


def _check_complete(joints: Sequence[str], where: str, needed: Collection[str]) -> None:
    _refuse_repeats(joints, where)
    missing, unknown = sorted(set(needed) - set(joints)), sorted(set(joints) - set(JOINTS))
    if missing or unknown:
        problems = [
            f"{word} {', '.join(names)}" for word, names in (("misses", missing), ("has unknown", unknown)) if names
        ]
        raise ConfigurationError(
            " and ".join(problems), where=where, hint="A hand's calibration must name each of its joints once"
        )


def _refuse_repeats(joints: Sequence[str], where: str) -> None:
    repeated = sorted(joint for joint, times in Counter(joints).items() if times > 1)
    if repeated:
        raise ConfigurationError(f"calibrates {', '.join(repeated)} more than once", where=where)


def _refuse_typing_errors(content: _CalibrationFile, where: str) -> None:
    """A wrong digit in a table's last point leaves it monotonic: refuse what no sensor reads and no joint turns."""
    points = [(joint, *point) for joint, table in content.sr_calibrations for point in table]
    for pair, table in content.sr_calibrations_coupled:
        points += [(pair[at], counts[at], degrees[at]) for counts, *degrees in table for at in range(2)]
    for joint, count, degrees in points:
        if not 0.0 <= count <= _LARGEST_count:
            what = f"the table of {joint} has {count:g} counts; its sensor reads 0 to {_LARGEST_count}"
            raise ConfigurationError(what, where=where, hint="Correct the figure, or calibrate the joint again")
        if not abs(degrees) <= _LARGEST_deg:
            what = f"the table of {joint} has {degrees:g} degrees; no joint turns by more than {_LARGEST_deg}"
            raise ConfigurationError(what, where=where, hint="Correct the figure, or calibrate the joint again")


def _joint_from_sensor() -> Array:
    matrix = np.zeros((len(JOINTS), len(SENSORS)))
    for row, joint in enumerate(JOINTS):
        channels = _AVERAGED.get(joint, (joint,))
        for channel in channels:
            matrix[row, SENSORS.index(channel)] = 1 / len(channels)
    return matrix


_JOINT_FROM_SENSOR = _joint_from_sensor()
SENSOR_HAS_JOINT = _JOINT_FROM_SENSOR.any(axis=0)
"""Which of the palm's 37 channels are joint sensors."""

JOINT_OF_SENSOR = _JOINT_FROM_SENSOR.argmax(axis=0)[SENSOR_HAS_JOINT]
"""The joints of those channels, as indices."""

_IDLE_SENSORS = np.array([float(channel) if channel in OPTIONAL_CHANNELS else 0.0 for channel in range(len(SENSORS))])
