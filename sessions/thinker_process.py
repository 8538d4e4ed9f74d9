"""The thinker in a process of its own, seen from the session: ask it, and run cycles until it answers.

So that no estimation and no planning can delay a cycle. One question is on its way at a time, and nothing queues up:
where a failing device interrupted the session while it waited, the next question waits for that answer too, and what
was estimated comes with the next estimate. The estimation comes home when the session has ended: its
:class:`~tactile_lab.slam.TactileSlam` then is as if it had been here all the time.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, cast

from drivers.child_process import ChildProcess
from sessions.thinker import Thinker
from sessions.thinker_worker import packed, unpacked
from sessions.thinking import Answer, Arguments, Question, ThinkingHere, idling
from tactile_lab.clock import Clock, VirtualClock
from tactile_lab.errors import DeviceError, SessionError

NAME = "estimation"
_START_s = 120.0
_HOME_s = 60.0
"""The estimation's last step may still be on its way when the session ends; it is thrown away after this."""


class ThinkerProcess:
    """A thinker in another process, which runs while this is open.

    Args:
        thinker: of the session, not used yet; a copy of it thinks.
        idle: runs one cycle of the devices.
    """

    def __init__(self, thinker: Thinker, idle: Callable[[], None]) -> None:
        self._slam, self._start, self._idle = thinker.slam, packed(thinker), idle
        self._child = ChildProcess("sessions.thinker_worker", NAME)
        self._open = False
        """A question has no answer yet."""

    @property
    def process_id(self) -> int:
        """Of the other process. Raises DeviceError when it does not run."""
        return self._child.process_id

    def __enter__(self) -> Self:
        """Start the process and wait until it can think: starting is the one thing of it that disturbs cycles.

        Raises:
            SessionError: it does not start.
        """
        try:
            self._child.start({"thinker": self._start})
            self._child.ready(_START_s)
        except DeviceError as error:
            raise self._gone() from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Bring the estimation home, or leave this one fresh where it can not be had, and end the process."""
        try:
            if kind is None and self._child.running:
                self._come_home()
        except SessionError:
            return  # gone, or busy for too long: whoever finishes the estimation has all grasps and makes it anew
        finally:
            self._child.close()

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """See :meth:`sessions.thinking.Thinking.ask`."""
        while self._open and self._heard(0.0) is None:
            self._idle()
        self._give(question, args, kwargs)
        while (answer := self._heard(0.0)) is None:
            self._idle()
        return cast(Answer, _opened(answer))

    def beside(self, question: Callable[[], Answer]) -> Answer:
        """See :meth:`sessions.thinking.Thinking.beside`."""
        return idling(question, self._idle)

    def _come_home(self) -> None:
        if self._open:
            self._awaited()
        self._give(Thinker.state, (), {})
        state = _opened(self._awaited())
        vars(self._slam).clear()
        vars(self._slam).update(state)

    def _give(self, question: Callable[..., Any], args: Any, kwargs: Any) -> None:
        try:
            self._child.give({"question": packed((question, args, kwargs))})
        except DeviceError as error:
            raise self._gone() from error
        self._open = True

    def _heard(self, patience_s: float) -> dict[str, str] | None:
        """The open question's answer; None while there is none."""
        try:
            answer = self._child.hear(patience_s)
        except DeviceError as error:
            raise self._gone() from error
        self._open = answer is None
        return answer

    def _awaited(self) -> dict[str, str]:
        if (answer := self._heard(_HOME_s)) is None:
            raise SessionError(f"has not answered for {_HOME_s:g} s", where=NAME)
        return answer

    def _gone(self) -> SessionError:
        hint = "What was recorded is kept and is estimated anew; see whether memory was short"
        return SessionError("its process has ended", where=NAME, hint=hint)


def _opened(answer: dict[str, str]) -> Any:
    """What an answer holds. Raises the error that it holds."""
    if "raised" in answer:
        raise unpacked(answer["raised"])
    return unpacked(answer["answer"])


def thinking_for(clock: Clock, thinker: Thinker, idle: Callable[[], None]) -> ThinkingHere | ThinkerProcess:
    """Where a session on this clock thinks."""
    return ThinkingHere(thinker) if isinstance(clock, VirtualClock) else ThinkerProcess(thinker, idle)
