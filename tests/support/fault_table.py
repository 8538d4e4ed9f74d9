"""The sweep of all faults over drivers, as a table of injected against counted.

python -m tests.support.fault_table tests/unit/test_nano17_sweep.py > table.md
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator

from drivers.faults import standard_faults
from tests.support.driver_sweep import DriverSweep


def rows(sweep: type[DriverSweep]) -> Iterator[tuple[str, str, str, str]]:
    """Driver, fault, how often it was injected, and what the driver made of it."""
    for name in sorted(standard_faults(sweep.layout)):
        noted: dict[str, object] = {}
        sweep().sweep(name, noted.__setitem__)
        words = sweep.blind.get(name)
        counted = f"not seen: {words}" if words else str(noted["counted"])
        yield sweep.__name__.removeprefix("Test"), name, str(noted["injected"]), " ".join(counted.split())


def main() -> None:
    """Print the table of all sweeps in the files named on the command line."""
    print("| Driver | Fault | Injected | What the driver makes of it |\n|---|---|---|---|")
    for path in sys.argv[1:]:
        found = [value for value in runpy.run_path(path).values() if isinstance(value, type)]
        for sweep in found:
            if issubclass(sweep, DriverSweep) and sweep is not DriverSweep:
                for row in rows(sweep):
                    print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
