"""Where words go: what was asked for to standard output, progress and remarks to standard error.

A command that answers with one JSON document (``--json``) has standard output for that alone; tables and lines that it
shows beside it go to standard error.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol, cast

from rich.console import Console
from rich.text import Text

from drivers.core.atomic_files import write_failure
from drivers.core.errors import WriteError
from tactile_lab.cli.streams import GONE, LastingStream
from tactile_lab.cli.table_forms import facts_form, table_form
from tactile_lab.cli.visible import visible

_out, _err = LastingStream("stdout"), LastingStream("stderr")


def _console(stream: LastingStream) -> Console:
    """Colours only on a terminal and without NO_COLOR."""
    return Console(file=cast(Any, stream), highlight=False)


people = _console(_err)
"""Progress, remarks, questions: standard error."""
_answers = _console(_out)
_json_only = False


def keep_output_for_json(wanted: bool) -> None:
    """Whether standard output is for one JSON document alone, from here on."""
    global _json_only
    _json_only = wanted


def answers() -> Console:
    """Where what was asked for is shown: standard output, unless that is for a JSON document."""
    return people if _json_only else _answers


def give_up_answer(error: OSError) -> None:
    """Standard output cannot be written: :func:`check_output` tells, and what is written to it goes nowhere."""
    _out.give_up(error)


def check_output() -> None:
    """Raises WriteError when an answer could not be written, for another reason than that its reader went away."""
    if _out.failure is not None and _out.failure.errno not in GONE:
        hint = "Free some space, or send it elsewhere"
        raise WriteError(write_failure(_out.failure), where="standard output", hint=hint) from _out.failure


class Onlooker(Protocol):
    """Another place that shows the same text, such as a wizard's page."""

    def line(self, text: str, style: str = "") -> None: ...
    def table(
        self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]
    ) -> None: ...


_onlookers: list[Onlooker] = []


@contextmanager
def tell_also(onlooker: Onlooker) -> Iterator[None]:
    """Within the block, everything printed for people is also shown there."""
    _onlookers.append(onlooker)
    try:
        yield
    finally:
        _onlookers.remove(onlooker)


def say(text: str, style: str = "") -> None:
    """A line of progress, or a remark; printed literally (no markup, no wrapping)."""
    _tell(people, Text(visible(text), style=style), style)


def answer(text: str, style: str = "") -> None:
    """A line of what was asked for."""
    _tell(answers(), Text(visible(text), style=style), style)


def count(number: int, noun: str) -> str:
    """A number with its noun: "1 grasp", "3 grasps"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def complain(text: str) -> None:
    """One error line for people."""
    _tell(people, Text.assemble(("error: ", "bold red"), visible(text)), "bold red")


def warn(text: str) -> None:
    """One warning line for people."""
    _tell(people, Text.assemble(("warning: ", "bold yellow"), visible(text)), "bold yellow")


def _tell(where: Console, line: Text, style: str) -> None:
    where.print(line, soft_wrap=True)
    for onlooker in _onlookers:
        onlooker.line(line.plain, style)


def emit_json(document: Any) -> None:
    """Print the command's single JSON document. NaN is not JSON and is refused."""
    _out.write(json.dumps(document, indent=2, allow_nan=False) + "\n")
    _out.flush()


def show_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    right: Sequence[int] = (),
    where: Console | None = None,
) -> None:
    """A table with a rule below its header; ``right`` lists the columns that hold numbers.

    It is an answer, unless it is shown on another console such as :data:`people`. Cells are printed literally. The
    last column takes the remaining width and wraps; on a terminal too narrow for the
    other columns each row becomes a block
    of lines.
    """
    shown, console = list(rows), where or answers()
    console.print(table_form(console, title, columns, shown, right), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, columns, shown, right)


def show_facts(title: str, facts: Iterable[tuple[str, str]]) -> None:
    """Names with values; empty values are left out."""
    shown = [(name, value) for name, value in facts if value]
    answers().print(Text(visible(title), style="bold"), soft_wrap=True)
    answers().print(facts_form(answers(), shown), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, ("", ""), shown, ())
