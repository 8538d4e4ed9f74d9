"""``tactile-lab rig``: which rigs there are, and whether one is fit to work."""

from __future__ import annotations

from typing import Annotated

import typer

from tactile_lab.cli.console import emit_json, people, say, table

app = typer.Typer(help="Rigs: the devices of a laboratory.", no_args_is_help=True)


@app.command("list")
def list_rigs(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")] = False,
) -> None:
    """List the rigs that come with the program."""
    from tactile_lab.rigs.description import load_rig, shipped_rigs

    rigs = [load_rig(name).description for name in shipped_rigs()]
    if as_json:
        emit_json([rig.model_dump(mode="json", include={"name", "summary", "kind", "fingertips"}) for rig in rigs])
        return
    people.print(table("Rigs", ["name", "fingertips", "summary"], [[r.name, r.fingertips, r.summary] for r in rigs]))


@app.command("check")
def check(
    rig: Annotated[str, typer.Argument(help="Name of a shipped rig, or a rig file.")],
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")] = False,
) -> None:
    """Read a rig file and its calibration, connect every device, and tell what each one says.

    Nothing moves. Exit code 0: all well; 2: the files; 4: a device is not ready.
    """
    from tactile_lab.rigs.check import check_rig

    findings = check_rig(rig)
    ready = all(finding.ok for finding in findings)
    if as_json:
        devices = [{"device": f.device, "ok": f.ok, "detail": f.detail} for f in findings]
        emit_json({"rig": rig, "ready": ready, "devices": devices})
    else:
        rows = [[finding.device, "ok" if finding.ok else "NOT READY", finding.detail] for finding in findings]
        people.print(table(f"Rig {rig}", ["device", "state", "detail"], rows))
        say("ready" if ready else "not ready", "bold green" if ready else "bold red")
    if not ready:
        raise typer.Exit(4)
