"""``tactile-lab calibrate joints`` and ``calibrate fingertip``: from recorded poses, contacts and wrenches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, RigName

if TYPE_CHECKING:
    from calibration.joints import JointCorrection
    from calibration.store import CalibrationRecord

Source = Annotated[Path, typer.Option("--from", help="Recorded data.")]
Replace = Annotated[bool, typer.Option("--replace", help="Replace an older result without asking.")]
Notes = Annotated[str, typer.Option(help="The operator's notes, kept with the result.")]


def joints(
    source: Source,
    rig: RigName = "sim",
    out: Annotated[
        Path | None, typer.Option(help="File of the result.", show_default="calibrations/STATION/joints.yaml")
    ] = None,
    replace: Replace = False,
    notes: Notes = "",
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Correct the offsets and gains in the hand's joint tables.

    From poses whose angles are known (tactile-joint-poses/1: by a jig or a plate), or from touches of one rigid known
    body with several fingers (tactile-forearm-data/1, as calibrate forearm --record writes them): then those joints
    are corrected whose offset the contacts tell.

    Exit code 0: done; 2: the data can not be used.
    """
    from calibration.joints import joints_record
    from tactile_lab.cli.console import show_table
    from tactile_lab.rigs.description import load_rig

    described = load_rig(rig)
    method, corrections = _corrections(source, rig)
    rows = [
        [joint, f"{c.shift_deg:+.2f}", f"{c.sigma_deg:.2f}", f"{c.gain:.3f}", f"{c.rms_deg:.2f}", str(c.poses or "")]
        for joint, c in corrections.items()
    ]
    show_table("Joints", ["joint", "shift, deg", "sigma", "gain", "left, deg", "poses"], rows, right=(1, 2, 3, 4, 5))
    here = described.installation
    record = joints_record(described.files["joints"], corrections, method, here, notes)
    _store(out or Path("calibrations") / here.rig / "joints.yaml", record, replace, no_input, as_json)


def _corrections(source: Path, rig: str) -> tuple[str, dict[str, JointCorrection]]:
    """Corrections and their method, from either kind of data. Raises ConfigurationError."""
    from calibration.forearm_record import check_origin
    from calibration.forearm_wizard import solve_forearm
    from calibration.joints import from_contacts, from_poses, load_poses
    from calibration.recordings import FORMAT, load_data
    from tactile_lab.errors import ConfigurationError
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.strict_yaml import load

    here, content = load_rig(rig).installation, load(source)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return "known poses", from_poses(load_poses(source, here).poses)
    data = load_data(source)
    check_origin(data, here, str(source))
    if not data.touches:
        hint = "Record touches: tactile-lab calibrate forearm --method touch --record FILE"
        raise ConfigurationError("holds pictures, which tell no finger's joints", where=str(source), hint=hint)
    return "contacts", from_contacts(solve_forearm(data).solution.offsets)


def fingertip(
    source: Source,
    rig: RigName = "sim",
    out: Annotated[
        Path | None, typer.Option(help="File of the result.", show_default="calibrations/STATION/fingertips.yaml")
    ] = None,
    replace: Replace = False,
    notes: Notes = "",
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Find a force fingertip's mounting, sign, weight and shape from wrenches in known orientations.

    The data (tactile-fingertip-data/1) are mean wrenches: untouched in several orientations of the hand, and pressed
    and rolled on a level plate. The other fingers keep what the rig's file says.

    Exit code 0: done; 2: the data can not be used.
    """
    from math import degrees

    from calibration.fingertip_fit import fit_fingertip, load_fingertip_data
    from calibration.fingertip_record import fingertip_record
    from drivers.fingertip import load_fingertips
    from tactile_lab.cli.console import show_facts
    from tactile_lab.errors import ConfigurationError
    from tactile_lab.rigs.description import load_rig

    described = load_rig(rig)
    if described.description.fingertips != "nano17":
        hint = "See calibrate biotac for BioTacs"
        raise ConfigurationError("has no force fingertips", where=described.source, hint=hint)
    here = described.installation
    data, tips = load_fingertip_data(source, here), load_fingertips(described.files["fingertips"])
    if data.finger not in tips:
        hint = "Add its nominal values to the file first"
        raise ConfigurationError(f"does not name {data.finger}", where=str(described.files["fingertips"]), hint=hint)
    fit = fit_fingertip(data, tips[data.finger])
    new = fit.calibration
    facts = [
        ("mounting turned by", f"{degrees(fit.turned_rad):.2f} deg"),
        ("mass", f"{1e3 * new.mass_kg:.2f} +- {1e3 * fit.sigmas['mass_kg']:.2f} g"),
        ("centre of mass", _millimetres(new.com_distal_m)),
        ("ellipsoid's centre", _millimetres(new.centre_distal_m)),
        ("semi-axes", _millimetres(new.semi_axes_m)),
        ("left of the forces", f"{1e3 * fit.rms_force_N:.1f} mN"),
    ]
    show_facts(f"Fingertip {data.finger}", facts)
    record = fingertip_record(data, fit, tips, here, notes)
    _store(out or Path("calibrations") / here.rig / "fingertips.yaml", record, replace, no_input, as_json)


def electrodes(source: Source, as_json: Json = False, no_input: NoInput = False) -> None:
    """Look for dead, open and noisy electrodes of a BioTac, in a table of counts recorded untouched.

    A line a sample, a column an electrode. Exit code 0: all well; 2: the table can not be used; 3: some are faulty.
    """
    from calibration.electrodes import faulty_electrodes, load_untouched
    from tactile_lab.cli.console import emit_json, say, show_table

    del no_input
    counts = load_untouched(source)
    faults = faulty_electrodes(counts)
    rows = [
        [str(index + 1), f"{counts[:, index].mean():.0f}", f"{counts[:, index].std():.1f}", faults.get(index, "")]
        for index in range(counts.shape[1])
    ]
    if as_json:
        emit_json({"tare": counts.mean(axis=0).tolist(), "faults": {str(i + 1): text for i, text in faults.items()}})
    else:
        show_table("Electrodes", ["electrode", "tare", "noise", ""], rows, right=(0, 1, 2))
        say("all well" if not faults else f"{len(faults)} faulty", "bold red" if faults else "bold green")
    if faults:
        raise typer.Exit(3)


def _millimetres(values: tuple[float, float, float]) -> str:
    return "  ".join(f"{1e3 * value:.2f}" for value in values) + " mm"


def _store(file: Path, record: CalibrationRecord, replace: bool, no_input: bool, as_json: bool) -> None:
    """Ask, write, and tell."""
    from calibration.store import write_record
    from tactile_lab.calibration_file import plain
    from tactile_lab.cli.calibration_tables import tell_verdict
    from tactile_lab.cli.console import emit_json, say
    from tactile_lab.cli.wizard import Asker, may_write

    asker = Asker(no_input, f"calibrate {record.kind}")
    may_write(file, replace, asker, no_input)
    if not asker.agree(f"Store it as {file}?"):
        raise asker.ended()
    write_record(file, record)
    if as_json:
        emit_json({"file": str(file), **plain(record)})
    tell_verdict(record)
    say(f"stored  {file}")
    say(f"To use it, name it in the rig file: calibration.{record.kind}: {file}")
