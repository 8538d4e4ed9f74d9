"""Every fault of a wire in the middle of a session, as a table.

python -m tests.support.session_fault_table --into docs/results.md
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.support.results_section import write_section
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


def row(rig: str, link: str, fault: str, swept: Swept) -> str:
    """One line of the table."""
    went = f"ends after {swept.after_s:.2f} s: {swept.ended}" if swept.ended else "goes on"
    unseen = "as it ended" if swept.ended else BLIND[rig][link].get(fault, "harmless")
    told = "; ".join(swept.told) or unseen
    cells = (rig, link, fault, str(swept.struck), went, told, swept.replay)
    return f"| {' | '.join(' '.join(cell.split()) for cell in cells)} |\n"


def table(rigs: list[str], only: str, row_done: Callable[[str], None]) -> str:
    """The table. Raises AssertionError for a session that hung, or that left what can not be read."""
    rows = []
    for rig in rigs:
        for link, fault in faults(rig):
            if only not in f"{link} {fault}":
                continue
            with tempfile.TemporaryDirectory() as root:
                swept = run_with(rig, {link: fault}, Path(root))
            swept.check(link, fault)
            rows.append(row(rig, link, fault, swept))
            row_done(rows[-1].strip())
    return HEAD + "".join(rows)


def main() -> None:
    """Print the table, or write it into a document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--rigs", default=",".join(LAYOUTS))
    parser.add_argument("--only", default="", help="Part of the link's or the fault's name.")
    chosen = parser.parse_args()
    text = table(chosen.rigs.split(","), chosen.only, lambda line: print(line, flush=True))
    if chosen.into:
        write_section(chosen.into, "session faults", text)


if __name__ == "__main__":
    main()
