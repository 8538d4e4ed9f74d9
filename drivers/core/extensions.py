"""Extensions: Python files of a laboratory that register their own policies, models, devices, figures and commands.

A rig file names them (``extensions: [my_policy.py]``), or the command line does (``--extension my_policy.py``). They
are imported once, in the order given, before any name is looked up. Processes that the program starts find them in
the environment variable :data:`VARIABLE`, which may also be set by hand.

An extension is code that runs with all rights of the user. Hence a recorded session names its extensions and keeps
copies of them, but opening it never runs them: the user decides that.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import traceback
from pathlib import Path

from drivers.core.errors import ConfigurationError, TactileLabError
from drivers.core.installed.entries import explain
from drivers.core.reading.bounded_files import refuse_unreachable
from drivers.core.registry import Registry

VARIABLE = "TACTILE_LAB_EXTENSIONS"
"""Environment variable: the files, joined as in ``PATH``."""


def load_extension(path: Path) -> None:
    """Import an extension, so that its entries can be used; a second time does nothing.

    Raises:
        ConfigurationError: there is no such file, it raises, or it registers a name that is in use. Its earlier entries
            are then removed.
    """
    path = path.resolve()
    name = _module_name(path)
    if name not in sys.modules:
        _import(path, name)
    files = list(dict.fromkeys([*_named(), str(path)]))
    os.environ[VARIABLE] = os.pathsep.join(files)


def load_named_extensions() -> None:
    """Import the extensions that the environment names; for processes that the program starts.

    Raises:
        ConfigurationError: as :func:`load_extension`.
    """
    for file in _named():
        load_extension(Path(file))


def unload_extension(path: Path) -> None:
    """Unload an extension: its names are free again."""
    path = path.resolve()
    Registry.withdraw(str(path))
    sys.modules.pop(_module_name(path), None)
    files = [file for file in _named() if file != str(path)]
    os.environ.pop(VARIABLE, None)
    if files:
        os.environ[VARIABLE] = os.pathsep.join(files)


def blamed(error: BaseException) -> str:
    """The extension or plug-in that raised an unexpected error, with its message; empty if none did."""
    files = {frame.filename for frame in traceback.extract_tb(error.__traceback__)}
    ours = dict.fromkeys(_named(), "extension") | dict.fromkeys(Registry.plugin_files(), "plug-in")
    return next(
        (f"{file}: this {what} failed: {explain(error, file)}" for file, what in ours.items() if file in files), ""
    )


def _import(path: Path, name: str) -> None:
    refuse_unreachable(path)
    if not path.is_file():
        raise ConfigurationError("no such extension", where=str(path), hint="Check its path")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigurationError("is not a Python file", where=str(path), hint="Give a .py file")
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        unload_extension(path)
        if isinstance(error, TactileLabError) or not isinstance(error, Exception | SystemExit):
            raise
        what = f"this extension could not be loaded: {explain(error, str(path))}"
        raise ConfigurationError(what, where=str(path), hint="Correct it, or remove it") from error


def _named() -> list[str]:
    return [file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file]


def _module_name(path: Path) -> str:
    """The same in every process, so that objects of an extension can be passed on; no two files share one."""
    return f"tactile_lab_extension_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
