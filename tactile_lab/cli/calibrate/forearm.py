"""``tactile-lab calibrate forearm``: the pose of the forearm's mount in the world, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.calibrate.options import Notes, Record, Replace, SimulationSeed, result_file
from tactile_lab.cli.options import Json, NoInput, RigName
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token, View

if TYPE_CHECKING:
    from calibration.forearm.recordings import ForearmData
    from calibration.forearm.wizard import ForearmResult, ForearmWizard
    from tactile_lab.cli.calibrate.wizard import Asker
    from tactile_lab.rigs.description import Rig
    from tactile_lab.workflow.calibrating_forearm import CalibrationSettings


class ForearmMethod(StrEnum):
    """Methods to find the pose of the mount."""

    TOUCH = "touch"
    MARKER = "marker"
    MANUAL = "manual"


Triple = tuple[float, float, float]


def forearm(
    rig: RigName = "sim",
    method: Annotated[
        ForearmMethod,
        typer.Option(
            help="touch: fingertips press known geometry; marker: a camera sees a board on the hand; "
            "manual: enter the pose."
        ),
    ] = ForearmMethod.TOUCH,
    out: Annotated[Path | None, result_file("forearm")] = None,
    source: Annotated[
        Path | None, typer.Option("--from", help="Solve recorded poses instead of measuring (not with manual).")
    ] = None,
    record: Record = None,
    settings: Annotated[Path | None, typer.Option(help="Settings file: limits, least motion, errors, speeds.")] = None,
    geometry: Annotated[Path | None, typer.Option(help="Geometry to press, instead of the rig's.")] = None,
    board: Annotated[Path | None, typer.Option(help="Board on the hand, instead of the rig's.")] = None,
    fingers: Annotated[str, typer.Option(help="Fingers that press (not the thumb).")] = "FF,MF",
    touches: Annotated[int, typer.Option(min=1, max=1000, help="Number of touches per face.")] = 8,
    pictures: Annotated[
        int | None, typer.Option(min=3, max=1000, help="Number of pictures of the board.", show_default="20")
    ] = None,
    translation_mm: Annotated[Triple, typer.Option(help="manual: position x y z of world_T_mount.")] = (0.0, 0.0, 0.0),
    rpy_deg: Annotated[
        Triple, typer.Option(help="manual: rotation of world_T_mount as roll pitch yaw about fixed axes.")
    ] = (0.0, 0.0, 0.0),
    sigma_mm: Annotated[
        float | None, typer.Option(min=0.0, max=1000.0, help="manual: standard deviation of the position per axis.")
    ] = None,
    sigma_deg: Annotated[
        float | None, typer.Option(min=0.0, max=180.0, help="manual: standard deviation of the rotation per axis.")
    ] = None,
    valid_days: Annotated[float, typer.Option(min=0.01, max=36_500.0, help="How long the result stays valid.")] = 90.0,
    seed: SimulationSeed = 0,
    replace: Replace = False,
    notes: Notes = "",
    view: View = False,
    view_port: Port = PORT,
    listen: Listen = "127.0.0.1",
    token: Token = "",
    certificate: Certificate = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Calibrate the pose of the forearm's mount in the world, step by step, with its accuracy.

    The motion is checked before solving; missing motion is reported. Ctrl+C or q at any step stores
    nothing. With --view a page in the browser shows the hand and the steps, and accepts answers.

    Exit code 0: PASS; 2: bad input or too little motion; 3: FAIL, outside a limit (stored as NAME.failed.yaml, which
    sessions refuse); 4: a device failed; 130: ended by the operator.
    """
    from calibration.forearm.record import manual_record, record_of, transform_of
    from calibration.forearm.recordings import save_data
    from tactile_lab.cli.calibrate.steps import store_result
    from tactile_lab.cli.calibrate.wizard import may_write, wizard
    from tactile_lab.rigs.description import load_rig

    here, page = load_rig(rig).installation, PageAddress.if_wanted(view, listen, view_port, token, certificate)
    file = out or Path("calibrations") / here.rig / "forearm.yaml"
    with wizard(f"calibrate forearm, rig {rig}", no_input, page) as asker:
        may_write(file, replace, asker, no_input)
        if method is ForearmMethod.MANUAL:
            sigmas = _stated_sigma(sigma_mm, sigma_deg)
            pose = transform_of([value / 1e3 for value in translation_mm], rpy_deg)
            found = manual_record(pose, *sigmas, here, notes=notes, valid_days=valid_days)
        else:
            wanted = _settings(settings)
            if source is not None:
                data = _load_recorded(source, load_rig(rig))
            else:
                names = tuple(name.strip() for name in fingers.split(","))
                data = _measure(asker, wanted, rig, method, seed, geometry, board, names, touches, pictures)
                if record is not None:
                    save_data(record, data)
            result = _solve(data, wanted)
            show_result(result)
            found = record_of(result, here, notes=notes, valid_days=valid_days)
        comment = "Forearm calibration: pose of the positioner's mount in the world frame."
        store_result(file, found, asker, as_json, comment)


def _stated_sigma(sigma_mm: float | None, sigma_deg: float | None) -> tuple[float, float]:
    """The stated uncertainty, metres and radians. Raises ConfigurationError when there is none."""
    from math import radians

    from drivers.core.errors import ConfigurationError

    if not sigma_mm or not sigma_deg:
        hint = "Give --sigma-mm and --sigma-deg, the standard deviations of the pose, above 0"
        raise ConfigurationError("a pose without its uncertainty", where="--method manual", hint=hint)
    return sigma_mm / 1e3, radians(sigma_deg)


