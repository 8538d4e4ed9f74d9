"""Packages that a light installation does without: each has an extra, named with its command where it is missing.

The base of an installation is what ``reconstruct``, ``evaluate`` and ``report`` need.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from drivers.core.errors import ConfigurationError

EXTRAS = {
    "cv2": "camera",
    "mujoco": "sim",
    "coacd": "sim",
    "numba": "explore",
    "fpdf": "hardware",
    "viser": "view",
    "PIL": "view",
    "websockets": "view",
    "foxglove": "export",
    "rerun": "rerun",
    "h5py": "export",
    "distributed": "cluster",
    "pyarrow": "export",
    "rosbags": "ros",
    "cyclonedds": "ros",
    "pxr": "usd",
    "fsspec": "cloud",
    "s3fs": "cloud",
}
"""Top-level modules, and the extra of ``pyproject.toml`` that installs each."""


class LazyPackage:
    """A package of an extra, imported when something of it is first used.

    Modules that are imported with the base of the program assign it to the package's name.

    Args:
        name: of the package, one of :data:`EXTRAS`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        """What the package has. Raises ConfigurationError where it is not installed."""
        if attribute.startswith("__"):  # of pickle, inspect and the like, which only look
            raise AttributeError(attribute)
        require_package(self._name)
        found = getattr(import_module(self._name), attribute)
        setattr(self, attribute, found)
        return found


def require_package(name: str) -> None:
    """Check that a package of an extra is there; it is not imported.

    Raises:
        ConfigurationError: it is not installed; names the command that installs it.
    """
    if find_spec(name) is None:
        raise _missing(name)


def explain_missing(error: ModuleNotFoundError) -> ConfigurationError | None:
    """The error for people, with the command that installs what is missing; None for a module of no extra."""
    package = (error.name or "").partition(".")[0]
    return _missing(package) if package in EXTRAS else None


def install_command(extra: str) -> str:
    """The command that adds an extra to the running Python."""
    return f"python3 -m pip --python {sys.executable} install 'tactile-lab[{extra}]'"


def _missing(package: str) -> ConfigurationError:
    extra = EXTRAS[package]
    what = f"the package {package} of the extra [{extra}] is not installed"
    return ConfigurationError(what, hint=f"Install it: {install_command(extra)}")
