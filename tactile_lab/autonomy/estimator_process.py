"""The estimator service in a process of its own, seen from the session: ask it, and run cycles until it answers.

So that no estimation and no planning can delay a cycle. One question is on its way at a time, and nothing queues up:
where a failing device interrupted the session while it waited, the next question waits for that answer too, and what
was estimated comes with the next estimate. The estimation comes home when the session has ended: its
:class:`~tactile_lab.slam.tactile_slam.TactileSlam` then is as if it had been here all the time.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, cast

from drivers.core.child_process import ChildProcess
from drivers.core.clock import Clock, VirtualClock
from drivers.core.errors import DeviceError, SessionError
from sessions.conductor.estimator_client import Answer, Arguments, LocalClient, Question, wait_with_cycles
from tactile_lab.autonomy.estimator_worker import pack, unpack
from tactile_lab.autonomy.slam_service import SlamService

NAME = "estimation"
_START_s = 120.0
_HOME_s = 60.0
"""The estimation's last step may still be on its way when the session ends; it is thrown away after this."""


class EstimatorProcess:
    """An estimator service in another process, which runs while this is open.

    Args:
        service: of the session, not used yet; a copy of it answers.
        idle: runs one cycle of the devices.
    """

    def __init__(self, service: SlamService, idle: Callable[[], None]) -> None:
        self._slam, self._start, self._idle = service.slam, pack(service), idle
        self._child = ChildProcess("tactile_lab.autonomy.estimator_worker", NAME)
        self._open = False
        """A question has no answer yet."""

    @property
    def process_id(self) -> int:
        """Of the other process. Raises DeviceError when it does not run."""
        return self._child.process_id

    def __enter__(self) -> Self:
        """Start the process and wait until it can answer: starting is the one thing of it that disturbs cycles.

        Raises:
            SessionError: it does not start.
        """
        try:
            self._child.start({"service": self._start})
            self._child.ready(_START_s)
        except DeviceError as error:
            raise self._gone_error() from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Bring the estimation home, or leave this one fresh where it cannot be had, and end the process."""
        try:
            if kind is None and self._child.running:
                self._come_home()
        except SessionError:
            return  # gone, or busy for too long: whoever finishes the estimation has all grasps and makes it anew
        finally:
            self._child.close()

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """See :meth:`sessions.conductor.estimator_client.EstimatorClient.ask`."""
        while self._open and self._hear(0.0) is None:
            self._idle()
        self._give(question, args, kwargs)
        while (answer := self._hear(0.0)) is None:
            self._idle()
        return cast(Answer, _unpack_answer(answer))

    def wait_for_person(self, question: Callable[[], Answer]) -> Answer:
        """See :meth:`sessions.conductor.estimator_client.EstimatorClient.wait_for_person`."""
        return wait_with_cycles(question, self._idle)

    def _come_home(self) -> None:
        if self._open:
            self._await()
        self._give(SlamService.state, (), {})
        state = _unpack_answer(self._await())
        vars(self._slam).clear()
        vars(self._slam).update(state)

    def _give(self, question: Callable[..., Any], args: Any, kwargs: Any) -> None:
        try:
            self._child.give({"question": pack((question, args, kwargs))})
        except DeviceError as error:
            raise self._gone_error() from error
        self._open = True

    def _hear(self, patience_s: float) -> dict[str, str] | None:
        """The open question's answer; None while there is none."""
        try:
            answer = self._child.hear(patience_s)
        except DeviceError as error:
            raise self._gone_error() from error
        self._open = answer is None
        return answer

    def _await(self) -> dict[str, str]:
        if (answer := self._hear(_HOME_s)) is None:
            raise SessionError(f"has not answered for {_HOME_s:g} s", where=NAME)
        return answer

    def _gone_error(self) -> SessionError:
        hint = "The recording is kept and will be estimated again; check whether memory ran out"
        return SessionError("its process has ended", where=NAME, hint=hint)


def _unpack_answer(answer: dict[str, str]) -> Any:
    """What an answer holds. Raises the error that it holds."""
    if "raised" in answer:
        raise unpack(answer["raised"])
    return unpack(answer["answer"])


def client_for(clock: Clock, service: SlamService, idle: Callable[[], None]) -> LocalClient | EstimatorProcess:
    """Where a session on this clock asks."""
    return LocalClient(service) if isinstance(clock, VirtualClock) else EstimatorProcess(service, idle)
