"""What the estimation knew before each grasp, so that a grasp can be taken back."""

from __future__ import annotations

import copy
from typing import Any

from tactile_lab.slam import TactileSlam


class SlamMemory:
    """States of an estimation, one for each grasp it was given through :meth:`remember`.

    A state holds everything, the source of chance too: after :meth:`undo` the estimation goes on exactly as if the
    grasp had never been.

    Args:
        slam: the estimation; its states are put back into this object.
    """

    def __init__(self, slam: TactileSlam) -> None:
        self._slam = slam
        self._states: list[dict[str, Any]] = []

    def remember(self) -> None:
        """Call this before every step."""
        self._states.append(copy.deepcopy(vars(self._slam)))

    def undo(self) -> None:
        """Back to before the last step."""
        state = self._states.pop()
        vars(self._slam).clear()
        vars(self._slam).update(state)