def _settings(path: Path | None) -> CalibrationSettings:
    from drivers.core.configuration import load_model
    from tactile_lab.workflow.calibrating_forearm import CalibrationSettings

    return CalibrationSettings() if path is None else load_model(path, CalibrationSettings)


def _load_recorded(path: Path, rig: Rig) -> ForearmData:
    """Recorded poses of this rig. Raises ConfigurationError for those of another rig, or of another hand."""
    from calibration.forearm.record import check_hand, check_origin
    from calibration.forearm.recordings import load_data
    from tactile_lab.rigs.wired import hand_form

    data = load_data(path)
    check_origin(data, rig.installation, str(path))
    if not data.pairs:  # pairs of another program know nothing of the hand's joints
        check_hand(data, hand_form(rig), str(path))
    return data


def _measure(
    asker: Asker,
    settings: CalibrationSettings,
    rig: str,
    method: ForearmMethod,
    seed: int,
    geometry: Path | None,
    board: Path | None,
    fingers: tuple[str, ...],
    touches: int,
    pictures: int | None,
) -> ForearmData:
    from tactile_lab.cli.calibrate.steps import measure_all
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.workflow.calibrating_forearm import ForearmRequest, forearm_wizard

    request = ForearmRequest(load_rig(rig), method.value, seed, geometry, board, fingers, touches, pictures, settings)
    with forearm_wizard(request, asker.onlooker) as (wizard, measurer):
        _tell_plan(rig, wizard)
        asker.choose("The hand will move. Is its path clear?", {"y": "begin"}, "y")
        measure_all(wizard, measurer, asker)
        return wizard.measured


def _tell_plan(rig: str, wizard: ForearmWizard) -> None:
    from tactile_lab.cli.console import say

    what = "touches of known geometry" if wizard.method == "touch" else "pictures of the board on the hand"
    say(f"Forearm calibration on rig {rig}: {len(wizard.plan)} {what}", "bold")


def _solve(data: ForearmData, settings: CalibrationSettings) -> ForearmResult:
    from rich.progress import Progress

    from calibration.forearm.wizard import solve_forearm, solving_steps
    from tactile_lab.cli.console import people

    with Progress(console=people, transient=True, disable=not people.is_terminal) as progress:
        task = progress.add_task("solving, and repeating without each pose", total=solving_steps(data))
        return solve_forearm(data, settings.wizard, lambda: progress.advance(task))


def show_result(result: ForearmResult) -> None:
    """Residuals of every pose, checks against their limits, and the transform."""
    from math import degrees

    from tactile_lab.cli.calibrate.tables import show_quality
    from tactile_lab.cli.console import show_table

    rows = [
        [
            residual.label,
            f"{1e3 * residual.distance_m:.2f}",
            "" if residual.angle_rad is None else f"{degrees(residual.angle_rad):.2f}",
            "" if residual.pixels is None else f"{residual.pixels:.2f}",
            "outlier" if residual.label in result.quality.outliers else "",
        ]
        for residual in result.quality.residuals
    ]
    show_table("Residuals", ["pose", "mm", "deg", "px", ""], rows, right=(1, 2, 3))
    _show_pose(result)
    show_quality(result.quality.judgements)


def _show_pose(result: ForearmResult) -> None:
    from math import degrees, sqrt

    from tactile_lab.cli.console import show_facts

    pose, spread = result.solution.world_T_mount, result.solution.covariance
    sigmas = [sqrt(spread[i, i]) for i in range(6)]
    inverse = pose.inverse().translation()
    facts = [
        ("world_T_mount", _three([1e3 * value for value in pose.translation()], "mm")),
        ("", _three([degrees(value) for value in pose.rotation().xyz()], "deg roll pitch yaw")),
        ("sigma", _three([1e3 * value for value in sigmas[3:]], "mm")),
        ("", _three([degrees(value) for value in sigmas[:3]], "deg")),
        ("mount_T_world", _three([1e3 * value for value in inverse], "mm")),
        ("noise", f"{sqrt(result.solution.variance_factor):.2f} of the stated errors"),
    ]
    for joint, offset in result.solution.offsets.items():
        if offset.observable:
            facts.append(
                (f"offset of {joint}", f"{degrees(offset.offset_rad):+.2f} +- {degrees(offset.sigma_rad):.2f} deg")
            )
    show_facts("Result", facts + _of_pairs(result.solution.numbers))


def _of_pairs(numbers: Mapping[str, float]) -> list[tuple[str, str]]:
    """What pairs of poses tell besides the pose, and how far away closed forms are, which trust the print."""
    facts = []
    if "print_larger_share" in numbers:
        share, sigma = 100 * numbers["print_larger_share"], 100 * numbers["print_larger_sigma"]
        facts.append(("print", f"{share:+.2f} +- {sigma:.2f} % larger than stated"))
    if "delay_s" in numbers:
        facts.append(("delay", f"{1e3 * numbers['delay_s']:.2f} +- {1e3 * numbers['delay_sigma_s']:.2f} ms"))
    closed = (("Shah", "shah"), ("Park and Martin", "park_martin"))
    return facts + [
        (words, f"{numbers[f'{name}_mm_away']:.2f} mm, {numbers[f'{name}_deg_away']:.2f} deg away")
        for words, name in closed
        if f"{name}_mm_away" in numbers
    ]


def _three(values: list[float], unit: str) -> str:
    return "  ".join(f"{value:9.3f}" for value in values) + f"  {unit}"
