"""What ends a guarded motion: a fingertip that feels, a joint that is held up, a motor that works against something."""

from __future__ import annotations

import numpy as np

from drivers.shadow.protocol.palm_codec import MOTORS
from sessions.motion.link_watch import LinkWatch
from sessions.motion.motion import Motion

LINKS = "links"
"""Stands for whatever link it was, where no finger tells."""

_UNFELT_N = 0.12
"""A fingertip that feels less is not what its motor works against."""


class Guard:
    """Watches one even motion after the other.

    Args:
        motion: whose last cycle is looked at.
        force_N: on a fingertip.
        held_up_rad: angle by which a joint falls behind.
    """

    def __init__(self, motion: Motion, force_N: float, held_up_rad: float) -> None:
        self._motion, self._force_N, self._held_up_rad = motion, force_N, held_up_rad
        motors = motion.runtime.perception.motors
        names = [""] * MOTORS if motors is None else motors.names
        self._fingers = np.array([name[:2] for name in names])
        self._links = LinkWatch(self._fingers == "WR")
        self.met: tuple[str, ...] = ()
        """What met something in the last motion: fingers, or :data:`LINKS`."""

    def restart(self) -> None:
        """A new motion begins."""
        self._links.restart()
        self.met = ()

    def is_met(self) -> bool:
        """Look at the last cycle; whether the hand has met anything since the motion began."""
        tips = [finger for finger, load_N in self._motion.loads_N().items() if load_N > self._force_N]
        found = (*tips, *self._motion.bent(self._held_up_rad))
        self._links.take(self._motion.motor_torques, self._motion.hand_stamp_ns)
        if self._links.is_touched or self._pushes_unfelt():
            found = (*found, LINKS)
        self.met = tuple(dict.fromkeys((*self.met, *found)))
        return bool(self.met)

    def keep_usual(self) -> None:
        """The motion has ended, and fingertips are going to be laid on."""
        self._links.keep_usual()

    def leans(self) -> bool:
        """Look at the last cycle after the motion, while fingertips are laid on; whether a link leans on something."""
        return self.leans_hard() or self._links.is_leaning

    def leans_hard(self) -> bool:
        """The same, where fingertips may press as well: only what is more than they feel."""
        self._links.take(self._motion.motor_torques, self._motion.hand_stamp_ns)
        return self._links.is_leaning_hard

    def _pushes_unfelt(self) -> bool:
        """Whether a motor whose joint stands still works against something that no tip, or not its finger's, feels."""
        pushed = set(self._fingers[self._links.pushed].tolist())
        feeling = {finger for finger, load_N in self._motion.loads_N().items() if load_N > _UNFELT_N}
        return bool(pushed - {"", "WR"} - feeling) or ("WR" in pushed and not feeling)
