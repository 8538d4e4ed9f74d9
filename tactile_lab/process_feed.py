"""Feeds a process that shows a session to people elsewhere: a page, or a server for viewers.

Messages go through a bounded queue to a thread that writes to the process's standard input: a process that is slow,
stopped or dead blocks only that thread, and messages that do not fit into the queue are counted and dropped.
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
from typing import Any, Self

from drivers.core.child_process import child_command, child_environment
from drivers.core.errors import ConfigurationError, ProcessError, TactileLabError

QUEUE_LENGTH = 400
"""Size of the queue in messages: about ten seconds of a session."""
START_TIMEOUT_s = 60.0
_END_TIMEOUT_s = 2.0
_LINE_BYTES = 10_000


class ProcessFeed(ABC):
    """Starts the process, sends it messages and receives its requests; a :class:`~.recorder.TrafficSink`.

    Args:
        module: its program: reads settings and messages as lines of JSON, and says its ``url``, or a ``problem``
            with its ``exit_code``.
        settings: its first line.
        name: for messages, such as ``page``.
        hint: what to do if it does not start.
    """

    def __init__(self, module: str, settings: Mapping[str, Any], *, name: str, hint: str) -> None:
        self._module, self._settings, self._name, self._hint = module, dict(settings), name, hint
        self.dropped = 0
        """Messages that were dropped because the process did not keep up."""
        self.url = ""
        """Its address, once it listens."""
        self._queue: queue.Queue[bytes | None] = queue.Queue(QUEUE_LENGTH)
        self._process: subprocess.Popen[bytes] | None = None
        self._ready = threading.Event()
        self._problem: TactileLabError | None = None
        self._threads: list[threading.Thread] = []

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """Start the process and wait until it listens.

        Raises:
            ConfigurationError: what it was given, such as an address, cannot be used.
            ProcessError: it does not start.
        """
        self._process = subprocess.Popen(
            child_command(self._module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env=child_environment(),
        )
        self._queue.put_nowait(json.dumps(self._settings).encode() + b"\n")
        for work in (self._send, self._listen):
            thread = threading.Thread(target=work, name=self._name, daemon=True)
            thread.start()
            self._threads.append(thread)
        if not self._ready.wait(START_TIMEOUT_s) or self._problem:
            self.close()
            raise self._problem or self._failed(f"did not start within {START_TIMEOUT_s:.0f} s")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process, in limited time, whatever its state."""
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
        """Process id while it runs."""
        return None if self._process is None else self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process was started, and has not ended."""
        return self._process is not None and self._process.poll() is None

    # --- out ---------------------------------------------------------------------------------------------------

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Queue a message, without waiting."""
        if not self.is_shown(topic, data):
            return
        content = {"topic": topic, "stamp_ns": stamp_ns, "dropped": self.dropped}
        line = json.dumps({**content, "data": base64.b64encode(data).decode()})
        try:
            self._queue.put_nowait(line.encode() + b"\n")
        except queue.Full:
            self.dropped += 1

    def _send(self) -> None:
        """Thread: from the queue to the process; blocks for as long as that does."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        try:
            while (line := self._queue.get()) is not None:
                process.stdin.write(line)
                process.stdin.flush()
            process.stdin.close()
        except (OSError, ValueError):  # it is gone: the queue fills, and what follows is counted
            return

    # --- in ----------------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        """Thread: reads the process's output line by line until it ends."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        with contextlib.suppress(OSError, ValueError):
            while line := process.stdout.readline(_LINE_BYTES):
                self._on_line(line)
        if not self._ready.is_set():
            self._problem = self._problem or self._failed("ended before it listened")
            self._ready.set()

    def _on_line(self, line: bytes) -> None:
        """Process one line; invalid lines are ignored."""
        try:
            content = json.loads(line)
            if "url" in content or "problem" in content:
                self.url = str(content.get("url", ""))
                self._problem = self._told(content) if "problem" in content else None
                self._ready.set()
            else:
                self.on_press(content)
        except (ValueError, TypeError, AttributeError):
            return

    def _told(self, content: Mapping[str, Any]) -> TactileLabError:
        """Why it does not start, in its own words."""
        given = content.get("exit_code") == ConfigurationError.exit_code
        return (ConfigurationError if given else ProcessError)(str(content["problem"]), where=self._name)

    def _failed(self, what: str) -> ProcessError:
        return ProcessError(what, where=self._name, hint=self._hint)

    @abstractmethod
    def is_shown(self, topic: str, data: bytes) -> bool:
        """Whether the process needs a message of a topic."""

    @abstractmethod
    def on_press(self, content: Mapping[str, Any]) -> None:
        """A button was pressed; called in the reading thread. Raises ValueError or TypeError for an invalid message."""
