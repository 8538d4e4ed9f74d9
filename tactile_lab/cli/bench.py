"""``tactile-lab bench``: speed and memory, compared with the reference."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from tactile_lab.cli.options import Json, NoInput

if TYPE_CHECKING:
    from tactile_lab.benchmarks.components import TimingTable


class Part(StrEnum):
    """Benchmarks that can be run separately."""

    PATHS = "paths"
    CARRY = "carry"
    CAMERA = "camera"
    ETHERCAT = "ethercat"
    LOAD = "load"
    RECORDER = "recorder"
    START = "start"
    MEMORY = "memory"


Table: TypeAlias = tuple[str, Sequence[str], Sequence[Sequence[str]]]
"""Title, header and rows."""
_PAGES = {
    Part.PATHS: ("speed", "Time taken by the expensive parts of a step."),
    Part.CARRY: ("speed-carry", "Processor time of odometry in the hand for each carry, with its checks for slip."),
    Part.CAMERA: ("speed-camera", "Time taken by marker detection, in its own process."),
    Part.ETHERCAT: (
        "hand-on-ethercat",
        "The emulated two-slave hand on a virtual cable at 1 kHz, both EtherCAT masters.",
    ),
    Part.LOAD: ("full-load", "Five force sensors at 7 kHz and the hand at 1 kHz at the same time."),
    Part.RECORDER: ("recorder", "Recording at full load: dropped messages and processor time."),
    Part.MEMORY: ("memory", "Memory and time of the estimation in a session of 200 grasps."),
    Part.START: ("start", "Time until the program has started, as ratios to a Python that does nothing."),
}
"""Name and description of each benchmark's stored result."""


