"""All faults of a moving hand, as a table: time until demands are zero and joints are still, and the hand's message.

python -m tests.support.hand_fault_table --store
"""

from __future__ import annotations

from tests.support.hand_faults import FAULTS, CYCLE_s, WATCHDOG_s, run_fault
from tests.support.stored_table import GrowingTable, Outline, parser

OUTLINE = Outline(
    "hand-faults",
    "Every fault of a hand in motion: its demands are gone within two cycles of when it can be seen.",
    ("python -m tests.support.hand_fault_table --store",),
    f"All joints of the emulated hand on their way, cycle of {1000 * CYCLE_s:g} ms, watchdog of {1000 * WATCHDOG_s:g} "
    "ms, virtual time, in one process. A fault can be seen when the first status has come that shows it, or when the "
    "time is over that its rule gives it (docs/failures.md). Cycles are counted from then on: those whose demands were "
    "not all zero, and until no joint turned any more.",
    ("Fault", "Can be seen after", "Cycles with demands", "Cycles until still", "Told"),
)


def main() -> None:
    """Print the table, and store it row by row if requested."""
    chosen = parser(__doc__).parse_args()
    table = GrowingTable(chosen.docs, OUTLINE, [(name,) for name in FAULTS])
    for name, fault in FAULTS.items():
        outcome = run_fault(fault)
        told = outcome.told or "goes on by itself" if outcome.goes_on or outcome.told else "nothing"
        cells = (f"{1000 * outcome.seen_s:.0f} ms", str(outcome.driven_cycles), str(outcome.still_cycles), told)
        table.put((name,), cells)
    table.publish()


if __name__ == "__main__":
    main()
