"""Questions of a session to its :class:`~sessions.thinker.Thinker`, and how they are answered without starving devices.

On a simulated rig time waits: the answer is computed on the spot. On real clocks another process computes it
(:mod:`sessions.thinker_process`), and the session runs cycles until it comes. The answers are the same, bit for bit.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Protocol, Self, TypeVar

from sessions.thinker import Thinker
from tactile_lab.errors import EstimationError, TactileLabError

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

Question = Callable[Concatenate[Thinker, Arguments], Answer]
"""A method of the thinker, or any function of it that can be imported by name."""


class Thinking(Protocol):
    """Where the thinker lives; a context while a session asks."""

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """The answer.

        Raises:
            EstimationError: the question failed.
            SessionError: whoever thinks is gone.
            TactileLabError: as the question itself, or as a cycle that was run meanwhile.
        """

    def beside(self, question: Callable[[], Answer]) -> Answer:
        """The answer of a person, who takes his time."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class ThinkingHere:
    """The thinker lives in this process, and time waits for it.

    Args:
        thinker: of the session.
    """

    def __init__(self, thinker: Thinker) -> None:
        self._thinker = thinker

    def ask(self, question: Question[Arguments, Answer], *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        """See :meth:`Thinking.ask`."""
        return answered(self._thinker, question, args, kwargs)

    def beside(self, question: Callable[[], Answer]) -> Answer:
        """See :meth:`Thinking.beside`."""
        return question()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing to end."""


def answered(thinker: Thinker, question: Callable[..., Answer], args: Any, kwargs: Any) -> Answer:
    """The answer.

    Raises:
        EstimationError: the program itself failed; where it did stands in the error's notes.
        TactileLabError: as the question.
    """
    try:
        return question(thinker, *args, **kwargs)
    except TactileLabError:
        raise
    except Exception as error:
        what = f"failed in {question.__name__} ({type(error).__name__}: {error})"
        hint = "What was recorded is kept; its last event says where the program failed"
        failure = EstimationError(what, where="estimation", hint=hint)
        failure.add_note("".join(traceback.format_exception(error)))
        raise failure from error


def idling(question: Callable[[], Answer], idle: Callable[[], None]) -> Answer:
    """The answer of a question that waits rather than computes; cycles run meanwhile."""
    answer: Future[Answer] = Future()

    def wait() -> None:
        try:
            answer.set_result(question())
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=wait, daemon=True, name="question to a person").start()
    while not answer.done():
        idle()
    return answer.result()
