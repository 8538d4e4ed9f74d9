"""A package of another laboratory with a plug-in of every kind, made of the examples in docs, built and installed."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

from tests.support.extending_page import PAGE, code

PLUGINS_PAGE = PAGE.with_name("plugins.md")
SOURCE = Path(__file__).resolve().parents[1] / "plugin_package"
_BUILD = "import sys; from setuptools import build_meta as b; print(b.build_wheel(sys.argv[1]))"


def install_package(folder: Path) -> Path:
    """Write, build and install the package under ``folder``, without a network. Returns the folder to import from."""
    modules = folder / "source" / "other_laboratory"
    modules.mkdir(parents=True)
    shutil.copy(SOURCE / "pyproject.toml", modules.parent)
    (modules / "__init__.py").touch()
    for name in ("quickest", "circle", "heaviest", "six_floats", "text_wire", "text_positioner"):
        (modules / f"{name}.py").write_text(named(code(f"{name}.py")))
    for name in ("unturned", "npz"):
        (modules / f"{name}.py").write_text(code(f"{name}.py", PLUGINS_PAGE))
    build = [sys.executable, "-W", "ignore", "-c", _BUILD, str(folder)]
    built = subprocess.run(build, cwd=modules.parent, capture_output=True, text=True, check=True).stdout
    target, wheel = folder / "installed", folder / built.splitlines()[-1]
    words = [sys.executable, "-m", "uv", "pip", "install", "-q", "--offline", "--no-deps", "--target", str(target)]
    subprocess.run([*words, str(wheel)], check=True)
    return target


def named(text: str) -> str:
    """A module in which what was registered is a variable: of POLICIES, ``POLICIES_entry``."""
    module = ast.parse(text)
    module.body = [_variable(each) for each in module.body]
    return ast.unparse(ast.fix_missing_locations(module))


def _variable(statement: ast.stmt) -> ast.stmt:
    match statement:
        case ast.Expr(ast.Call(ast.Attribute(ast.Name(registry), "register"), [_, entry])):
            return ast.Assign([ast.Name(f"{registry}_entry", ast.Store())], entry)
    return statement
