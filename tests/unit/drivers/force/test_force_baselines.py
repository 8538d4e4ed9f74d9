"""A force fingertip in numbers: contacts of many wrenches, their covariance, and a story of samples with its words."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from gtsam import Rot3

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.fingertip import FingertipCalibration, RigidTransform, TipTouches, load_fingertips
from drivers.core.transports import ReplayTransport
from drivers.force.force_samples import WrenchSample
from drivers.force.intrinsic_contact import contact_covariance, contact_jacobian, contact_on_ellipsoid, wrench_transform
from drivers.force.plausibility import PlausibilitySettings, WrenchMonitor, noise_objection, objection
from drivers.force.sequences import SequenceMonitor
from drivers.force.touches import TipSensing
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain
from tests.support.repository import SIMULATED_HAND

AXES = np.array([0.0085, 0.009, 0.013])
TIP = load_fingertips(SIMULATED_HAND / "fingertips.yaml")["FF"].model_copy(
    update={"distal_T_sensor": RigidTransform(translation_m=(0.0, 0.001, 0.004), rpy_rad=(0.1, -0.2, 0.3))}
)
TILTED = Rot3.Ypr(0.3, 1.2, -0.4).matrix()


def wrenches(count: int = 12) -> np.ndarray:
    """Forces of up to 1.5 N into the tip at places all over it, with a little twist, about its centre."""
    rng = np.random.default_rng(2)
    outward = rng.standard_normal((count, 3)) - [0.0, 1.0, 0.0]
    points = outward / np.linalg.norm(outward / AXES, axis=1, keepdims=True)
    normals = points / AXES**2 / np.linalg.norm(points / AXES**2, axis=1, keepdims=True)
    forces = -rng.uniform(0.05, 1.5, (count, 1)) * (normals + 0.4 * rng.standard_normal((count, 3)))
    twist = 1e-3 * rng.standard_normal((count, 1)) * normals
    return np.hstack([forces, np.cross(points, forces) + twist])


def test_contacts_of_wrenches_on_an_ellipsoid() -> None:
    loads = np.vstack([wrenches(), [[0.0] * 6], [[0.5, 0.2, 0.1, 0.0, 0.0, 0.0]], [[0.1, 0, 0, 0, 0.02, 0]]])
    contacts = contact_on_ellipsoid(loads[:, :3], loads[:, 3:], AXES)
    single = [contact_on_ellipsoid(load[:3], load[3:], AXES) for load in loads]
    spread = np.diag(np.repeat([1e-3, 2e-5], 3) ** 2)
    covariances = [
        contact_covariance(each, load[:3], AXES, spread) for each, load in zip(single[:8], loads, strict=False)
    ]
    shell = TIP.model_copy(
        update={"shell_min_distal_m": (-0.01, -0.02, 0.0), "shell_max_distal_m": (0.01, 0.004, 0.04)}
    )
    limits = PlausibilitySettings(torsion_m=1e-3)
    is_void = np.arange(len(loads)) % 5 == 4
    sensing = TipSensing.of(shell, limits, np.eye(6), np.zeros((6, 3)))
    touches = sensing.contacts(loads[:, None], is_void[:, None])
    found = {
        "contacts": plain(contacts),
        "jacobian": contact_jacobian(single[0], loads[0, :3], AXES),
        "covariance": [1e6 * np.array(pair[0]) for pair in covariances],
        "bend": [pair[1] for pair in covariances],
        "objections": [objection(each, load[:3], shell, limits) for each, load in zip(single, loads, strict=True)],
        "touches": plain(TipTouches(*(getattr(touches, each.name)[:, 0] for each in fields(touches)))),
        "moved": wrench_transform(TILTED, np.array([0.01, -0.02, 0.03])),
    }
    assert_baseline("force/contacts", found, rtol=1e-5, atol=1e-9)


def test_verdicts_of_a_monitor_and_words_about_noise() -> None:
    monitor = WrenchMonitor(PlausibilitySettings(window=6, faulty_count=2))
    verdicts = ["slides", "", "misses", "misses", "", "misses", "", "", "", "", ""]
    told = []
    for verdict in verdicts:
        monitor.note(verdict, np.array([0.3, 0.0, 0.0]))
        monitor.note("weak", np.array([0.29, 0.0, 0.0]))
        told.append(monitor.fault)
    usual = np.repeat([TIP.force_sigma_N, TIP.moment_sigma_Nm], 3)
    noise = {str(share): noise_objection(share * usual, TIP) for share in (0.019, 0.021, 1.0, 5.99, 6.01)}
    assert_baseline("force/monitor", {"told": told, "noise": noise})


def test_counters_of_records() -> None:
    monitor = SequenceMonitor(step=7)
    top = (1 << 32) - 2
    story = [
        (top, top),
        (top + 1, top + 6),
        (0, 12),
        (3, 33),
        (3, 33),
        (2, 26),
        (4, 33),
        (5, 33),
        (6, 33),
        (7, 90),
        (1, 95),
    ]
    story += [(1, 80)] * 12 + [(9, 60)]
    told = []
    for sent, measured in story:
        is_new = monitor.is_new(sent & 0xFFFFFFFF, measured & 0xFFFFFFFF)
        counted = [monitor.seen, monitor.lost, monitor.skipped, monitor.disordered, monitor.restarts]
        told.append([is_new, *counted, monitor.stuck])
    assert_baseline("force/counters", {"told": told})


class Bench:
    """Feeds a fingertip with samples and notes what it says after each act."""

    def __init__(self, calibration: FingertipCalibration, **changes: Any) -> None:
        self.clock, self.rng, self.count = VirtualClock(), np.random.default_rng(4), 0
        settings = Nano17Settings(**changes)
        self.tip = Nano17("FF", ReplayTransport("ft/FF", []), self.clock, calibration, settings)
        self.told: list[Any] = []

    def feed(
        self, what: str, wrench: np.ndarray, n: int = 20, *, faults: tuple[str, ...] = (), **counters: int
    ) -> None:
        for _ in range(n):
            self.count += 1
            self.clock.sleep_until_ns(10_000_000 * self.count)
            reading = wrench + np.repeat([1 / 320, 1e-3 / 64], 3) * self.rng.normal(size=6)
            sent, measured = counters.get("sent", self.count), counters.get("measured", 70 * self.count)
            self.tip.update([WrenchSample(self.clock.now_ns(), reading, sent, measured, 0, faults, ())])
        self.note(what)

    def note(self, what: str) -> None:
        tip = self.tip
        load_N = tip.load_N(TILTED)
        said = [load_N if np.isfinite(load_N) else "infinite", tip.void(), tip.overload, list(tip.health())]
        self.told.append([what, *plain(said), plain(tip.contact(TILTED))])

    def tare(self) -> None:
        try:
            self.tip.tare(TILTED, reason="before")
            self.note("tared")
        except DeviceError as refused:
            self.note(f"{refused.where}: {refused.what} / {refused.hint}")


def test_a_story_of_samples() -> None:
    bench = Bench(TIP, lost_share=0.02, tare_samples=12)
    tip, bias = bench.tip, np.array([0.3, -0.2, 1.1, 0.004, -0.002, 0.001])
    bench.note("new")
    bench.tare()
    bench.feed("few", bias, 6)
    bench.tare()
    bench.feed("moving", bias + np.array([0.2, 0, 0, 0, 0, 0]), 6)
    bench.tare()
    bench.feed("still", bias, 12)
    bench.tare()
    load = tip.calibration.distal_T_sensor.pose().rotation().matrix().T @ np.array([0.05, 0.9, -0.3])
    lever = np.array([0.001, -0.0075, 0.012])
    pressed = bias + np.concatenate([load, np.cross(lever, load)])
    tip.begin_capture()
    bench.feed("pressed", pressed, 30)
    tip.begin_capture()
    bench.feed("light", bias + 0.05 * (pressed - bias), 10)
    for torsion in (0.02, 0.03, 0.05, 0.06, 0.07):
        tip.begin_capture()
        bench.feed("twisted", pressed + np.array([0, 0, 0, 0, torsion, 0]), 12)
    bench.feed("faulty", pressed, 2, faults=("halted",))
    bench.feed("near the end", bias + np.array([10.0, 0, 0, 0, 0, 0]), 1)
    bench.feed("beyond it", bias + np.array([0, 0, 40.0, 0, 0, 0.3]), 1)
    bench.feed("no number", bias * np.nan, 1)
    bench.feed("again", bias + np.array([0.2, 0, 0, 0, 0.002, 0]), 15)
    bench.tare()
    bench.feed("stuck", bias, 5, measured=9)
    bench.feed("repeated", bias, 3, sent=7)
    bench.clock.sleep_until_ns(bench.clock.now_ns() + 31 * 60 * 10**9)
    bench.note("late")
    bench.feed("heard again", bias, 1)
    record = tip.tare_record
    found = {f"{n} {what}": rest for n, (what, *rest) in enumerate(bench.told)}
    load_now = tip.load(pressed, TILTED)
    assert_baseline("force/story", {**found, "record": plain(record), "load": load_now}, rtol=1e-5, atol=1e-10)
