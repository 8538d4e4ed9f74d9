"""``tactile-lab plugins``: what installed packages add to the program."""

from __future__ import annotations

import typer

from tactile_lab.cli.options import Json, NoInput


def plugins(as_json: Json = False, no_input: NoInput = False) -> None:
    """List the plug-ins of installed packages, with their versions, files, and what is wrong with them.

    Exit code 3 if one of them cannot be used.
    """
    from tactile_lab.cli.console import emit_json, say, show_table
    from tactile_lab.workflow.plugging import check_plugins

    del no_input
    found = check_plugins()
    if as_json:
        emit_json(
            [
                {"kind": one.group, "name": one.name, "package": one.package, "version": one.version}
                | {"object": one.target, "file": one.file, "problem": problem}
                for one, problem in found
            ]
        )
    elif found:
        rows = [[one.group, one.name, one.origin, one.file, problem or "ready"] for one, problem in found]
        show_table("plug-ins", ["kind", "name", "package", "file", "state"], rows)
    else:
        say("no installed package adds anything; docs/plugins.md says how one does")
    if any(problem for _, problem in found):
        raise typer.Exit(3)
