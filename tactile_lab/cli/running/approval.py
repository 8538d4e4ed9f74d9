"""Asks a person before every grasp of an autonomous session."""

from __future__ import annotations

import math
from collections import deque

from sessions.conductor.policy_decisions import Proposal
from tactile_lab.cli.console import people, say
from tactile_lab.cli.terminal_input import LineInput

_LOOK_s = 0.05


class TerminalApproval:
    """Shows the next grasp and accepts a veto: Enter or y executes it, n asks for the next best.

    When standard input ends, the session continues without asking. Ctrl+C ends the question.
    """

    def __init__(self) -> None:
        self._input = LineInput()
        self._typed: deque[str] = deque()
        self._alone = False

    def __call__(self, proposal: Proposal) -> bool:
        if self._alone:
            return True
        say(_in_words(proposal), "bold")
        people.print("execute it? [Y/n] ", end="")
        while not (self._typed or self._input.closed or proposal.withdrawn()):
            self._input.wait(_LOOK_s)
            self._typed.extend(self._input.lines())
        if self._typed:
            return self._typed.popleft().strip().lower() not in {"n", "no"}
        say("")
        if not proposal.withdrawn():
            self._alone = True
            say("standard input has ended: the session continues without asking", "yellow")
        return True


def _in_words(proposal: Proposal) -> str:
    plan = proposal.plan
    if proposal.weighs:
        return f"weigh the object: drag it a little to and fro, lift it a few millimetres, set it down ({plan.closing})"
    place = (
        f"x {1e3 * plan.frame.x_m:.0f} mm, y {1e3 * plan.frame.y_m:.0f} mm, yaw {math.degrees(plan.frame.yaw_rad):.0f}"
    )
    tap = ", after a tap on the top" if plan.tap else ""
    again = f" (after {proposal.vetoed} vetoed)" if proposal.vetoed else ""
    height = f"tips {1e3 * plan.height_m:.0f} mm high"
    return f"grasp {proposal.number}{again}: {plan.closing} at {place} deg, {height}{tap}; {plan.reason}"
