"""Every fault of a wire in the middle of a session, as a table.

python -m tests.support.session_fault_table --into docs/results.md
python -m tests.support.session_fault_table --into docs/results.md --missing
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.results_section import GrowingTable, Key
from tests.support.session_sweep import (
    BLIND,
    LAYOUTS,
    LONGEST_s,
    STRIKES_AT_s,
    Swept,
    UNTIL_IT_MOVES_s,
    faults,
    run_with,
)

TIMES = ", ".join(
    [f"{link} {most:g} s" for link, most in LONGEST_s.items()]
    + [f"{link}, {fault} {most:g} s" for (link, fault), most in UNTIL_IT_MOVES_s.items()]
)
HEAD = f"""## Faults in the middle of a session

`python -m tests.support.session_fault_table --into docs/results.md`: a session of one grasp on the box, seed 1, for
every fault of every link, from second {STRIKES_AT_s:g} on: the fingers are closing; the first picture comes later.
A session ends in order within the time stated ({TIMES}), or goes on. In both cases
its recording was then read without loss and replayed: results identical byte for byte, where the session came to any.
Told: what its events and its record say, with the figures at the end.

| Rig | Link | Fault | Struck | The session | Told and stored | Replay |
|---|---|---|---:|---|---|---|
"""


def cells(rig: str, link: str, fault: str, swept: Swept) -> tuple[str, ...]:
    """One line of the table, behind its link and fault."""
    went = f"ends after {swept.after_s:.2f} s: {swept.ended}" if swept.ended else "goes on"
    unseen = "as it ended" if swept.ended else BLIND[rig][link].get(fault, "harmless")
    told = "; ".join(swept.told) or unseen
    return str(swept.struck), went, told, swept.replay


def run(table: GrowingTable, keys: Sequence[Key]) -> None:
    """Run sessions. Raises AssertionError for one that hung, or that left what can not be read."""
    for rig, link, fault in keys:
        with tempfile.TemporaryDirectory() as root:
            swept = run_with(rig, {link: fault}, Path(root))
        swept.check(link, fault)
        table.put((rig, link, fault), cells(rig, link, fault, swept))


def main() -> None:
    """Print the table, or write it into a document row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--rigs", default=",".join(LAYOUTS))
    parser.add_argument("--only", default="", help="Part of the link's or the fault's name.")
    parser.add_argument("--missing", action="store_true", help="Only what the document does not have.")
    chosen = parser.parse_args()
    table = GrowingTable(
        chosen.into, "session faults", HEAD, [(rig, *fault) for rig in LAYOUTS for fault in faults(rig)]
    )
    asked = [(rig, *fault) for rig in chosen.rigs.split(",") for fault in faults(rig) if chosen.only in " ".join(fault)]
    run(table, [key for key in asked if not chosen.missing or key in table.missing])


if __name__ == "__main__":
    main()
