"""All errors that users can see, in one tree.

TactileLabError                exit 1
 |- ConfigurationError         exit 2   an option, name or file that was given: rig, calibration, mesh, log
 |- DeviceError                exit 4   a device that does not answer, or answers wrongly
 |   `- CodecError                      bytes that do not follow the protocol
 |- SafetyError                exit 1   a limit of the hand or the workspace was exceeded: the rig has stopped
 |- SessionError               exit 1   a session folder or its traffic file
 |   |- SessionDataError   exit 2   a session that was given: missing, damaged, or without the requested data
 |   `- EstimationError                 a program error during estimation or planning
 |- ProcessError               exit 1   a process of this program that does not start, or has ended
 |- WriteError                 exit 1   a file that cannot be written: a full disk, a folder one may not write to
 |- ShapeError                 exit 1   a mesh, contour or model that cannot be used
 |- TrackingError              exit 1   the object cannot be followed any further
 `- InterruptionError          exit 130 a person interrupted the work

Each message says what happened, where (which device or file), and what to do next.
Exit codes are those of the command line, see :mod:`tactile_lab.cli.main`.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


class TactileLabError(Exception):
    """Base of all errors shown to people.

    Args:
        what: what happened, one clause without a full stop.
        where: the device, file or option concerned.
        hint: what to do next.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", hint: str = "") -> None:
        self.what, self.where, self.hint = what, where, hint
        super().__init__(str(self))

    def __str__(self) -> str:
        head = f"{self.where}: {self.what}" if self.where else self.what
        return f"{head}. {self.hint}" if self.hint else head


class ConfigurationError(TactileLabError):
    """An option, a name or a file that was given is missing, or cannot be used as it is; nothing was begun."""

    exit_code = 2


class DeviceError(TactileLabError):
    """A device is missing, silent or faulty."""

    exit_code = 4


class CodecError(DeviceError):
    """Bytes that do not follow the device's protocol."""


class SafetyError(TactileLabError):
    """A limit of the hand or the workspace was exceeded; the rig must stop."""


class SessionError(TactileLabError):
    """A session folder or traffic file that cannot be read or written."""


class SessionDataError(SessionError):
    """A session that was given, its recording or its results are missing, damaged, or lack the requested data."""

    exit_code = 2


class EstimationError(SessionError):
    """A program error in the estimation or planning of a running session; its notes say where."""


class ProcessError(TactileLabError):
    """A process of this program, such as that of a page, does not start, or has ended."""


class WriteError(TactileLabError):
    """A file that cannot be written."""


class ShapeError(TactileLabError):
    """A mesh, contour or shape model that cannot be used."""


class TrackingError(TactileLabError):
    """The object cannot be followed any further."""


class InterruptionError(TactileLabError):
    """A person interrupted the work; says what is kept."""

    exit_code = 130


@contextmanager
def given_by_a_person() -> Iterator[None]:
    """Within the block a mesh or session that cannot be used is a mistake in what was asked for: ConfigurationError."""
    try:
        yield
    except (ShapeError, SessionError) as error:
        raise ConfigurationError(error.what, where=error.where, hint=error.hint) from error


def refusal(error: OSError) -> str:
    """Why the system refused something, in its own words: those of a library around them are left out."""
    words = os.strerror(error.errno) if error.errno is not None and error.errno > 0 else error.strerror
    return words or "no answer"
