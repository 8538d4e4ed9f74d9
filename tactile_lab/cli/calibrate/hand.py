"""``tactile-lab calibrate joints`` (touches of a block, or known poses) and ``calibrate electrodes`` (counts)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.calibrate.options import Notes, Record, Replace, SimulationSeed, result_file
from tactile_lab.cli.options import Json, NoInput, RigName
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token, View

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from calibration.forearm.recordings import ForearmData
    from calibration.hand.joints import JointCorrection, JointLimits, JointPose
    from tactile_lab.cli.calibrate.wizard import Asker
    from tactile_lab.rigs.description import Rig
    from tactile_lab.workflow.calibrating_joints import FoundJoints, JointRequest


def joints(
    source: Annotated[
        Path | None, typer.Option("--from", help="Use known poses or recorded touches instead of measuring.")
    ] = None,
    rig: RigName = "sim",
    block: Annotated[Path | None, typer.Option(help="Geometry file with the block, instead of the rig's.")] = None,
    fingers: Annotated[str, typer.Option(help="Fingers that press the block (not the thumb).")] = "FF,MF,RF",
    rounds: Annotated[int, typer.Option(min=1, max=100, help="Number of presses per face and posture.")] = 1,
    settings: Annotated[Path | None, typer.Option(help="Settings file: limits, errors, speeds.")] = None,
    record: Record = None,
    seed: SimulationSeed = 0,
    out: Annotated[Path | None, result_file("joints")] = None,
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
    """Correct the offsets and gains in the hand's joint tables.

    Several fingers press a rigid block at a known pose, stretched and bent; the forearm must be calibrated. Joints
    whose offsets the contacts determine are corrected; the others are listed. With --from: poses with known angles
    (tactile-joint-poses/1, from a jig or a plate), or touches written by --record here or in calibrate forearm. Poses
    without measured angles are read from the hand, step by step, while you hold it in each pose.

    Exit code 0: PASS; 2: the data cannot be used; 3: FAIL, outside a limit (stored as NAME.failed.yaml, which sessions
    refuse); 4: a device failed; 130: ended by the operator.
    """
    from calibration.forearm.recordings import save_data
    from calibration.hand.joints import joints_record, judge_joints
    from tactile_lab.cli.calibrate.steps import store_result
    from tactile_lab.cli.calibrate.wizard import may_write, wizard
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.workflow.calibrating_joints import (
        JointRequest,
        from_file,
        from_known,
        from_touches,
        known_poses,
        load_settings,
    )

    described, wanted = load_rig(rig), load_settings(settings)
    here, page = described.installation, PageAddress.if_wanted(view, listen, view_port, token, certificate)
    file = out or Path("calibrations") / here.rig / "joints.yaml"
    with wizard(f"calibrate joints, rig {rig}", no_input, page) as asker:
        may_write(file, replace, asker, no_input)
        if source is not None and (poses := known_poses(source, described)):
            found = from_known(_read(poses, described, wanted.limits, seed, record, asker))
        elif source is not None:
            found = from_file(source, described, wanted)
        else:
            names = tuple(name.strip() for name in fingers.split(","))
            data = _measure_touches(JointRequest(rig, block, names, rounds, seed, wanted), described, asker)
            if record is not None:
                save_data(record, data)
            found = from_touches(data, described, wanted)
        _show_joints(found, judge_joints(found.corrections, wanted.limits))
        stored = joints_record(
            described.files["joints"],
            found.corrections,
            found.method,
            here,
            notes,
            trusted=found.trusted,
            limits=wanted.limits,
            offsets=found.offsets,
            covariance=found.covariance,
        )
        store_result(file, stored, asker, as_json)


def _measure_touches(request: JointRequest, rig: Rig, asker: Asker) -> ForearmData:
    """Touches of the block, step by step. Raises TactileLabError."""
    from calibration.forearm.recordings import ForearmData
    from tactile_lab.cli.calibrate.steps import measure_all
    from tactile_lab.cli.console import say
    from tactile_lab.workflow.calibrating_joints import joint_wizard

    here = rig.installation
    with joint_wizard(request, asker.onlooker) as (wizard, measurer):
        say(f"Joints on rig {request.rig}: {len(wizard.plan)} touches of the block", "bold")
        asker.choose("The hand will move. Is the block in its place?", {"y": "begin"}, "y")
        measure_all(wizard, measurer, asker)
        return ForearmData(here.rig, dict(here.devices), touches=wizard.touches)


def _read(
    poses: Sequence[JointPose], rig: Rig, limits: JointLimits, seed: int, record: Path | None, asker: Asker
) -> list[JointPose]:
    """All poses with measured angles: missing ones are read from the hand, step by step. Raises TactileLabError."""
    from calibration.hand.pose_steps import save_poses
    from tactile_lab.cli.calibrate.steps import measure_all
    from tactile_lab.cli.console import say
    from tactile_lab.workflow.calibrating_joints import pose_wizard

    with pose_wizard(rig, poses, limits, seed, asker.onlooker) as (steps, hand):
        say(f"Joints on rig {rig.description.name}: {len(steps.plan)} known poses to hold the hand in", "bold")
        say("The motors are passive: put the hand into each pose yourself", "dim")
        measure_all(steps, hand, asker)
        measured = [*(pose for pose in poses if not pose.unread), *steps.poses]
    if record is not None and measured:
        save_poses(record, measured, rig.installation.rig)
    return measured


def _show_joints(found: FoundJoints, faults: Mapping[str, tuple[str, ...]]) -> None:
    """The corrections, the joints that the data do not determine, and the touches against their limits."""
    from math import degrees

    from tactile_lab.cli.console import answer, show_table

    rows = [_joint_row(joint, correction, faults[joint]) for joint, correction in found.corrections.items()]
    rows += [
        [joint, "", f"{degrees(offset.sigma_rad):.2f}", "", "", "", "not determined by these contacts: unchanged"]
        for joint, offset in found.offsets.items()
        if not offset.observable
    ]
    columns = ["joint", "shift, deg", "sigma", "gain", "residual, deg", "poses", ""]
    show_table("Joints", columns, rows, right=(1, 2, 3, 4, 5))
    for judgement in found.judgements:
        answer(f"touches: {judgement}", "dim" if judgement.ok else "bold red")
    if not found.trusted:
        answer("the contacts are outside their limits", "bold red")


def _joint_row(joint: str, found: JointCorrection, faults: tuple[str, ...]) -> list[str]:
    figures = [f"{found.shift_deg:+.2f}", f"{found.sigma_deg:.2f}", f"{found.gain:.3f}", f"{found.rms_deg:.2f}"]
    return [joint, *figures, str(found.poses or ""), "OUTSIDE: " + "; ".join(faults) if faults else "ok"]


def electrodes(
    source: Annotated[Path, typer.Option("--from", help="Recorded data.")],
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Find dead, open and noisy electrodes of a BioTac in a table of counts recorded without contact.

    One line per sample, one column per electrode. Exit code 0: all OK; 2: the table cannot be used; 3: some are faulty.
    """
    from calibration.fingertip.electrodes import faulty_electrodes, load_untouched
    from tactile_lab.cli.console import answer, emit_json, show_table

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
        answer("all OK" if not faults else f"{len(faults)} faulty", "bold red" if faults else "bold green")
    if faults:
        raise typer.Exit(3)
