"""Client of the estimator service in a separate process: asks it, and runs cycles until it answers.

So estimation and planning cannot delay a cycle. Only one question is open at a time: if a failing device interrupted
the session while it waited, the next question also waits for that answer, and the missed estimate comes with the next
one. When the session has ended the estimation is transferred back: its
:class:`~tactile_lab.slam.tactile_slam.TactileSlam` is then as if it had always been in this process.
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
"""Longest wait for the estimation's last step when the session ends; then it is discarded."""


class EstimatorProcess:
    """An estimator service in another process, which runs while this context is open.

    Args:
        service: of the session, unused; a copy of it answers.
        idle: runs one cycle of the devices.
    """

    def __init__(self, service: SlamService, idle: Callable[[], None]) -> None:
        self._slam, self._start, self._idle = service.slam, pack(service), idle
        self._child = ChildProcess("tactile_lab.autonomy.estimator_worker", NAME)
        self._open = False
        """Whether a question is unanswered."""

    @property
    def process_id(self) -> int:
        """Process id of the other process. Raises DeviceError if it does not run."""
        return self._child.process_id

    def __enter__(self) -> Self:
        """Start the process and wait until it can answer: only starting disturbs cycles.

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
        """Transfer the estimation back if possible, and end the process."""
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
    """The content of an answer. Raises the error that it contains."""
    if "raised" in answer:
        raise unpack(answer["raised"])
    return unpack(answer["answer"])


def client_for(clock: Clock, service: SlamService, idle: Callable[[], None]) -> LocalClient | EstimatorProcess:
    """The estimator client for a session with this clock."""
    return LocalClient(service) if isinstance(clock, VirtualClock) else EstimatorProcess(service, idle)