def bench(
    only: Annotated[
        Part,
        typer.Option(
            help="paths: the expensive parts of a step; carry: odometry in the hand; "
            "start: --help and the first cycle of a session; "
            "camera: marker detection in its own process; "
            "ethercat: both masters on the emulated hand, and how they recover; "
            "load: five force sensors at 7 kHz and the hand at 1 kHz; "
            "recorder: recording the hand and five force sensors at 1 kHz, and 30 images per second; "
            "memory: of the estimation in a session of 200 grasps."
        ),
    ] = Part.PATHS,
    seconds: Annotated[
        float,
        typer.Option(min=1.0, max=86_400.0, help="Duration of the camera, ethercat, load and recorder benchmarks."),
    ] = 30.0,
    with_hand: Annotated[bool, typer.Option("--hand/--no-hand", help="With --only load: include the hand.")] = True,
    store: Annotated[
        bool, typer.Option("--store", help="Store the tables in the repository and write their page.")
    ] = False,
    docs: Annotated[Path, typer.Option(help="Documentation folder with the stored results and pages.")] = Path("docs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Benchmark the hot paths, compared with the thesis's figures and a simple implementation, or the device
    connections.

    The connection benchmarks create virtual network interfaces, which needs root, or  unshare -Urn sh -c 'ip link set
    lo up; ...'
    """
    del no_input
    match only:
        case Part.CAMERA:
            tables = _camera(seconds, as_json)
        case Part.ETHERCAT:
            tables = _ethercat(seconds, as_json)
        case Part.LOAD:
            tables = _load(seconds, with_hand, as_json)
        case Part.RECORDER:
            tables = _recorder(seconds, as_json)
        case Part.MEMORY:
            tables = _memory(as_json)
        case Part.START:
            tables = _start(as_json)
        case Part.PATHS:
            tables = _paths(as_json)
        case Part.CARRY:
            tables = _carry(as_json)
    if store:
        timed = "" if only in (Part.PATHS, Part.CARRY, Part.START, Part.MEMORY) else f" --seconds {seconds:g}"
        command = "tactile-lab bench" if only is Part.PATHS else f"tactile-lab bench --only {only}{timed}"
        _store(docs, only, command, tables)


def _store(docs: Path, part: Part, command: str, tables: list[Table]) -> None:
    """Store the tables of a benchmark, replacing older ones."""
    from tactile_lab.cli.console import say
    from tactile_lab.experiments.reporting import made_here
    from tactile_lab.experiments.results import stored_result
    from tactile_lab.experiments.results.publishing import publish
    from tactile_lab.experiments.results.storing import store

    kept = tuple(stored_result.Table(title, tuple(head), tuple(map(tuple, rows))) for title, head, rows in tables)
    made = stored_result.Part(made_here(), (command,), "", kept)
    name, sentence = _PAGES[part]
    say(f"stored  {store(docs, name, sentence, made)}")
    for page in publish(docs):
        say(f"page  {page}")


def _paths(as_json: bool) -> list[Table]:
    from tactile_lab.benchmarks.components import run_benchmarks
    from tactile_lab.benchmarks.decision_times import decision_table
    from tactile_lab.benchmarks.start_times import start_table
    from tactile_lab.benchmarks.step_times import step_table

    return _tell_tables([start_table(), *run_benchmarks(), step_table(), decision_table()], as_json)


def _carry(as_json: bool) -> list[Table]:
    from tactile_lab.benchmarks.carry_times import carry_table

    return _tell_tables([carry_table()], as_json)


def _start(as_json: bool) -> list[Table]:
    from tactile_lab.benchmarks.start_times import start_table

    return _tell_tables([start_table()], as_json)


def _camera(seconds: float, as_json: bool) -> list[Table]:
    from tactile_lab.benchmarks.camera import camera_table

    return _tell_tables([camera_table(seconds=seconds)], as_json)


def _tell_tables(tables: list[TimingTable], as_json: bool) -> list[Table]:
    from tactile_lab.cli.console import emit_json, show_table

    head = ["what", "ms", "ratio", "peak MB", "how"]
    if as_json:
        emit_json([result.as_json() for result in tables])
    else:
        for result in tables:
            show_table(result.title, head, result.rows(), right=(1, 2, 3))
    return [(result.title, head, result.rows()) for result in tables]


def _ethercat(seconds: float, as_json: bool) -> list[Table]:
    from dataclasses import asdict

    from tactile_lab.benchmarks.wire import measure_ethercat
    from tactile_lab.cli.console import emit_json, show_table

    rows = measure_ethercat(seconds)
    title, head = "Hand on EtherCAT", ["master", "what", "detected ms", "recovered ms", "detail"]
    cells = [[row.master, row.what, _ms(row.noticed_ms), _ms(row.back_ms), row.detail] for row in rows]
    if as_json:
        emit_json([asdict(row) for row in rows])
    else:
        show_table(title, head, cells, right=(2, 3))
    return [(title, head, cells)]


def _load(seconds: float, with_hand: bool, as_json: bool) -> list[Table]:
    from dataclasses import asdict

    from tactile_lab.benchmarks.load import measure_load
    from tactile_lab.cli.console import answer, emit_json, show_table

    result = measure_load(seconds, with_hand=with_hand)
    title, head = (
        f"All devices at the same time for {result.seconds:g} s",
        ["device", "sent", "received", "lost", "detail"],
    )
    cells = [[row.device, str(row.sent), str(row.received), str(row.lost), row.detail] for row in result.rows]
    facts = [
        ["processor", f"reader {result.reader_share:.0%} of a core, emulated boxes {result.boxes_share:.0%}"],
        ["memory", f"{result.memory_MB:.0f} MB, growing by {result.memory_slope_MB_per_min:.2f} MB per minute"],
        *([["hand", str(result.hand)]] if result.hand else []),
    ]
    if as_json:
        emit_json(asdict(result))
    else:
        show_table(title, head, cells, right=(1, 2, 3))
        for name, text in facts:
            answer(f"{name}: {text}")
    return [(title, head, cells), ("", ["what", "figure"], facts)]


def _recorder(seconds: float, as_json: bool) -> list[Table]:
    from dataclasses import asdict

    from tactile_lab.benchmarks.recorder import measure_recorder
    from tactile_lab.cli.console import emit_json, show_facts

    found, title = measure_recorder(seconds), f"Recorder at full load for {seconds:g} s"
    facts = {name.replace("_", " "): f"{value:g}" for name, value in asdict(found).items()}
    if as_json:
        emit_json(asdict(found))
    else:
        show_facts(title, facts.items())
    return [(title, ["what", "figure"], [list(fact) for fact in facts.items()])]


def _memory(as_json: bool) -> list[Table]:
    from dataclasses import asdict

    from tactile_lab.benchmarks.session_memory import SEED, SHAPE, measure_memory
    from tactile_lab.cli.console import emit_json, show_table

    stretches = measure_memory()
    beginning = stretches[0].memory_MB
    title, head = f"{SHAPE}, seed {SEED}", ["until grasp", "resident MB", "growth MB", "step ms"]
    cells = [
        [str(one.last), f"{one.memory_MB:.0f}", f"{one.memory_MB - beginning:+.0f}", f"{one.step_ms:.0f}"]
        for one in stretches
    ]
    if as_json:
        emit_json([asdict(one) for one in stretches])
    else:
        show_table(title, head, cells, right=(0, 1, 2, 3))
    return [(title, head, cells)]


def _ms(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
