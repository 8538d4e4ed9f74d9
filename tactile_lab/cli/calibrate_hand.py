"""``tactile-lab calibrate joints`` and ``calibrate electrodes``: from recorded poses, contacts and counts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, RigName

if TYPE_CHECKING:
    from calibration.joints import JointCorrection

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

    Exit code 0: PASS; 2: the data can not be used; 3: FAIL, outside a limit (kept as NAME.failed.yaml, which sessions
    refuse).
    """
    from calibration.joints import joints_record, judge_joints
    from tactile_lab.cli.calibrate_steps import store_result
    from tactile_lab.cli.console import say, show_table
    from tactile_lab.cli.wizard import Asker
    from tactile_lab.rigs.description import load_rig

    described = load_rig(rig)
    method, corrections, trusted = _corrections(source, rig)
    faults = judge_joints(corrections)
    rows = [_joint_row(joint, found, faults[joint]) for joint, found in corrections.items()]
    columns = ["joint", "shift, deg", "sigma", "gain", "left, deg", "poses", ""]
    show_table("Joints", columns, rows, right=(1, 2, 3, 4, 5))
    if not trusted:
        say("the contacts are outside their limits: see tactile-lab calibrate forearm", "bold red")
    here = described.installation
    record = joints_record(described.files["joints"], corrections, method, here, notes, trusted=trusted)
    asker = Asker(no_input, "calibrate joints")
    store_result(out or Path("calibrations") / here.rig / "joints.yaml", record, replace, asker, no_input, as_json)


def _joint_row(joint: str, found: JointCorrection, faults: tuple[str, ...]) -> list[str]:
    figures = [f"{found.shift_deg:+.2f}", f"{found.sigma_deg:.2f}", f"{found.gain:.3f}", f"{found.rms_deg:.2f}"]
    return [joint, *figures, str(found.poses or ""), "OUTSIDE: " + "; ".join(faults) if faults else "ok"]


def _corrections(source: Path, rig: str) -> tuple[str, dict[str, JointCorrection], bool]:
    """Method, corrections, and whether their data kept to their limits. Raises ConfigurationError."""
    from calibration.forearm_record import check_origin
    from calibration.forearm_wizard import solve_forearm
    from calibration.joints import from_contacts, from_poses, load_poses
    from calibration.recordings import FORMAT, load_data
    from tactile_lab.errors import ConfigurationError
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.strict_yaml import load

    here, content = load_rig(rig).installation, load(source)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return "known poses", from_poses(load_poses(source, here).poses), True
    data = load_data(source)
    check_origin(data, here, str(source))
    if not data.touches:
        hint = "Record touches: tactile-lab calibrate forearm --method touch --record FILE"
        raise ConfigurationError("holds pictures, which tell no finger's joints", where=str(source), hint=hint)
    result = solve_forearm(data)
    return "contacts", from_contacts(result.solution.offsets), result.quality.passed


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
