"""``tactile-lab bench``: speed and memory, beside the reference."""

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
    """What can be measured by itself."""

    PATHS = "paths"
    CAMERA = "camera"
    ETHERCAT = "ethercat"
    LOAD = "load"
    RECORDER = "recorder"


Table: TypeAlias = tuple[str, Sequence[str], Sequence[Sequence[str]]]
"""Title, head and rows."""
_PAGES = {
    Part.PATHS: ("speed", "How long the costly parts of a step take."),
    Part.CAMERA: ("speed-camera", "How long markers take to be found, in a process of their own."),
    Part.ETHERCAT: (
        "hand-on-ethercat",
        "The emulated two-slave hand on a virtual cable at 1 kHz, both EtherCAT masters.",
    ),
    Part.LOAD: ("full-load", "Five force sensors at 7 kHz and the hand at 1 kHz, all at once."),
    Part.RECORDER: ("recorder", "A recording at full load: what is dropped, and what it costs."),
}
"""Name and sentence of the stored result of each part."""


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
    seconds: Annotated[
        float, typer.Option(min=1.0, max=86_400.0, help="Duration of camera, ethercat, load and recorder.")
    ] = 30.0,
    with_hand: Annotated[bool, typer.Option("--hand/--no-hand", help="With load: the hand too.")] = True,
    store: Annotated[
        bool, typer.Option("--store", help="Keep the tables in the repository, write their page.")
    ] = False,
    docs: Annotated[Path, typer.Option(help="Documents that keep stored results and pages.")] = Path("docs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Measure the hot paths in one run, beside the thesis's figures and a plain implementation; or the wires.

    The wires need the right to make virtual network interfaces: root, or  unshare -Urn sh -c 'ip link set lo up; ...'
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
        case Part.PATHS:
            tables = _paths(as_json)
    if store:
        command = (
            "tactile-lab bench" if only is Part.PATHS else f"tactile-lab bench --only {only} --seconds {seconds:g}"
        )
        _store(docs, only, command, tables)


def _store(docs: Path, part: Part, command: str, tables: list[Table]) -> None:
    """Keep the tables of a part in place of those that were kept of it."""
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
    from tactile_lab.benchmarks.step_times import step_table

    return _tell_tables([*run_benchmarks(), step_table(), decision_table()], as_json)


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
    title, head = "Hand on EtherCAT", ["master", "what", "noticed ms", "back ms", "detail"]
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
    title, head = f"All at once for {result.seconds:g} s", ["device", "sent", "received", "lost", "detail"]
    cells = [[row.device, str(row.sent), str(row.received), str(row.lost), row.detail] for row in result.rows]
    facts = [
        ["processor", f"reading {result.reader_share:.0%} of a core, emulated boxes {result.boxes_share:.0%}"],
        ["memory", f"{result.memory_MB:.0f} MB, growing by {result.memory_slope_MB_per_min:.2f} MB a minute"],
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


def _ms(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
