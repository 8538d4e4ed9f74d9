"""Child processes of drivers, estimators and pages as copies of the test's process, which has loaded their modules.

A new interpreter spends most of a second with loading, and every test of a hand starts two. A copy becomes what the new
interpreter would have been: same pipes, environment, process group, signals and arguments; only how it came to its
modules differs. Whatever loads libraries with threads of their own is started as usual.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

import pytest

from drivers.core import child_process
from tactile_lab import process_feed

FORKED = (
    "drivers.emulators.ati.net_box_process",
    "drivers.emulators.ethercat.server",
    "drivers.shadow.device.hand_worker",
    "tactile_lab.autonomy.estimator_worker",
    "tactile_lab.view.process",
    "tactile_lab.viewers.live.process",
)


class ForkedChild(subprocess.Popen[bytes]):
    """As its base class, but the modules :data:`FORKED` run in a fork of this process."""

    def _execute_child(self, args: Any, *others: Any) -> None:
        module, env, pipes = args[-1], others[5], others[9:15]
        if module not in FORKED:
            super()._execute_child(args, *others)  # type: ignore[misc]
            return
        import_module(module)
        with warnings.catch_warnings():  # from Python 3.12 on it warns where there are threads; none of them is copied
            warnings.simplefilter("ignore", DeprecationWarning)
            self.pid = os.fork()
        if self.pid == 0:
            _become(module, env, stdin=pipes[0], stdout=pipes[3], stderr=pipes[5])
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def _become(module: str, environment: dict[str, str], stdin: int, stdout: int, stderr: int) -> NoReturn:
    code = 1
    try:
        os.setpgid(0, 0)
        for number, stream in enumerate((stdin, stdout, stderr)):
            if stream >= 0:  # otherwise it is this process's own
                os.dup2(stream, number)
        os.closerange(3, 1024)
        for number in (signal.SIGTERM, signal.SIGALRM, signal.SIGCHLD, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", 1)  # noqa: SIM115
        os.environ.clear()
        os.environ.update(environment)
        warnings.resetwarnings()
        sys.modules.pop(module, None)  # it is run anew, as the main module
        sys.argv = ["child_process", module]
        child_process.main()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


@contextmanager
def forked_children() -> Iterator[None]:
    """Within the block the processes of drivers, estimators and pages are forked."""
    with pytest.MonkeyPatch.context() as patch:
        for starter in (child_process, process_feed):
            patch.setattr(starter, "subprocess", _Subprocess())
        yield


class _Subprocess:
    """The module ``subprocess`` with another Popen."""

    Popen = ForkedChild

    def __getattr__(self, name: str) -> Any:
        return getattr(subprocess, name)
