"""Who attends a session, as chosen on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Literal

from sessions.guided.operator import Operator, Together
from sessions.guided.simulated_operator import SimulatedOperator
from sessions.recording.recorder import TrafficSink
from tactile_lab.cli.console import say, warn
from tactile_lab.cli.running.guided_terminal import terminal_for
from tactile_lab.cli.running.live_address import LiveAddress, serve_live
from tactile_lab.cli.running.page_address import PageAddress
from tactile_lab.view.feed import ViewFeed
from tactile_lab.workflow.attending import Attendance


@dataclass(frozen=True)
class GuidedWay:
    """How a session is guided, as chosen on the command line.

    Attributes:
        led_by: how the hand is moved; None for the rig's setting.
        automatic: capture automatically; None for the rig's setting.
        pedal: additional key that captures.
        pace: simulated seconds per real second.
        no_input: a simulated operator follows the prompts.
    """

    led_by: Literal["keys", "hand"] | None
    automatic: bool | None
    pedal: str
    pace: float
    no_input: bool


@contextmanager
def attendance(
    way: GuidedWay | None, page: PageAddress | None, live: LiveAddress | None, title: str
) -> Iterator[Attendance]:
    """The people attending while the session runs; the terminal is restored afterwards.

    Args:
        way: None for an autonomous session.
        page: address of the live page; None for no page.
        live: address of the server for viewers; None for no server.
        title: title of the page.

    Raises:
        ConfigurationError: the pedal's key is unknown, a package is missing, or the page or the server cannot be opened
            there.
        ProcessError: its process does not start.
    """
    with ExitStack() as stack:
        feed = None if page is None else stack.enter_context(_page(page, title))
        operators: list[Operator] = [] if feed is None else [feed]
        onlookers: list[TrafficSink] = [] if feed is None else [feed]
        if live is not None:
            onlookers.append(stack.enter_context(serve_live(live, title)))
        if way is not None and way.no_input:
            operators.append(SimulatedOperator())
        elif way is not None:
            terminal = terminal_for(way.pedal)
            stack.enter_context(terminal)
            operators.append(terminal)
        yield _attendance(way, Together(*operators) if operators else None, tuple(onlookers))


def _attendance(way: GuidedWay | None, operator: Operator | None, onlookers: tuple[TrafficSink, ...]) -> Attendance:
    if way is None:
        return Attendance(operator, onlookers=onlookers)
    pace = 0.0 if way.no_input else way.pace
    return Attendance(operator, True, way.led_by, way.automatic, pace, onlookers)


@contextmanager
def _page(page: PageAddress, title: str) -> Iterator[ViewFeed]:
    address, port, token, certificate = page.check()
    with ViewFeed(address, port, token, title, certificate=certificate) as feed:
        say(f"page: {feed.url}")
        yield feed
    if feed.dropped:
        warn(f"the page was slower than the session: {feed.dropped} messages were not shown, but all are recorded")
