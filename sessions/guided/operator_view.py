"""Sensor readings while a person guides the hand: contacts, forces, steadiness and observability of the grasp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drivers.biotac.biotac import BioTac
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipSensor
from drivers.core.observability import planar_observability
from drivers.force.force_fingertip import ForceTip
from drivers.force.intrinsic_contact import contact_on_ellipsoid, wrench_transform
from sessions.conductor.guided_settings import GuidedSettings
from sessions.perception.perception import Perception


@dataclass(frozen=True)
class OperatorView:
    """Readings at one instant.

    Attributes:
        forces_N: contact force on each fingertip; None if its sensor has no usable reading or is not zeroed yet.
        touching: fingers in contact.
        steady_s: time for which contacts and hand have not changed.
        is_steady: long enough, with enough fingers.
        observability: smallest eigenvalue of (3.18) of the current contacts; None if unknown.
        silent: fingers whose sensor sends nothing usable.
        problems: problems reported by sensors.
    """

    forces_N: Mapping[str, float | None]
    touching: tuple[str, ...] = ()
    steady_s: float = 0.0
    is_steady: bool = False
    observability: float | None = None
    silent: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    def words(self) -> str:
        """The contacts as a sentence."""
        if not self.touching:
            return "no finger touches"
        forces = ", ".join(f"{finger} {self.forces_N[finger] or 0.0:.2f} N" for finger in self.touching)
        return f"{len(self.touching)} fingers touch: {forces}"


@dataclass(frozen=True)
class _Instant:
    stamp_ns: int
    touching: frozenset[str]
    forces_N: Array
    palm_m: Array
    joints_rad: Array


class Watcher:
    """Evaluates every cycle.

    Args:
        perception: the live session's.
        settings: criteria for a steady grasp and a silent sensor.
        touch_force_N: force above which a finger touches.
    """

    def __init__(self, perception: Perception, settings: GuidedSettings, touch_force_N: float) -> None:
        self._seen, self._settings, self._touch_force_N = perception, settings, touch_force_N
        self._begun_ns: int | None = None
        self._since: _Instant | None = None
        """Restart the measurement of steadiness."""

    def take(self, stamp_ns: int) -> None:
        """Add one cycle; a change restarts the measurement of steadiness."""
        self._begun_ns = stamp_ns if self._begun_ns is None else self._begun_ns
        loads_N = self._seen.loads_N()
        forces_N = np.array([min(load_N, 1e6) for load_N in loads_N.values()])
        touching = frozenset(finger for finger, load_N in loads_N.items() if load_N > self._touch_force_N)
        now = _Instant(stamp_ns, touching, forces_N, self._seen.hand.palm_world_m, self._seen.hand.joints_rad)
        if self._since is None or not self._same(now, self._since):
            self._since = now

    def _same(self, one: _Instant, other: _Instant) -> bool:
        s = self._settings
        return (
            one.touching == other.touching
            and bool(np.all(np.abs(one.forces_N - other.forces_N) <= s.steady_force_N))
            and float(np.linalg.norm(one.palm_m - other.palm_m)) <= s.steady_m
            and bool(np.all(np.abs(one.joints_rad - other.joints_rad) <= s.steady_rad))
        )

    def view(self, stamp_ns: int) -> OperatorView:
        """The current readings."""
        loads_N = self._seen.loads_N()
        silent = tuple(f for f in loads_N if not np.isfinite(loads_N[f]) or self._is_silent(f, stamp_ns))
        usable = [finger for finger in loads_N if finger not in silent and self._is_zeroed(finger)]
        touching = tuple(finger for finger in usable if loads_N[finger] > self._touch_force_N)
        steady_s = 0.0 if self._since is None else (stamp_ns - self._since.stamp_ns) / NANOSECONDS
        enough = len(touching) >= self._settings.least_contacts and steady_s >= self._settings.steady_s
        return OperatorView(
            forces_N={finger: round(loads_N[finger], 3) if finger in usable else None for finger in loads_N},
            touching=touching,
            steady_s=steady_s,
            is_steady=enough,
            observability=self._observability(touching),
            silent=silent,
            problems=self._seen.problems(),
        )

    def _is_silent(self, finger: str, stamp_ns: int) -> bool:
        tip = self._seen.fingertips[finger]
        if not isinstance(tip, ForceTip):
            return False
        heard_ns = self._begun_ns if tip.newest is None else tip.newest.stamp_ns
        return heard_ns is not None and stamp_ns - heard_ns > self._settings.silent_s * NANOSECONDS

    def _is_zeroed(self, finger: str) -> bool:
        tip = self._seen.fingertips[finger]
        return not isinstance(tip, ForceTip) or tip.tare_record is not None

    def _observability(self, touching: tuple[str, ...]) -> float | None:
        """Observability of contacts computed from the newest samples only; a capture will average."""
        points_m, normals = [], []
        for finger in touching:
            touch = _touch_distal(self._seen.fingertips[finger], self._seen.hand.world_R_distal[finger])
            if touch is None:
                return None
            world_T_distal = self._seen.hand.world_T_distal[finger]
            points_m.append(world_T_distal.transformFrom(touch[0]))
            normals.append(world_T_distal.rotation().rotate(touch[1]))
        if not points_m:
            return None
        return planar_observability(np.array(points_m), np.array(normals)).smallest


def _touch_distal(tip: FingertipSensor, world_R_distal: Array) -> tuple[Array, Array] | None:
    """Contact point and normal out of the object in the distal frame, by the newest sample; changes nothing."""
    if isinstance(tip, BioTac):
        touch = tip.newest_contact()
        return None if touch is None else (touch.point_distal_m, touch.normal_distal)
    if not isinstance(tip, ForceTip) or tip.newest is None:
        return None
    model, mounting = tip.calibration, tip.calibration.distal_T_sensor.pose()
    centre_m = np.array(model.centre_distal_m)
    to_centre = wrench_transform(mounting.rotation().matrix(), mounting.translation() - centre_m)
    wrench = to_centre @ tip.load(tip.newest.wrench, world_R_distal)
    if np.linalg.norm(wrench[:3]) < 1e-3:
        return None
    contact = contact_on_ellipsoid(wrench[:3], wrench[3:], np.array(model.semi_axes_m))
    return contact.point_m + centre_m, -contact.normal
