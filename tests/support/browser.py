"""A headless Chromium controlled through its DevTools protocol, to read and press what a person sees in a page."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENCE_s = 60.0
_PAUSE_ms = 250
_SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-gpu",
    "--window-size=800,300",
)


def chromium() -> str | None:
    """Path of the browser; None if there is none."""
    return next((path for name in PROGRAMS if (path := shutil.which(name))), None)


def until(true: Callable[[], Any], what: str, patience_s: float = PATIENCE_s) -> Any:
    """Wait until something is true, and return it. Raises AssertionError after too long a time."""
    give_up = time.monotonic() + patience_s
    while not (found := true()):
        assert time.monotonic() < give_up, f"waited in vain for {what}"
        time.sleep(0.05)
    return found


class Browser:
    """A browser with one page.

    Args:
        program: see :func:`chromium`.
        url: address of the page.
        profile: an empty folder.
    """

    def __init__(self, program: str, url: str, profile: Path) -> None:
        words = [program, *_SWITCHES, f"--user-data-dir={profile}", "--remote-debugging-port=0", url]
        self._process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._told, self._number = profile / "DevToolsActivePort", 0
        self._socket: ClientConnection | None = None

    def __enter__(self) -> Self:
        try:
            until(lambda: self._told.is_file() and self._told.read_text().count("\n"), "the browser")
            port = self._told.read_text().split()[0]
            pages = until(lambda: _pages(port), "a page")
            self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def _end(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._process.terminate()
        self._process.wait(PATIENCE_s)

    def do(self, method: str, **parameters: Any) -> Any:
        """Send one command of the protocol; returns its result. Raises AssertionError if the browser refuses it."""
        assert self._socket is not None
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(PATIENCE_s))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def evaluate(self, script: str) -> Any:
        """The value of a script that is run in the page."""
        return self.do("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def press(self, label: str) -> None:
        """Press the button with this label, as soon as it exists."""
        find = f"[...document.querySelectorAll('button')].find(one => one.innerText.trim() === {json.dumps(label)})"
        until(lambda: self.evaluate(f"!!{find}"), f"the button {label}")
        self.evaluate(f"{find}.click()")

    def write(self, text: str) -> None:
        """Type into the page's empty text field, as from a keyboard, and pause as long as a person would.

        The page sends input at most every 50 ms, and only the last of several. Its own clock tells when this time is
        over, however busy the computer is.
        """
        find = "[...document.querySelectorAll('input:not([type])')].find(one => !one.value && !one.readOnly)"
        self.evaluate(f"{find}.focus()")
        self.do("Input.insertText", text=text)
        self.do("Runtime.evaluate", expression=f"new Promise(go => setTimeout(go, {_PAUSE_ms}))", awaitPromise=True)

    def shows(self, words: str) -> bool:
        """Whether a person can read these words in the page."""
        return bool(self.evaluate(f"document.body.innerText.includes({json.dumps(words)})"))


def _pages(port: str) -> list[dict[str, Any]]:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=20) as answer:
        return [one for one in json.load(answer) if one["type"] == "page"]
