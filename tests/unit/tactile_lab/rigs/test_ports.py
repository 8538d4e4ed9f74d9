"""Which ports there are, and which one went."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from drivers.core.clock import VirtualClock
from tactile_lab.cli.app import app
from tactile_lab.rigs import ports
from tactile_lab.rigs.ports import PortFound, list_all_ports, wait_for_change


class Port(SimpleNamespace):
    def __lt__(self, other: Port) -> bool:
        return bool(self.device < other.device)


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The kernel's folder of network interfaces: a loopback one, a CAN one, and Ethernet with a cable in it."""
    for name, kind, state in (("lo", 772, "unknown"), ("can0", 280, "up"), ("enp3s0", 1, "up")):
        interface = tmp_path / "net" / name
        interface.mkdir(parents=True)
        (interface / "type").write_text(f"{kind}\n")
        (interface / "operstate").write_text(f"{state}\n")
    monkeypatch.setattr(ports, "_NETWORK", tmp_path / "net")
    return tmp_path / "net"


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch, network: Path) -> list[Port]:
    """Two adapters, a CAN and an Ethernet interface; take one out of the list to unplug it."""
    found = [Port(device="/dev/ttyUSB1", description="RS-485"), Port(device="/dev/ttyUSB0", description="RS-232")]
    monkeypatch.setattr(ports.list_ports, "comports", lambda: list(found))
    buses = [{"interface": "socketcan", "channel": "can0"}]
    monkeypatch.setattr(ports.can, "detect_available_configs", lambda interfaces: buses)
    return found


def test_serial_ports_can_and_ethernet_interfaces_are_listed(plugged: list[Port]) -> None:
    assert list_all_ports() == [
        PortFound("serial", "/dev/ttyUSB0", "RS-232"),
        PortFound("serial", "/dev/ttyUSB1", "RS-485"),
        PortFound("can", "can0", "socketcan"),
        PortFound("network", "enp3s0", "connected"),
    ]


def test_the_port_that_goes_or_comes_is_named(plugged: list[Port]) -> None:
    before = list_all_ports()
    assert wait_for_change(VirtualClock(), before, 3.0) == ([], [])
    pulled = plugged.pop()
    assert wait_for_change(VirtualClock(), before, 3.0) == ([PortFound("serial", "/dev/ttyUSB0", "RS-232")], [])
    plugged.append(pulled)
    gone, come = wait_for_change(VirtualClock(), [port for port in before if port.name != "can0"], 3.0)
    assert (gone, [port.name for port in come]) == ([], ["can0"])


def test_a_network_cable_that_is_pulled_is_told(
    plugged: list[Port], network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pulled_while_waiting(clock: object, before: list[PortFound], seconds: float) -> object:
        (network / "enp3s0" / "operstate").write_text("down\n")
        return wait_for_change(VirtualClock(), before, seconds)

    monkeypatch.setattr(ports, "wait_for_change", pulled_while_waiting)
    told = CliRunner().invoke(app, ["rig", "list", "--watch", "30"])
    assert "enp3s0: now no cable, or interface down" in told.output


def test_the_port_that_is_unplugged_while_the_command_waits_is_named(
    plugged: list[Port], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = 0

    def comports() -> list[Port]:
        """The RS-485 adapter is pulled at the third look, and put in again before the second command."""
        nonlocal looks
        looks += 1
        return plugged[1:] if 3 <= looks < 5 else list(plugged)

    monkeypatch.setattr(ports.list_ports, "comports", comports)
    told = CliRunner().invoke(app, ["rig", "list", "--ports", "--watch", "30"])
    assert told.exit_code == 0
    assert "/dev/ttyUSB1 removed: RS-485" in told.output
    assert "nothing changed" not in told.output
    answer = CliRunner().invoke(app, ["rig", "list", "--ports", "--watch", "30", "--json"])
    assert [port["name"] for port in json.loads(answer.stdout)["come"]] == ["/dev/ttyUSB1"]


def test_a_port_is_named_by_the_name_that_stays(
    plugged: list[Port], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    names, device = tmp_path / "by-id", tmp_path / "ttyUSB0"
    names.mkdir()
    device.touch()
    (names / "usb-ATI-FF").symlink_to(device)
    plugged[1].device = str(device)
    monkeypatch.setattr(ports, "_STABLE_NAMES", names)
    assert str(names / "usb-ATI-FF") in [port.name for port in list_all_ports()]


def test_the_command_lists_them_for_people_and_programs(plugged: list[Port]) -> None:
    answer = CliRunner().invoke(app, ["rig", "list", "--ports", "--json"])
    assert answer.exit_code == 0
    names = [port["name"] for port in json.loads(answer.stdout)["ports"]]
    assert names == ["/dev/ttyUSB0", "/dev/ttyUSB1", "can0", "enp3s0"]
    told = CliRunner().invoke(app, ["rig", "list", "--ports", "--watch", "0.3"])
    assert "/dev/ttyUSB1" in told.output
    assert "nothing changed" in told.output
