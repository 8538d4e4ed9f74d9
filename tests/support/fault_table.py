"""The sweep of all faults over all drivers, as a table of injected against counted.

python -m tests.support.fault_table --into docs/results.md
"""

from __future__ import annotations

import argparse
import runpy
from collections.abc import Iterator
from pathlib import Path

from tests.support.driver_sweep import DriverSweep
from tests.support.results_section import write_section

UNIT = Path(__file__).parents[1] / "unit"
SWEEPS = ("test_nano17_sweep.py", "test_positioner_sweep.py", "test_device_sweeps.py")
HEAD = """## Faults of the wire, injected and counted

`python -m tests.support.fault_table --into docs/results.md`: every fault against every driver, 160 cycles on virtual
time each. A driver counts a fault, stops in order with the words given, or is blind to it for the reason given; the
tests of the same sweep see that it connects again afterwards. Struck: how many messages, or how often the device.

| Driver | Fault | Struck | What the driver makes of it |
|---|---|---|---|
"""


def sweeps() -> Iterator[type[DriverSweep]]:
    """All sweeps, in the order of their files."""
    for name in SWEEPS:
        for value in runpy.run_path(str(UNIT / name)).values():
            if isinstance(value, type) and issubclass(value, DriverSweep) and value is not DriverSweep:
                yield value


def rows(sweep: type[DriverSweep]) -> Iterator[str]:
    """Driver, fault, how often it was injected, and what the driver made of it."""
    for name in sweep.fault_names():
        noted: dict[str, object] = {}
        sweep().sweep(name, noted.__setitem__)
        counted = "harmless" if name in sweep.harmless else str(noted["counted"])
        words = f"not seen: {sweep.blind[name]}" if name in sweep.blind else counted
        driver = sweep.__name__.removeprefix("Test")
        yield f"| {driver} | {name} | {noted['injected']} | {' '.join(words.split())} |\n"


def main() -> None:
    """Print the table, or write it into a document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path)
    chosen = parser.parse_args()
    table = HEAD + "".join(row for sweep in sweeps() for row in rows(sweep))
    if chosen.into:
        write_section(chosen.into, "faults", table)
    else:
        print(table)


if __name__ == "__main__":
    main()
