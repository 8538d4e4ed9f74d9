"""The thinker's own process: ``python -m sessions.thinker_worker``; see :mod:`sessions.thinker_process`.

Only the session that started it writes to its pipe. Questions are computed one after the other with one thread of
the linear algebra library. A second thread does nothing but read the pipe: when that ends, so does the process, at
once and whatever it is busy with, as nothing it holds is of use to anyone then.
"""

from __future__ import annotations

import base64
import os
import pickle
import queue
import sys
import threading
from typing import Any

from threadpoolctl import threadpool_limits

from drivers.child_process import say
from drivers.orders import END, Order, OrderReader
from sessions.thinker import Thinker
from sessions.thinking import answered
from tactile_lab.errors import TactileLabError

_QUESTIONS = 1
"""So many may wait, as the session asks one at a time."""


def packed(content: Any) -> str:
    """Objects as text, for a pipe between two processes of one session and nothing else."""
    return base64.b64encode(pickle.dumps(content, protocol=pickle.HIGHEST_PROTOCOL)).decode()


def unpacked(text: str) -> Any:
    """What :func:`packed` was given."""
    return pickle.loads(base64.b64decode(text))


def main() -> None:
    """Answer until the pipe ends."""
    waiting = queue.Queue[Order](_QUESTIONS)
    threading.Thread(target=_read, args=(OrderReader(sys.stdin.fileno()), waiting), daemon=True).start()
    with threadpool_limits(limits=1, user_api="blas"):
        thinker: Thinker = unpacked(waiting.get()["thinker"])
        say({"ready": True})
        while True:
            say(_answer(thinker, waiting.get()["question"]))


def _read(reader: OrderReader, waiting: queue.Queue[Order]) -> None:
    while True:
        for order in reader.waiting(1.0):
            if order == END:
                os._exit(0)
            waiting.put(order)


def _answer(thinker: Thinker, packed_question: str) -> dict[str, str]:
    question, args, kwargs = unpacked(packed_question)
    try:
        return {"answer": packed(answered(thinker, question, args, kwargs))}
    except TactileLabError as error:
        return {"raised": packed(error)}


if __name__ == "__main__":
    main()
