"""The sweep of all faults over all drivers, as a table of injected faults and the drivers' reactions.

python -m tests.support.fault_table --store
"""

from __future__ import annotations

import runpy
from collections.abc import Iterator

from tests.support.driver_sweep import DriverSweep
from tests.support.repository import REPOSITORY
from tests.support.stored_table import GrowingTable, Key, Outline, parser

UNIT = REPOSITORY / "tests" / "unit" / "drivers"
SWEEPS = ("ati/test_nano17_sweep.py", "positioner/test_positioner_sweep.py", "test_device_sweeps.py")
OUTLINE = Outline(
    "wire-faults",
    "Every fault of the wire against every driver: injected, and what the driver makes of it.",
    ("python -m tests.support.fault_table --store",),
    "160 cycles on virtual time each. A driver counts a fault, stops in order with the words given, or is blind to it "
    "for the reason given; the tests of the same sweep see that it connects again afterwards. Struck: how many "
    "messages, or how often the device.",
    ("Driver", "Fault", "Struck", "What the driver makes of it"),
    keys=2,
)


def sweeps() -> Iterator[type[DriverSweep]]:
    """All sweeps, in the order of their files."""
    for name in SWEEPS:
        for value in runpy.run_path(str(UNIT / name)).values():
            if isinstance(value, type) and issubclass(value, DriverSweep) and value is not DriverSweep:
                yield value


def driver(sweep: type[DriverSweep]) -> str:
    """Name of the tested driver."""
    return sweep.__name__.removeprefix("Test")


def rows(sweep: type[DriverSweep]) -> Iterator[tuple[Key, tuple[str, str]]]:
    """Driver and fault, how often it was injected, and the driver's reaction."""
    for name in sweep.fault_names():
        noted: dict[str, object] = {}
        sweep().sweep(name, noted.__setitem__)
        counted = "harmless" if name in sweep.harmless else str(noted["counted"])
        words = f"not seen: {sweep.blind[name]}" if name in sweep.blind else counted
        yield (driver(sweep), name), (str(noted["injected"]), words)


def main() -> None:
    """Print the table, and store it row by row if requested."""
    chosen, swept = parser(__doc__).parse_args(), list(sweeps())
    order = [(driver(sweep), name) for sweep in swept for name in sweep.fault_names()]
    table = GrowingTable(chosen.docs, OUTLINE, order)
    for sweep in swept:
        for key, cells in rows(sweep):
            table.put(key, cells)
    table.publish()


if __name__ == "__main__":
    main()
