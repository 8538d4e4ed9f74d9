"""Packages of other viewers, which a light installation does without."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from drivers.core.errors import ConfigurationError


def require_package(module: str, extra: str) -> None:
    """Check that a package is there, without importing it.

    Raises:
        ConfigurationError: it is not; names the command that installs it.
    """
    if find_spec(module) is None:
        hint = f"Install it: python3 -m pip --python {sys.executable} install 'tactile-lab[{extra}]'"
        raise ConfigurationError(f"is not installed; it belongs to the extra [{extra}]", where=module, hint=hint)
