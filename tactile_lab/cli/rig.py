"""``tactile-lab rig``: list rigs, and check whether one is ready."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import LARGEST_SEED, Json, NoInput, RigArgument

if TYPE_CHECKING:
    from tactile_lab.rigs.description import Rig

_FOR_EVER_s = 1e8

app = typer.Typer(help="Rigs: the devices of a laboratory and their calibration.", no_args_is_help=True)


@app.command("list")
def list_rigs(
    ports: Annotated[
        bool, typer.Option("--ports", help="List serial ports, CAN interfaces and network interfaces instead.")
    ] = False,
    watch: Annotated[
        float, typer.Option(min=0.0, max=86_400.0, help="List ports, then wait this many seconds for changes.")
    ] = 0.0,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """List the built-in rigs, or the ports that a sensor can be connected to.

    To find an adapter's port, run "--watch 30" and unplug the adapter.
    """
    if ports or watch:
        _list_ports(watch, as_json)
        return
    from tactile_lab.cli.console import emit_json, show_table
    from tactile_lab.rigs.description import load_rig, shipped_rigs

    del no_input
    rigs = [load_rig(name).description for name in shipped_rigs()]
    if as_json:
        emit_json([rig.model_dump(mode="json", include={"name", "summary", "kind", "fingertips"}) for rig in rigs])
        return
    show_table("Rigs", ["name", "fingertips", "summary"], [[rig.name, rig.fingertips, rig.summary] for rig in rigs])


def _list_ports(watch_s: float, as_json: bool) -> None:
    from dataclasses import asdict

    from drivers.core.clock import MonotonicClock
    from tactile_lab.cli.console import answer, emit_json, show_table
    from tactile_lab.rigs.ports import list_all_ports, wait_for_change

    found = list_all_ports()
    if not as_json:
        show_table(
            "Ports", ["kind", "name", "description"], [[port.kind, port.name, port.description] for port in found]
        )
    gone, come = wait_for_change(MonotonicClock(), found, watch_s) if watch_s else ([], [])
    if as_json:
        rows = {"ports": found, "gone": gone, "come": come}
        emit_json({name: [asdict(port) for port in ports] for name, ports in rows.items()})
        return
    changed = {port.name for port in gone} & {port.name for port in come}
    for port in gone:
        if port.name not in changed:
            answer(f"{port.name} removed: {port.description}")
    for port in come:
        words = f": now {port.description}" if port.name in changed else f" added: {port.description}"
        answer(f"{port.name}{words}")
    if watch_s and not (gone or come):
        answer("nothing changed")


@app.command("show")
def show(
    rig: RigArgument,
    every: Annotated[bool, typer.Option("--all", help="Also show settings at their default values.")] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Show a rig's devices, calibration files and settings that differ from the defaults."""
    from tactile_lab.cli.console import answer, emit_json, say, show_facts, show_table
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.rigs.effective_settings import effective_settings

    del no_input
    loaded = load_rig(rig)
    if as_json:
        emit_json({"file": loaded.source, **loaded.plain()})
        return
    settings = effective_settings(loaded.description)
    shown = [item for item in settings if every or item.value != item.usual]
    show_facts(f"Rig {loaded.description.name}", _facts(loaded))
    answer("")
    if shown:
        title = "All settings" if every else f"Settings that differ from the defaults ({len(shown)} of {len(settings)})"
        show_table(title, ["setting", "here", "usual"], [(item.name, item.value, item.usual) for item in shown])
    else:
        say("all settings have their default values; --all shows them")


def _facts(rig: Rig) -> list[tuple[str, str]]:
    from tactile_lab.rigs.description import wire_files
    from tactile_lab.rigs.effective_settings import flat

    told = rig.description
    wires = {} if told.wires is None else flat(told.wires.model_dump(mode="json", exclude_unset=True))
    files = told.calibration.model_dump(exclude_none=True) | wire_files(told)
    return [
        ("summary", told.summary),
        ("file", rig.source),
        ("kind", told.kind + (", emulated" if told.emulated else "")),
        ("cycle", f"{1e3 * told.cycle_s:g} ms"),
        ("fingertips", told.fingertips),
        ("installation", rig.installation.rig),
        ("devices", ", ".join(f"{device} {serial}" for device, serial in told.devices.items())),
        ("wires", "\n".join(f"{name}: {value}" for name, value in wires.items())),
        ("calibration", "\n".join(f"{role}: {file}" for role, file in files.items())),
    ]


@app.command("check")
def check(
    rig: RigArgument,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Random seed of a simulated rig.")] = 0,
    move: Annotated[
        bool,
        typer.Option(
            "--move", help="Move every motor of a real hand slightly, to check that it moves the joint in the map."
        ),
    ] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Read a rig file and its calibration, connect every device, and report its state and what to do next.

    Nothing moves without --move. A rig with force fingertips only, without a hand, can be checked too.

    Exit code 0: all ready; 2: a file is invalid; 4: a device is not ready.
    """
    from tactile_lab.cli.console import answer, emit_json, show_table
    from tactile_lab.rigs.checks.check import check_rig
    from tactile_lab.rigs.checks.next_steps import next_steps

    del no_input
    findings = check_rig(rig, seed, move=move)
    steps = next_steps(rig, findings, moved=move)
    ready = all(finding.ok for finding in findings)
    if as_json:
        devices = [{"device": f.device, "ok": f.ok, "detail": f.detail, "figures": dict(f.figures)} for f in findings]
        emit_json({"rig": rig, "ready": ready, "devices": devices, "next": steps})
    else:
        rows = [[finding.device, "ok" if finding.ok else "NOT READY", finding.detail] for finding in findings]
        show_table(f"Rig {rig}", ["device", "state", "detail"], rows)
        answer("ready" if ready else "not ready", "bold green" if ready else "bold red")
        for number, step in enumerate(steps, 1):
            answer(f"{number}. {step}")
    if not ready:
        raise typer.Exit(4)


@app.command("emulate")
def emulate(
    rig: Annotated[str, typer.Argument(metavar="RIG", help="A rig file of kind fingertips or hand.")],
    seconds: Annotated[float, typer.Option(min=0.0, max=1e8, help="Duration; 0: until Ctrl+C.")] = 0.0,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Emulate the sensors of a fingertip rig, or the hand of a hand rig, at the addresses in its file, until Ctrl+C.
    Missing serial ports are created; an existing one is never replaced. Network addresses must be loopback addresses; a
    hand is emulated at the interface given by far_end.
    """
    import time

    from tactile_lab.cli.console import answer, emit_json, say
    from tactile_lab.rigs.emulate import emulated_rig

    del no_input
    with emulated_rig(rig) as places:
        if as_json:
            emit_json({"rig": rig, "devices": places})
        for finger, place in places.items():
            answer(f"{finger}: {place}")
        say(f"Run tactile-lab rig check {rig} in another terminal. Ctrl+C: stop")
        time.sleep(seconds or _FOR_EVER_s)
