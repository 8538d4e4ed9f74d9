"""The program's other top-level packages are its own, and not a file or folder of that name beside a notebook.

``drivers``, ``calibration`` and ``sessions`` are names that a laboratory uses for things of its own. Python looks in
the folder of the notebook or script first, so that a ``calibration.py`` there hides ours, and the import would fail far
inside the program. A folder without ``__init__.py``, such as recorded ``sessions/``, hides nothing.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

PACKAGES = ("drivers", "calibration", "sessions")


def check_own_packages() -> None:
    """Check that each is ours.

    Raises:
        ImportError: something else has the name; says which file, in one sentence.
        SystemExit: the same, for ``python -m``.
    """
    home = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        ours, found = home / name / "__init__.py", _origin(name)
        if not ours.is_file() or found == ours:
            continue
        if found is not None:
            hidden = f"{found} hides the package {name!r} of tactile-lab"
            _refuse(f"{hidden}: rename it, or start Python in another folder")
        _take(name, ours)


def _take(name: str, file: Path) -> None:
    """Import a package of ours from its file, whatever else Python would find."""
    spec = spec_from_file_location(name, file, submodule_search_locations=[str(file.parent)])
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)


def _refuse(sentence: str) -> None:
    if sys.argv[:1] == ["-m"]:  # python -m tactile_lab: a person, who needs no traceback
        sys.exit(f"error: {sentence}")
    raise ImportError(sentence)


def _origin(name: str) -> Path | None:
    """The file that ``import name`` gives, without importing it; None for a folder of no package, or nothing."""
    module = sys.modules.get(name)
    try:
        origin = find_spec(name).origin if module is None else module.__file__  # type: ignore[union-attr]
    except (AttributeError, ImportError, ValueError):
        return None
    return Path(origin).resolve() if origin else None
