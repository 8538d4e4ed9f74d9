"""``tactile-lab calibrate joints`` and ``calibrate electrodes``: from touches of a block, known poses, and counts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import LARGEST_SEED, Json, NoInput, RigName
from tactile_lab.cli.running.page_address import PORT, Listen, PageAddress, Port, Token, View

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from calibration.forearm.recordings import ForearmData
    from calibration.hand.joints import JointCorrection, JointLimits, JointPose
    from tactile_lab.cli.calibrate.wizard import Asker
    from tactile_lab.rigs.description import Rig
    from tactile_lab.workflow.calibrating_joints import FoundJoints, JointRequest

Source = Annotated[Path, typer.Option("--from", help="Recorded data.")]
Replace = Annotated[bool, typer.Option("--replace", help="Replace an older result without asking.")]
Notes = Annotated[str, typer.Option(help="The operator's notes, kept with the result.")]


def joints(
    source: Annotated[
        Path | None, typer.Option("--from", help="Known poses, or recorded touches, instead of measuring.")
    ] = None,
    rig: RigName = "sim",
    block: Annotated[Path | None, typer.Option(help="Geometry file with the block, instead of the rig's.")] = None,
    fingers: Annotated[str, typer.Option(help="Long fingers that press the block.")] = "FF,MF,RF",
    rounds: Annotated[int, typer.Option(min=1, max=100, help="How often every face is pressed in every posture.")] = 1,
    settings: Annotated[Path | None, typer.Option(help="Settings: limits, errors, speeds.")] = None,
    record: Annotated[Path | None, typer.Option(help="Keep the measured touches or poses in this file too.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of a simulated rig.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="File of the result.", show_default="calibrations/STATION/joints.yaml")
    ] = None,
    replace: Replace = False,
    notes: Notes = "",
    view: View = False,
    view_port: Port = PORT,
    listen: Listen = "127.0.0.1",
    token: Token = "",
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Correct the offsets and gains in the hand's joint tables.

    Several fingers press one rigid block at a known place, stretched and bent; the forearm has to be calibrated. Those
    joints are corrected whose offset the contacts tell, the others are named. Or --from: poses whose angles are known
    (tactile-joint-poses/1: by a jig or a plate), or touches as --record here or in calibrate forearm writes them. Poses
    without measured angles are read from the hand, step by step, while you hold it in them.

    Exit code 0: PASS; 2: the data cannot be used; 3: FAIL, outside a limit (kept as NAME.failed.yaml, which sessions
    refuse); 4: a device; 130: ended by the operator.
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
    here, page = described.installation, PageAddress.if_wanted(view, listen, view_port, token)
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
        asker.choose("The hand will move. Stands the block in its place?", {"y": "begin"}, "y")
        measure_all(wizard, measurer, asker)
        return ForearmData(here.rig, dict(here.devices), touches=wizard.touches)


def _read(
    poses: Sequence[JointPose], rig: Rig, limits: JointLimits, seed: int, record: Path | None, asker: Asker
) -> list[JointPose]:
    """All poses measured: those that were not are read from the hand, step by step. Raises TactileLabError."""
    from calibration.hand.pose_steps import save_poses
    from tactile_lab.cli.calibrate.steps import measure_all
    from tactile_lab.cli.console import say
    from tactile_lab.workflow.calibrating_joints import pose_wizard

    with pose_wizard(rig, poses, limits, seed, asker.onlooker) as (steps, hand):
        say(f"Joints on rig {rig.description.name}: {len(steps.plan)} known poses to hold the hand in", "bold")
        say("Its motors stay without demands: put it into each pose by hand", "dim")
        measure_all(steps, hand, asker)
        measured = [*(pose for pose in poses if not pose.unread), *steps.poses]
    if record is not None and measured:
        save_poses(record, measured, rig.installation.rig)
    return measured


def _show_joints(found: FoundJoints, faults: Mapping[str, tuple[str, ...]]) -> None:
    """The corrections, the joints that nothing tells, and the touches against their limits."""
    from math import degrees

    from tactile_lab.cli.console import answer, show_table

    rows = [_joint_row(joint, correction, faults[joint]) for joint, correction in found.corrections.items()]
    rows += [
        [joint, "", f"{degrees(offset.sigma_rad):.2f}", "", "", "", "not told by these contacts: left as it was"]
        for joint, offset in found.offsets.items()
        if not offset.observable
    ]
    columns = ["joint", "shift, deg", "sigma", "gain", "left, deg", "poses", ""]
    show_table("Joints", columns, rows, right=(1, 2, 3, 4, 5))
    for judgement in found.judgements:
        answer(f"touches: {judgement}", "dim" if judgement.ok else "bold red")
    if not found.trusted:
        answer("the contacts are outside their limits", "bold red")


def _joint_row(joint: str, found: JointCorrection, faults: tuple[str, ...]) -> list[str]:
    figures = [f"{found.shift_deg:+.2f}", f"{found.sigma_deg:.2f}", f"{found.gain:.3f}", f"{found.rms_deg:.2f}"]
    return [joint, *figures, str(found.poses or ""), "OUTSIDE: " + "; ".join(faults) if faults else "ok"]


def electrodes(source: Source, as_json: Json = False, no_input: NoInput = False) -> None:
    """Look for dead, open and noisy electrodes of a BioTac, in a table of counts recorded untouched.

    A line a sample, a column an electrode. Exit code 0: all well; 2: the table cannot be used; 3: some are faulty.
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
        answer("all well" if not faults else f"{len(faults)} faulty", "bold red" if faults else "bold green")
    if faults:
        raise typer.Exit(3)
