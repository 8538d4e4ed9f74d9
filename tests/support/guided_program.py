"""``tactile-lab`` with a cable that a test can unplug: while the file given first exists, a fingertip is unplugged."""

from __future__ import annotations

import sys
from pathlib import Path

import tactile_lab.rigs.build
from drivers.simulation.world import SimulatedWorld
from tactile_lab.cli.main import main

LINK = "ft/MF"


class PullableWorld(SimulatedWorld):
    """A simulated world that checks for the file before it advances."""

    cable = Path()

    def advance_to(self, deadline_ns: int) -> None:
        (self.unplug if self.cable.exists() else self.plug_in)(LINK)
        super().advance_to(deadline_ns)


if __name__ == "__main__":
    PullableWorld.cable = Path(sys.argv.pop(1))
    tactile_lab.rigs.build.SimulatedWorld = PullableWorld  # type: ignore[attr-defined]
    main()
