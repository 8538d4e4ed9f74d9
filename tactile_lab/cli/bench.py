"""``tactile-lab bench``: speed and memory, beside the reference."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput

if TYPE_CHECKING:
    from tactile_lab.evaluation.benchmark import TimingTable


class Part(StrEnum):
    """What can be measured by itself."""

    PATHS = "paths"
    CAMERA = "camera"
    ETHERCAT = "ethercat"
    LOAD = "load"
    RECORDER = "recorder"


def bench(
    only: Annotated[
        Part,
        typer.Option(
            help="paths: costly parts of a step; camera: markers found in its own process; "
            "ethercat: both masters on the emulated hand, and their recoveries; "
            "load: five force sensors at 7 kHz and the hand at 1 kHz; "
            "recorder: hand and five force sensors at 1 kHz and 30 pictures a second, recorded."
        ),
    ] = Part.PATHS,
    seconds: Annotated[float, typer.Option(min=1.0, help="Duration of camera, ethercat, load and recorder.")] = 30.0,
    with_hand: Annotated[bool, typer.Option("--hand/--no-hand", help="With load: the hand too.")] = True,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Measure the hot paths in one run, beside the thesis's figures and a plain implementation; or the wires.

    The wires need the right to make virtual network interfaces: root, or  unshare -Urn sh -c 'ip link set lo up; ...'
    """
    del no_input
    match only:
        case Part.CAMERA:
            _camera(seconds, as_json)
        case Part.ETHERCAT:
            _ethercat(seconds, as_json)
        case Part.LOAD:
            _load(seconds, with_hand, as_json)
        case Part.RECORDER:
            _recorder(seconds, as_json)
        case Part.PATHS:
            _paths(as_json)


def _paths(as_json: bool) -> None:
    from tactile_lab.evaluation.benchmark import run_benchmarks
    from tactile_lab.experiments.decision_times import decision_table
    from tactile_lab.experiments.step_times import step_table

    _tell_tables([*run_benchmarks(), step_table(), decision_table()], as_json)


def _camera(seconds: float, as_json: bool) -> None:
    from tactile_lab.evaluation.camera_benchmark import camera_table

    _tell_tables([camera_table(seconds=seconds)], as_json)


def _tell_tables(tables: list[TimingTable], as_json: bool) -> None:
    from tactile_lab.cli.console import emit_json, show_table

    if as_json:
        emit_json([result.as_json() for result in tables])
        return
    for result in tables:
        show_table(result.title, ["what", "ms", "ratio", "peak MB", "how"], result.rows(), right=(1, 2, 3))


def _ethercat(seconds: float, as_json: bool) -> None:
    from dataclasses import asdict

    from tactile_lab.cli.console import emit_json, show_table
    from tactile_lab.rigs.wire_bench import measure_ethercat

    rows = measure_ethercat(seconds)
    if as_json:
        emit_json([asdict(row) for row in rows])
        return
    cells = [[row.master, row.what, _ms(row.noticed_ms), _ms(row.back_ms), row.detail] for row in rows]
    show_table("Hand on EtherCAT", ["master", "what", "noticed ms", "back ms", "detail"], cells, right=(2, 3))


def _load(seconds: float, with_hand: bool, as_json: bool) -> None:
    from dataclasses import asdict

    from tactile_lab.cli.console import emit_json, say, show_table
    from tactile_lab.rigs.load_bench import measure_load

    result = measure_load(seconds, with_hand=with_hand)
    if as_json:
        emit_json(asdict(result))
        return
    cells = [[row.device, str(row.sent), str(row.received), str(row.lost), row.detail] for row in result.rows]
    title = f"All at once for {result.seconds:g} s"
    show_table(title, ["device", "sent", "received", "lost", "detail"], cells, right=(1, 2, 3))
    say(f"processor: reading {result.reader_share:.0%} of a core, emulated boxes {result.boxes_share:.0%}")
    say(f"memory: {result.memory_MB:.0f} MB, growing by {result.memory_slope_MB_per_min:.2f} MB a minute")
    if result.hand:
        say(f"hand: {result.hand}")


def _recorder(seconds: float, as_json: bool) -> None:
    from dataclasses import asdict

    from sessions.recorder_bench import measure_recorder
    from tactile_lab.cli.console import emit_json, show_facts

    found = measure_recorder(seconds)
    if as_json:
        emit_json(asdict(found))
        return
    facts = {name.replace("_", " "): f"{value:g}" for name, value in asdict(found).items()}
    show_facts(f"Recorder at full load for {seconds:g} s", facts.items())


def _ms(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
