"""A BioTac in numbers: its electrodes and skins, contacts of many presses, a story of slots, and learned normals."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from drivers.biotac.biotac import BioTac, load_biotacs
from drivers.biotac.channels import core_temperature_degC
from drivers.biotac.electrodes import BallAndCylinder, electrode_layout, electrodes_of
from drivers.biotac.estimator import contact_from_electrodes, force_direction
from drivers.biotac.learned_normal import Presses, as_stored
from drivers.biotac.normal_training import compare_methods, fitted_spread, rotation_to_sensor, train
from drivers.biotac.settings import BioTacSettings
from drivers.biotac.slot_codec import Channel, Slot, decode_slot, electrode_channel, encode_slot
from drivers.core.errors import DeviceError
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.plain_values import plain
from tests.support.repository import SIMULATED_HAND

MS = 1_000_000


def presses(count: int, seed: int, electrodes: int = 19) -> Presses:
    """Presses all over a finger, with a little noise."""
    rng, layout = np.random.default_rng(seed), electrode_layout(19 if electrodes == 19 else 24)
    turns = np.linspace(0.0, 12.0 * np.pi, count)
    raw = np.c_[0.5 + 0.4 * np.sin(0.31 * turns), 0.7 * np.sin(turns), -np.ones(count)]
    normals = raw / np.linalg.norm(raw, axis=1, keepdims=True)
    near = np.exp(-((0.007 * normals[:, None] - layout.positions_m) ** 2).sum(axis=2) / (2 * 0.004**2))
    return Presses(400.0 * (0.25 - near) + rng.normal(0.0, 3.0, near.shape), normals)


@pytest.mark.parametrize("electrodes", [19, 24])
def test_electrodes_skins_and_contacts(electrodes: int) -> None:
    layout = electrode_layout(19 if electrodes == 19 else 24)
    changes = presses(7, 1, electrodes).changes
    points = layout.positions_m * [1.2, 0.9, 1.3]
    contacts = {str(p): plain(contact_from_electrodes(changes, layout, noise_counts=20.0, power=p)) for p in (1.0, 2.0)}
    found = {
        "positions": layout.positions_m,
        "normals": layout.normals,
        "skin": layout.skin.project(points),
        "ball": BallAndCylinder(0.008).project(points),
        "contacts": contacts,
        "direction": force_direction(changes, layout, noise_counts=20.0),
        "models": [electrodes_of(serial) for serial in ("BTSP12", "BTTB3", "BT7", "")],
        "temperature": core_temperature_degC(np.array([100.0, 2000.0, 2280.0, 4000.0])),
    }
    assert_baseline(f"biotac/electrodes_{electrodes}", found, rtol=1e-6, atol=1e-10)


def test_slots() -> None:
    slot = Slot((2040, 2041), {int(Channel.PDC): 1700, int(Channel.TAC): 2000})
    bits = encode_slot(slot, Channel.PDC)
    damaged = {str(byte): plain(decode_slot(bits[:6] + bytes([byte]) + bits[7:], 1)) for byte in (0, 1, 2, 4, 8, 5, 15)}
    channels = [electrode_channel(number) for number in range(1, 25)]
    asked = {str(request): plain(decode_slot(bits, request)) for request in (0, 1, 3, 4, 5, 14, 27, 28, 99)}
    assert_baseline("biotac/slots", {"bits": bits.hex(), "damaged": damaged, "channels": channels, "asked": asked})


def test_a_story_of_slots() -> None:
    calibration = load_biotacs(SIMULATED_HAND / "biotacs.yaml")["RF"]
    tip = BioTac("RF", calibration, BioTacSettings(follow_s=5.0))
    rest = {int(Channel.PDC): 1700, int(Channel.TAC): 2000, int(Channel.TDC): 2280}
    rest |= {electrode_channel(number): 3000 for number in range(1, calibration.electrodes + 1)}
    told: dict[str, Any] = {}
    rng, stamp_ns = np.random.default_rng(5), 0

    def note(what: str) -> None:
        load_N = tip.load_N(np.eye(3))
        said = [load_N if np.isfinite(load_N) else "infinite", tip.void(), list(tip.health())]
        told[f"{len(told)} {what}"] = plain([*said, tip.newest_contact(), tip.contact(np.eye(3))])

    def feed(what: str, change: dict[int, int], rounds: int = 12, noise: float = 1.0) -> None:
        nonlocal stamp_ns
        for _ in range(rounds):
            for channel, value in (rest | change).items():
                stamp_ns += MS
                shaken = value if value in (0, 5000) else value + round(noise * rng.standard_normal())
                tip.take(Slot((2040, 2041), {channel: shaken}), stamp_ns)
        note(what)

    def tare() -> None:
        try:
            tip.tare(np.eye(3))
            note("tared")
        except DeviceError as refused:
            note(f"{refused.where}: {refused.what} / {refused.hint}")

    note("new")
    feed("once", {}, 1)
    tare()
    feed("restless", {}, 12, 30.0)
    tare()
    feed("quiet", {})
    feed("restless pressure", {int(Channel.PDC): 1720}, 1)
    tare()
    feed("quiet again", {}, 20)
    tare()
    feed("drifting", {channel: value + 4 for channel, value in rest.items()}, 20)
    squeezed = {electrode_channel(number): 3000 - 60 * number for number in (3, 4, 5, 9)}
    tip.begin_capture()
    feed("squeezed without pressure", squeezed)
    tip.begin_capture()
    feed("pressed", squeezed | {int(Channel.PDC): 1820})
    feed("resting on the core", {key: value - 900 for key, value in squeezed.items()} | {int(Channel.PDC): 1760})
    feed("no sensor", {int(Channel.PDC): 0}, 1)
    tare()
    feed("impossible", {electrode_channel(2): 5000}, 1)
    feed("sound", {}, 3)
    stamp_ns += 900 * MS
    tip.take(Slot((2040,), {int(Channel.PDC): 1700}), stamp_ns)
    note("one channel after a pause")
    assert_baseline("biotac/story", told, rtol=1e-6, atol=1e-9)


def test_learned_normals_and_the_comparison_of_methods() -> None:
    recorded = presses(240, 3)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = Presses(recorded.changes, recorded.normals @ turn.T)
    learned = train(recorded, 19, most=110)
    stored = as_stored(learned).model_dump(mode="json")
    normals, sigmas = learned.normals(presses(6, 9).changes)
    far = learned.normals(np.full((1, 19), -900.0))
    rows = [*compare_methods(turned, 19, most=100), *compare_methods(recorded, 19, in_sensor_frame=True, most=100)]
    found = {
        "kernel": plain(learned.kernel),
        "spread": plain(learned.spread),
        "normals": [normals, sigmas, *far],
        "stored": [sorted(stored), len(learned.examples)],
        "turn": rotation_to_sensor(turned, 19, 15.0),
        "rows": [asdict(row) for row in rows],
        "fitted": plain(fitted_spread(np.linspace(0.01, 0.3, 30), np.linspace(0.0, 1.0, 30))),
        "examples": digest(learned.examples.normals),
    }
    assert_baseline("biotac/learned", found, rtol=1e-4, atol=1e-7)
