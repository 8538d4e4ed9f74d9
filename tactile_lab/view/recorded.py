"""Shows a recorded or running session from its files, without affecting it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from drivers.core.clock import NANOSECONDS, Clock
from sessions.recording.session import Session
from sessions.recording.traffic.reader import TrafficMessage
from tactile_lab.view.scene import SHOWN_TOPICS, Scene

_POLL_s, _POLL_SHARE = 1.0, 5.0
"""A running session is read again after a second, or after five times the duration of reading."""
_DRAW_ns = NANOSECONDS // 10


def shown_messages(session: Session, skip: int = 0) -> Iterator[TrafficMessage]:
    """Messages of a session so far that a page shows, without the first ``skip``. Raises SessionError."""
    for number, message in enumerate(session.traffic().messages_on(SHOWN_TOPICS)):
        if number >= skip:
            yield message


def play(session: Session, scene: Scene, draw: Callable[[], None], clock: Clock, speed: float) -> int:
    """Show a recording at ``speed`` times its pace, or immediately for 0. Returns the number of messages."""
    begun_ns, first_ns, drawn_ns, count = clock.now_ns(), None, None, 0
    for message in shown_messages(session):
        first_ns = message.stamp_ns if first_ns is None else first_ns
        scene.take(message.topic, message.data, message.stamp_ns)
        count += 1
        if speed <= 0.0:
            continue
        due_ns = begun_ns + round((message.stamp_ns - first_ns) / speed)
        if drawn_ns is None or due_ns - drawn_ns > _DRAW_ns:
            draw()
            drawn_ns = due_ns
            clock.sleep_until_ns(due_ns)
    draw()
    return count


def follow(session: Session, scene: Scene, draw: Callable[[], None], clock: Clock, seen: int) -> None:
    """Show new messages until the session is closed. Raises SessionError."""
    while Session.open(session.folder).manifest.status == "open":
        begun_ns = clock.now_ns()
        for message in shown_messages(session, seen):
            scene.take(message.topic, message.data, message.stamp_ns)
            seen += 1
        draw()
        spent_ns = clock.now_ns() - begun_ns
        clock.sleep_until_ns(clock.now_ns() + max(round(_POLL_s * NANOSECONDS), round(_POLL_SHARE * spent_ns)))
