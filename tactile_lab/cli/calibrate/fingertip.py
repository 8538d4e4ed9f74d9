"""``tactile-lab calibrate fingertip``: a force fingertip's mounting, sign, weight and shape."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.calibrate.biotac import Finger
from tactile_lab.cli.calibrate.options import Notes, Record, Replace, SimulationSeed, result_file
from tactile_lab.cli.options import Json, NoInput, RigName
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token, View

if TYPE_CHECKING:
    from calibration.fingertip.data import FingertipData
    from calibration.fingertip.fit import FingertipFit
    from calibration.fingertip.record import FingertipLimits
    from tactile_lab.cli.calibrate.wizard import Asker
    from tactile_lab.workflow.calibrating_fingertip import FingertipRequest, FingertipSettings


def fingertip(
    rig: RigName = "sim",
    finger: Annotated[Finger, typer.Option(help="Finger to measure on the rig (not the thumb).")] = Finger.FF,
    source: Annotated[
        Path | None, typer.Option("--from", help="Solve recorded wrenches instead of measuring (any finger).")
    ] = None,
    record: Record = None,
    out: Annotated[Path | None, result_file("fingertips")] = None,
    settings: Annotated[Path | None, typer.Option(help="Settings file: limits, speeds, force.")] = None,
    presses: Annotated[int, typer.Option(min=6, max=1000, help="Number of presses on the table.")] = 10,
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
    """Calibrate a force fingertip's mounting, sign, weight and shape, step by step.

    The hand is turned with its fingers free, then presses the fingertip on the table and rolls it. The other fingers
    keep the values of the rig's calibration file. Ctrl+C or q at any step stores nothing.

    Exit code 0: PASS; 2: bad input or too few orientations; 3: FAIL, outside a limit (stored as NAME.failed.yaml, which
    sessions refuse); 4: a device failed; 130: ended by the operator.
    """
    from calibration.fingertip.data import load_fingertip_data, save_fingertip_data
    from calibration.fingertip.fit import fit_fingertip
    from calibration.fingertip.record import fingertip_record
    from tactile_lab.cli.calibrate.steps import store_result
    from tactile_lab.cli.calibrate.wizard import may_write, wizard
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.workflow.calibrating_fingertip import FingertipRequest, force_fingertips

    described, wanted = load_rig(rig), _settings(settings)
    here, page = described.installation, PageAddress.if_wanted(view, listen, view_port, token, certificate)
    file = out or Path("calibrations") / here.rig / "fingertips.yaml"
    with wizard(f"calibrate fingertip, rig {rig}", no_input, page) as asker:
        may_write(file, replace, asker, no_input)
        if source is not None:
            data = load_fingertip_data(source, here)
        else:
            data = _measure(FingertipRequest(rig, finger.value, seed, presses, wanted), asker)
            if record is not None:
                save_fingertip_data(record, data)
        tips = force_fingertips(described, data.finger)
        fit = fit_fingertip(data, tips[data.finger], wanted.noise)
        _show(data, fit, wanted.limits)
        found = fingertip_record(data, fit, tips, here, notes, wanted.limits)
        store_result(file, found, asker, as_json)


def _settings(path: Path | None) -> FingertipSettings:
    from drivers.core.configuration import load_model
    from tactile_lab.workflow.calibrating_fingertip import FingertipSettings

    return FingertipSettings() if path is None else load_model(path, FingertipSettings)


def _measure(request: FingertipRequest, asker: Asker) -> FingertipData:
    from tactile_lab.cli.calibrate.steps import measure_all
    from tactile_lab.cli.console import say
    from tactile_lab.workflow.calibrating_fingertip import fingertip_wizard

    with fingertip_wizard(request, asker.onlooker) as (wizard, measurer):
        say(
            f"Fingertip {request.finger} on rig {request.rig}: {len(wizard.plan)} wrenches, with free and "
            "pressed fingertip",
            "bold",
        )
        asker.choose("The hand will move and turn. Is its path clear?", {"y": "begin"}, "y")
        measure_all(wizard, measurer, asker)
        return wizard.measured


def _show(data: FingertipData, fit: FingertipFit, limits: FingertipLimits) -> None:
    """The result, and the checks against their limits."""
    from math import degrees

    from calibration.fingertip.record import judge_fingertip
    from tactile_lab.cli.calibrate.tables import show_quality
    from tactile_lab.cli.console import show_facts

    new = fit.calibration
    facts = [
        ("mounting", "  ".join(f"{degrees(angle):.2f}" for angle in new.distal_T_sensor.rpy_rad) + " deg"),
        ("rotation", f"{degrees(fit.turned_rad):.2f} deg"),
        ("mass", f"{1e3 * new.mass_kg:.2f} g"),
        ("centre of mass", _millimetres(new.com_distal_m)),
        ("ellipsoid's centre", _millimetres(new.centre_distal_m)),
        ("semi-axes", _millimetres(new.semi_axes_m)),
    ]
    show_facts(f"Fingertip {data.finger}", facts)
    show_quality(judge_fingertip(fit, limits))


def _millimetres(values: tuple[float, float, float]) -> str:
    return "  ".join(f"{1e3 * value:.2f}" for value in values) + " mm"
