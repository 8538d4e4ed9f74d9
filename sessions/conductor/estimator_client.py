"""Questions of a session to its estimator service, answered while the devices keep cycling.

On a simulated rig time waits: the answer is computed immediately. On real clocks another process computes it
(:mod:`tactile_lab.autonomy.estimator_process`), and the session runs cycles until it comes. The answers are the same,
bit for bit.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Protocol, Self, TypeVar

from drivers.core.errors import EstimationError, TactileLabError
from sessions.conductor.estimator import EstimatorService

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

Question = Callable[Concatenate[Any, Arguments], Answer]
"""A method of the service, named by its protocol or its class, or any function of it that can be imported by name."""


class EstimatorClient(Protocol):
    """Client of the estimator service; a context manager that is open while a session uses it."""

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """The answer.

        Raises:
            EstimationError: the question failed.
            SessionError: the service has ended.
            TactileLabError: raised by the question itself, or by a cycle that was run meanwhile.
        """

    def wait_for_person(self, question: Callable[[], Answer]) -> Answer:
        """The answer of a person; cycles run meanwhile."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class LocalClient:
    """The service runs in this process, while time waits.

    Args:
        service: the session's.
    """

    def __init__(self, service: EstimatorService) -> None:
        self._service = service

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """See :meth:`EstimatorClient.ask`."""
        return answer(self._service, question, args, kwargs)

    def wait_for_person(self, question: Callable[[], Answer]) -> Answer:
        """See :meth:`EstimatorClient.wait_for_person`."""
        return question()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing to close."""


def answer(service: Any, question: Callable[..., Answer], args: Any, kwargs: Any) -> Answer:
    """The answer to one question.

    A method is looked up on the service itself, so that a question may refer to the protocol's method.

    Raises:
        EstimationError: a program error; the error's notes say where.
        TactileLabError: raised by the question.
    """
    ask: Callable[..., Answer] = getattr(service, question.__name__, None) or partial(question, service)
    try:
        return ask(*args, **kwargs)
    except TactileLabError:
        raise
    except Exception as error:
        what = f"program error in {question.__name__} ({type(error).__name__}: {error})"
        hint = "The recording is kept; its last event says where the program failed"
        failure = EstimationError(what, where="estimation", hint=hint)
        failure.add_note("".join(traceback.format_exception(error)))
        raise failure from error


def wait_with_cycles(question: Callable[[], Answer], idle: Callable[[], None]) -> Answer:
    """The answer of a question that waits instead of computing; cycles run meanwhile."""
    future: Future[Answer] = Future()

    def wait() -> None:
        try:
            future.set_result(question())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=wait, daemon=True, name="question to a person").start()
    while not future.done():
        idle()
    return future.result()
