"""Emulates the devices of a fingertip or hand rig at the addresses in its file, for tests without hardware."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import can
import numpy as np

from drivers.ati.protocols import cal_file
from drivers.ati.wires.gauge_volts import encode_volts
from drivers.ati.wiring import CanWiring, ControllerWiring, DigitalWiring, NetBoxWiring, VoltsWiring, open_bus
from drivers.core.errors import ConfigurationError
from drivers.core.registry import Registry
from drivers.emulators.ati.can_server import CanServer
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import ControllerUnit
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_server import NetBoxServer
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor, emulated_calibration
from drivers.emulators.background import Background, Pace
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.emulators.pty_port import PtyPort
from drivers.fingertips.wiring import place_of
from drivers.shadow.protocol.palm_images import USUAL_PALM
from tactile_lab.rigs.description import shipped_rigs
from tactile_lab.rigs.fingertip_rig import FingertipRig, is_fingertip_rig, load_fingertip_rig
from tactile_lab.rigs.hand_rig import HandRig, is_hand_rig, load_hand_rig

_EMULATED_SERIAL = 634
_NO_NEED = "Give a rig file of kind fingertips or hand; simulated and emulated rigs start their emulators themselves"
_VOLTS_RATE_Hz = 1000.0


def emulated_rig(name: str) -> AbstractContextManager[dict[str, str]]:
    """Emulators of a rig file of kind fingertips or hand.

    Args:
        name: the file's path.

    Raises:
        ConfigurationError: another kind of rig; and as :func:`emulated` and :func:`emulated_hand`.
        DeviceError: as :func:`emulated_hand`.
    """
    path = Path(name)
    if name in shipped_rigs():
        raise ConfigurationError("is a built-in rig", where=name, hint=_NO_NEED)
    if is_hand_rig(path):
        return emulated_hand(load_hand_rig(path))
    if is_fingertip_rig(path):
        return emulate_sensors(load_fingertip_rig(path))
    raise ConfigurationError("is not a rig of kind fingertips or hand", where=name, hint=_NO_NEED)


@contextmanager
def emulate_sensors(rig: FingertipRig) -> Iterator[dict[str, str]]:
    """Sensors of all fingers while the context lasts; returns the address of each finger as text.

    Raises:
        ConfigurationError: an address that cannot be emulated here, or is in use.
    """
    with ExitStack() as running:
        for seed, (finger, wiring) in enumerate(rig.description.wires.items()):
            serial = getattr(wiring, "serial", "") or f"FT{seed + 1:05d}"
            sensor = EmulatedSensor(emulated_calibration(serial), seed=seed)
            try:
                EMULATORS[wiring.wire](running, wiring, sensor, rig.folder)
            except (OSError, can.CanError, ValueError) as error:
                words = getattr(error, "strerror", None) or str(error)
                raise _refusal(rig, finger, f"{place_of(wiring)} cannot be emulated ({words})") from error
        yield {finger: place_of(wiring) for finger, wiring in rig.description.wires.items()}


@contextmanager
def emulated_hand(rig: HandRig) -> Iterator[dict[str, str]]:
    """A hand at the far end of the rig's cable while the context lasts; returns its address as text.

    Raises:
        ConfigurationError: the rig names no far end.
        DeviceError: the far end cannot be served.
    """
    description = rig.description
    if description.far_end is None:
        hint = "Create a cable (ip link add A type veth peer name B), and put A in ethercat.interface and B in far_end"
        raise ConfigurationError(
            "far_end is missing, so there is no interface for the emulator", where=rig.source, hint=hint
        )
    setup = rig.setup
    serial = _EMULATED_SERIAL if (told := setup.wiring().serial) is None else told
    palm, tactile = setup.stated_palm or USUAL_PALM, description.hand.tactile
    settings = ChainSettings(palm=palm, serial=serial, eeprom="mapped", tactile=tactile)
    with EmulatedHandProcess(description.far_end, setup.joints, settings, setup.motors, setup.gains):
        yield {"hand": f"hand {serial} at {description.far_end}"}


Emulate: TypeAlias = Callable[[ExitStack, Any, EmulatedSensor, Path], None]
"""Serves a sensor at the place that a wire's settings name, until the stack ends; given the rig file's folder.

Raises OSError, CanError or ValueError when the place cannot be had.
"""

EMULATORS: Registry[Emulate] = Registry("emulator of a wire", "emulated wires", group="emulators")
"""How ``rig emulate`` serves a wire, by its name; one without is told so."""


def _net_box(running: ExitStack, wiring: NetBoxWiring, sensor: EmulatedSensor, folder: Path) -> None:
    if not ipaddress.ip_address(wiring.host).is_loopback:
        raise ValueError("only loopback addresses such as 127.0.0.2 can be")
    running.enter_context(NetBoxServer(NetBoxUnit(sensor), wiring.host, wiring.port, wiring.http_port))


def _digital(running: ExitStack, wiring: DigitalWiring, sensor: EmulatedSensor, folder: Path) -> None:
    port = running.enter_context(PtyPort(DigitalUnit(sensor, rate_hz=1000.0), wiring.baud))
    running.callback(_link(port.path, Path(wiring.port)).unlink)


def _controller(running: ExitStack, wiring: ControllerWiring, sensor: EmulatedSensor, folder: Path) -> None:
    port = running.enter_context(PtyPort(ControllerUnit(sensor), wiring.baud))
    running.callback(_link(port.path, Path(wiring.port)).unlink)


def _can_board(running: ExitStack, wiring: CanWiring, sensor: EmulatedSensor, folder: Path) -> None:
    if wiring.interface == "virtual":
        raise ValueError("a virtual bus exists only inside one program")
    running.enter_context(CanServer(CanUnit(sensor, wiring.base), open_bus(wiring)))


def _gauge_volts(running: ExitStack, wiring: VoltsWiring, sensor: EmulatedSensor, folder: Path) -> None:
    running.enter_context(_volts(wiring, sensor, folder))


EMULATORS.register("net-ft", _net_box)
EMULATORS.register("digital", _digital)
EMULATORS.register("controller", _controller)
EMULATORS.register("can-oem", _can_board)
EMULATORS.register("gauge-volts", _gauge_volts)


def _link(path: str, port: Path) -> Path:
    """A link at the port's path to a pseudo terminal; a real port is never replaced. Raises OSError."""
    port.symlink_to(path)
    return port


@contextmanager
def _volts(wiring: VoltsWiring, sensor: EmulatedSensor, folder: Path) -> Iterator[None]:
    """An acquisition program that sends what the sensor feels, through the rig's own calibration backwards."""
    to_volts = np.linalg.inv(cal_file.load(folder / wiring.calibration).working_matrix)
    pace, sent = Pace(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.bind(("127.0.0.1", 0))

        def turn() -> None:
            nonlocal sent
            for _ in range(pace.due(_VOLTS_RATE_Hz)):
                sent += 1
                program.sendto(encode_volts(sent, tuple(to_volts @ sensor.wrench())), ("127.0.0.1", wiring.local_port))
            pace.rest()

        with Background("acquisition", turn):
            yield


def _refusal(rig: FingertipRig, finger: str, what: str) -> ConfigurationError:
    return ConfigurationError(
        what, where=f"{rig.source}: wires.{finger}", hint="Choose an address that is free on this computer"
    )
