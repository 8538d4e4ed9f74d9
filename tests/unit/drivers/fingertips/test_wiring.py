"""What a rig file says of a finger's wire: which settings it has, where it ends, what carries it, what else to try."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from drivers.ati.wires.can_wire import CanWire
from drivers.ati.wires.controller_wire import ControllerWire
from drivers.ati.wires.digital_wire import DigitalWire
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.ati.wiring import VoltsWiring
from drivers.core.clock import VirtualClock
from drivers.core.errors import ConfigurationError
from drivers.fingertips.kinds import WIRES
from drivers.fingertips.wiring import Wiring, make_transport, make_wire, place_of
from drivers.force.wire_settings import WireSettings

READ: TypeAdapter[WireSettings] = TypeAdapter(Wiring)
TOLD: dict[str, tuple[dict[str, Any], str]] = {
    "net-ft": ({"host": "192.0.2.7"}, "the box at 192.0.2.7:49152"),
    "digital": ({"port": "/dev/ttyUSB0"}, "port /dev/ttyUSB0"),
    "controller": ({"port": "/dev/ttyUSB1", "counts_per_N": 320, "counts_per_Nm": 64_000}, "port /dev/ttyUSB1"),
}


def told(wire: str, **more: Any) -> WireSettings:
    return READ.validate_python({"wire": wire, **TOLD[wire][0], **more})


@pytest.mark.parametrize("wire", TOLD)
def test_a_wire_ends_where_its_settings_say(wire: str) -> None:
    assert place_of(told(wire)) == TOLD[wire][1]
    transport = make_transport(told(wire), "ft/ff", VirtualClock())
    assert transport.name == "ft/ff"


@pytest.mark.parametrize(
    ("wire", "kind"), [("net-ft", RdtWire), ("digital", DigitalWire), ("controller", ControllerWire)]
)
def test_each_wire_has_its_own_decoder(wire: str, kind: type, tmp_path: Path) -> None:
    assert type(make_wire(told(wire), tmp_path)) is kind


def test_a_board_on_a_bus_is_told_by_bus_and_base(tmp_path: Path) -> None:
    bus = {"wire": "can-oem", "interface": "virtual", "channel": "lab"}
    one, other = (READ.validate_python(bus | {"base": base}) for base in (18, 19))
    assert place_of(one) != place_of(other)
    assert isinstance(make_wire(one, tmp_path), CanWire)


def test_a_silent_line_is_tried_at_every_other_rate() -> None:
    kind, wiring = WIRES["digital"], told("digital", baud=115_200)
    rates = [settings.model_dump()["baud"] for settings in kind.alternatives(wiring)]
    assert sorted([115_200, *rates]) == [19_200, 115_200, 1_250_000]
    assert not WIRES["net-ft"].alternatives(told("net-ft"))


def test_only_the_file_of_gauge_volts_goes_with_a_session() -> None:
    wiring = READ.validate_python({"wire": "gauge-volts", "calibration": "a.cal", "local_port": 45000})
    assert list(WIRES["gauge-volts"].files(wiring).values()) == ["a.cal"]
    assert [dict(WIRES[wire].files(told(wire))) for wire in TOLD] == [{}, {}, {}]


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"port": "/dev/ttyUSB0"}, "wire: is missing"),
        ({"wire": "telepathy"}, "telepathy"),
        ({"wire": "digital", "port": "/dev/ttyUSB0", "baud": 9600}, "baud"),
        ({"wire": "digital", "port": "/dev/ttyUSB0", "host": "192.0.2.7"}, "host"),
    ],
)
def test_a_wire_that_is_not_there_or_has_no_such_setting_is_refused(given: dict[str, Any], complaint: str) -> None:
    with pytest.raises((ValidationError, ConfigurationError), match=complaint):
        READ.validate_python(given)


def test_a_calibration_of_another_sensor_than_the_one_plugged_in_is_refused(lab_data: Path) -> None:
    file = next(path for path in sorted((lab_data / "ati_cal").glob("*.cal")) if "FT14048" in path.name)
    wiring = {"wire": "gauge-volts", "calibration": file.name, "local_port": 45000}
    make_wire(VoltsWiring.model_validate(wiring | {"serial": "FT14048"}), file.parent)
    with pytest.raises(ConfigurationError, match="is the calibration of FT14048, but the sensor is FT99999"):
        make_wire(VoltsWiring.model_validate(wiring | {"serial": "FT99999"}), file.parent)
