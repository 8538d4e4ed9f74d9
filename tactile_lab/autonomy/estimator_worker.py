"""The estimator service in a separate process, started by :mod:`tactile_lab.autonomy.estimator_process`.

Only the session that started it writes to its pipe. Questions are computed one after the other with one thread of
the linear algebra library. A second thread only reads the pipe: when that ends, the process ends immediately, whatever
it is doing.
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

from drivers.core.child_process import say
from drivers.core.errors import TactileLabError
from drivers.core.extensions import load_named_extensions
from drivers.core.orders import END, Order, OrderReader
from sessions.conductor.estimator_client import answer
from tactile_lab.autonomy.slam_service import SlamService

_QUESTIONS = 1
"""Size of the queue; the session asks one question at a time."""


def pack(content: Any) -> str:
    """Objects as text, only for a pipe between two processes of one session."""
    return base64.b64encode(pickle.dumps(content, protocol=pickle.HIGHEST_PROTOCOL)).decode()


def unpack(text: str) -> Any:
    """What :func:`packed` was given."""
    return pickle.loads(base64.b64decode(text))


def main() -> None:
    """Answer until the pipe ends."""
    load_named_extensions()  # before anything of theirs comes through the pipe
    waiting = queue.Queue[Order](_QUESTIONS)
    threading.Thread(target=_read, args=(OrderReader(sys.stdin.fileno()), waiting), daemon=True).start()
    with threadpool_limits(limits=1, user_api="blas"):
        service: SlamService = unpack(waiting.get()["service"])
        say({"ready": True})
        while True:
            say(_answer(service, waiting.get()["question"]))


def _read(reader: OrderReader, waiting: queue.Queue[Order]) -> None:
    while True:
        for order in reader.waiting(1.0):
            if order == END:
                os._exit(0)
            waiting.put(order)


def _answer(service: SlamService, packed_question: str) -> dict[str, str]:
    question, args, kwargs = unpack(packed_question)
    try:
        return {"answer": pack(answer(service, question, args, kwargs))}
    except TactileLabError as error:
        return {"raised": pack(error)}


if __name__ == "__main__":
    main()
