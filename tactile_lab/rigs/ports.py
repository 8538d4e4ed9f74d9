"""Ports and interfaces of this computer to which a fingertip, a bridge or a hand can be connected."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import can
from serial.tools import list_ports

from drivers.core.clock import NANOSECONDS, Clock

_STABLE_NAMES = Path("/dev/serial/by-id")
_NETWORK, _ETHERNET = Path("/sys/class/net"), "1"
_LOOK_ns = NANOSECONDS // 5


@dataclass(frozen=True)
class PortFound:
    """One port.

    Attributes:
        kind: ``serial``, ``can`` or ``network``.
        name: what to write into a rig file: the name that stays the same where the system has one.
        description: what the adapter says of itself; of a network interface, whether a cable leads somewhere.
    """

    kind: str
    name: str
    description: str


def list_all_ports() -> list[PortFound]:
    """Serial ports, then CAN interfaces of the kernel, then its Ethernet interfaces."""
    stable = {str(transport.resolve()): str(transport) for transport in _STABLE_NAMES.glob("*")}
    serial_ports = [
        PortFound("serial", stable.get(port.device, port.device), (port.description or "").replace("n/a", ""))
        for port in sorted(list_ports.comports())
    ]
    buses = can.detect_available_configs(interfaces="socketcan")
    can_ports = [PortFound("can", str(bus["channel"]), str(bus["interface"])) for bus in buses]
    return serial_ports + can_ports + [_network(name) for name in sorted(_NETWORK.glob("*")) if _is_ethernet(name)]


def _is_ethernet(interface: Path) -> bool:
    return _kernel_report(interface / "type") == _ETHERNET


def _network(interface: Path) -> PortFound:
    connected = _kernel_report(interface / "operstate") == "up"
    return PortFound("network", interface.name, "connected" if connected else "no cable, or interface down")


def _kernel_report(file: Path) -> str:
    """What the kernel says; nothing of an interface that has gone meanwhile."""
    try:
        return file.read_text().strip()
    except OSError:
        return ""


def wait_for_change(clock: Clock, before: list[PortFound], seconds: float) -> tuple[list[PortFound], list[PortFound]]:
    """Wait until a port is added or removed. Returns removed and added ports, both empty after the timeout."""
    end_ns = clock.now_ns() + round(seconds * NANOSECONDS)
    while clock.now_ns() < end_ns:
        clock.sleep_until_ns(clock.now_ns() + _LOOK_ns)
        now = list_all_ports()
        if now != before:
            return [port for port in before if port not in now], [port for port in now if port not in before]
    return [], []
