"""Shared parts of the calibration wizards: measuring, skipping and undoing steps, checking the motion, the verdict."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import typer

from calibration.steps.guided_steps import EmulatorHost, Instructed, Step

if TYPE_CHECKING:
    from calibration.steps.motion_check import MotionReport
    from calibration.store.store import CalibrationRecord
    from tactile_lab.cli.calibrate.wizard import Asker

OUTSIDE = 3

P = TypeVar("P", bound=Instructed)
T = TypeVar("T")


class Guided(Protocol[P, T]):
    """A wizard with steps to measure."""

    def steps(self) -> tuple[Step[P], ...]: ...
    def measure(self, step: Step[P], measurer: EmulatorHost[P, T]) -> T: ...
    def undo(self) -> int | None: ...
    def motion(self) -> MotionReport: ...


def measure_all(wizard: Guided[P, T], measurer: EmulatorHost[P, T], asker: Asker) -> None:
    """Go through the steps; when all are done, say what is missing, and let a person measure more or give up.

    Raises:
        InterruptionError: the person quits.
        SafetyError: a limit was exceeded.
    """
    steps, index = wizard.steps(), 0
    while index < len(steps):
        index = _one_step(wizard, steps, index, measurer, asker)
    _tell_motion(wizard.motion())


def _one_step(
    wizard: Guided[P, T], steps: tuple[Step[P], ...], index: int, measurer: EmulatorHost[P, T], asker: Asker
) -> int:
    """Measure, skip or undo a step. Returns the number of the next one."""
    step = steps[index]
    answers = {"": "measure", "s": "skip", "u": "undo the last step", "d": "done measuring"}
    answer = asker.choose(f"{step.number}/{step.count} {step.instruction}", answers, "")
    if answer == "d":
        return len(steps)
    if answer == "u":
        undone = wizard.undo()
        return index if undone is None else undone - 1
    if answer == "" and not _measure(wizard, step, measurer, asker):
        return index
    return index + 1


def _measure(wizard: Guided[P, T], step: Step[P], measurer: EmulatorHost[P, T], asker: Asker) -> bool:
    """Measure one step. Returns False to ask for it again."""
    from drivers.core.errors import DeviceError
    from tactile_lab.cli.console import say, warn

    try:
        wizard.measure(step, measurer)
    except DeviceError as error:
        warn(str(error))
        return asker.choose("Not measured. Try again, or skip this step?", {"s": "skip", "a": "again"}, "s") == "s"
    motion = wizard.motion()
    missing = ", ".join(check.name for check in motion.checks if not check.ok)
    say(f"{step.number}/{step.count} {step.instruction}: done{missing and f'; not enough yet: {missing}'}", "dim")
    asker.show_beside("Motion", *_motion_table(motion))
    return True


def _tell_motion(report: MotionReport) -> None:
    from tactile_lab.cli.console import people, show_table

    columns, rows, right = _motion_table(report)
    show_table("Motion", columns, rows, right=right, where=people)


def _motion_table(report: MotionReport) -> tuple[list[str], list[list[str]], tuple[int, ...]]:
    """Measured and missing motion as a table: columns, rows, and which columns hold numbers."""
    rows = [
        [check.name, f"{check.value:.4g} {check.unit}", f"{check.needed:.4g}", "enough" if check.ok else check.advice]
        for check in report.checks
    ]
    return ["", "is", "needed", ""], rows, (1, 2)


def store_result(
    file: Path,
    record: CalibrationRecord,
    asker: Asker,
    as_json: bool,
    comment: str = "",
) -> None:
    """Show the verdict, ask, and write the file (a failed result as NAME.failed.yaml).

    Whether an existing file may be replaced was asked before measuring, see :func:`may_write`.

    Args:
        comment: at the top of the file.

    Raises:
        Exit: code 3, the result failed.
        InterruptionError: the person does not want it stored.
    """
    from calibration.store.store import target_file, write_record
    from drivers.core.calibration_file import plain
    from tactile_lab.cli.calibrate.tables import tell_verdict
    from tactile_lab.cli.console import answer, emit_json, say

    tell_verdict(record)
    target = target_file(file, record)
    if not asker.agree(f"Store it as {target}?"):
        raise asker.quit_error()
    write_record(target, record, comment)
    if as_json:
        emit_json({"file": str(target), **plain(record)})
    answer(f"stored  {target}")
    if record.verdict == "FAIL":
        raise typer.Exit(OUTSIDE)
    say(f"To use it, name it in the rig file: calibration.{record.kind}: {file}")
