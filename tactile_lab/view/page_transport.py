"""A page as a process of its own, and the way there and back: messages out, lines in, and never a wait.

What the page is to show goes through a bounded queue to a thread that writes to the process's standard input: a page
that is slow, stopped or dead holds up that thread and nothing else, and what does not fit into the queue is counted and
left out.
"""

from __future__ import annotations

import base64
import contextlib
import json
import queue
import subprocess
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Literal, Self

from drivers.core.child_process import child_command, child_environment
from drivers.core.errors import DeviceError
from tactile_lab.view.scene import SHOWN_TOPICS

QUEUE_LENGTH = 400
"""Messages that may wait: some ten seconds of a session."""
START_TIMEOUT_s = 60.0
_END_TIMEOUT_s = 2.0
_LINE_BYTES = 10_000


class PageTransport(ABC):
    """A page that is started, given what it shows, and listened to; a :class:`~.recorder.TrafficSink`.

    Args:
        panel: whose buttons the page has.
        address, port: where the page listens; port 0 takes a free one.
        token: what a visitor has to show; "" for none, on the loopback interface only.
        title: of the page.
    """

    def __init__(self, panel: Literal["session", "wizard"], address: str, port: int, token: str, title: str) -> None:
        self._settings = {"panel": panel, "address": address, "port": port, "token": token, "title": title}
        self.dropped = 0
        """Messages that were left out because the page did not keep up."""
        self.url = ""
        """Where the page is, once it is there."""
        self._queue: queue.Queue[bytes | None] = queue.Queue(QUEUE_LENGTH)
        self._process: subprocess.Popen[bytes] | None = None
        self._ready = threading.Event()
        self._problem = ""
        self._threads: list[threading.Thread] = []

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """Start the page and wait until it listens. Raises DeviceError when it does not."""
        self._process = subprocess.Popen(
            child_command("tactile_lab.view.process"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env=child_environment(),
        )
        self._queue.put_nowait(json.dumps(self._settings).encode() + b"\n")
        for work in (self._send, self._listen):
            thread = threading.Thread(target=work, name="page", daemon=True)
            thread.start()
            self._threads.append(thread)
        if not self._ready.wait(START_TIMEOUT_s) or self._problem:
            self.close()
            text = self._problem or f"did not start within {START_TIMEOUT_s:.0f} s"
            raise DeviceError(text, where="page", hint="Choose another --view-port, or go on without --view")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the page; bounded in time, whatever state the page is in."""
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(None)
        try:
            process.wait(_END_TIMEOUT_s)
        except subprocess.TimeoutExpired:
            process.kill()  # a stopped process hears nothing else
            process.wait()
        for thread in self._threads:
            thread.join(_END_TIMEOUT_s)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    @property
    def pid(self) -> int | None:
        """Process id of the page while it runs."""
        return None if self._process is None else self._process.pid

    # --- out ---------------------------------------------------------------------------------------------------

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Show this; at once, whatever the page does."""
        if topic not in SHOWN_TOPICS:
            return
        content = {"topic": topic, "stamp_ns": stamp_ns, "dropped": self.dropped}
        line = json.dumps({**content, "data": base64.b64encode(data).decode()})
        try:
            self._queue.put_nowait(line.encode() + b"\n")
        except queue.Full:
            self.dropped += 1

    def _send(self) -> None:
        """Thread: from the queue to the page; may be held up for as long as the page is."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        try:
            while (line := self._queue.get()) is not None:
                process.stdin.write(line)
                process.stdin.flush()
            process.stdin.close()
        except (OSError, ValueError):  # the page is gone: the queue fills, and what follows is counted
            return

    # --- in ----------------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        """Thread: what the page says, line by line, until it ends."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        with contextlib.suppress(OSError, ValueError):
            while line := process.stdout.readline(_LINE_BYTES):
                self._on_line(line)
        if not self._ready.is_set():
            self._problem = self._problem or "ended before it listened"
            self._ready.set()

    def _on_line(self, line: bytes) -> None:
        """One line of the page; lines that mean nothing are left out."""
        try:
            content = json.loads(line)
            if "url" in content or "problem" in content:
                self.url, self._problem = str(content.get("url", "")), str(content.get("problem", ""))
                self._ready.set()
            else:
                self.on_press(content)
        except (ValueError, TypeError, AttributeError):
            return

    @abstractmethod
    def on_press(self, content: Mapping[str, Any]) -> None:
        """What was pressed, in the thread that listens. Raises ValueError or TypeError for what means nothing."""
