"""A force fingertip's calibration on a rig: the wizard's plan and its measurer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar

from calibration.fingertip.data import FingertipData
from calibration.fingertip.model import FingertipNoise
from calibration.fingertip.plan import plan_wrenches
from calibration.fingertip.record import FingertipLimits
from calibration.fingertip.wizard import FingertipWizard
from calibration.forearm.placement import load_forearm
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import FingertipCalibration
from drivers.shadow.model.hand_form import HandForm
from sessions.measuring.fingertip_measurer import FingertipMeasurer, FingertipMeasurerSettings
from sessions.recording.recorder import TrafficSink
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.laboratory import connected_runtime
from tactile_lab.rigs.wired import hand_form
from tactile_lab.workflow.calibrating_forearm import clear_table, tip_shapes


class FingertipSettings(StrictModel):
    """A file of settings for ``calibrate fingertip``.

    Attributes:
        limits: what a result must keep to.
        noise: errors of the wrenches.
        measurer: how the hand moves.
    """

    renamed: ClassVar = {"station": "measurer"}

    limits: FingertipLimits = FingertipLimits()
    noise: FingertipNoise = FingertipNoise()
    measurer: FingertipMeasurerSettings = FingertipMeasurerSettings()


@dataclass(frozen=True)
class FingertipRequest:
    """What a person asks for.

    Attributes:
        rig: name of a shipped rig, or a rig file.
        finger: a long finger.
        seed: of a simulated rig.
        presses: on the table.
        settings: see there.
    """

    rig: str
    finger: str
    seed: int = 0
    presses: int = 10
    settings: FingertipSettings = field(default_factory=FingertipSettings)


@contextmanager
def fingertip_wizard(
    request: FingertipRequest, onlooker: TrafficSink
) -> Iterator[tuple[FingertipWizard, FingertipMeasurer]]:
    """A wizard with a connected measurer; the hand is lifted off and everything closed in the end.

    Args:
        request: see there.
        onlooker: is shown the hand while it moves.

    Raises:
        ConfigurationError: the rig lacks what is needed, or the finger cannot be stretched alone.
        DeviceError: the rig is not ready.
    """
    rig = load_rig(request.rig)
    check_calibration(rig)
    before, form = force_fingertips(rig, request.finger)[request.finger], hand_form(rig)
    if request.finger not in form.long_fingers:
        hint = "Record its wrenches by hand, and give them with --from"
        raise ConfigurationError(f"{request.finger} cannot be stretched on its own", where="--finger", hint=hint)
    world_T_mount = load_forearm(rig.files["forearm"]).world_T_mount.pose()
    plan, data = plan_wrenches(request.finger, request.presses, form), _data(rig, request.finger, form)
    wizard = FingertipWizard(plan, data, before, request.settings.noise)
    with connected_runtime(clear_table(rig), request.seed, "box-10x6x4", onlooker) as runtime:
        measurer = FingertipMeasurer(runtime, world_T_mount, tip_shapes(rig), request.settings.measurer)
        yield wizard, measurer
        measurer.close()


def force_fingertips(rig: Rig, finger: str) -> dict[str, FingertipCalibration]:
    """The rig's force fingertips. Raises ConfigurationError when it has none, or not this one."""
    tips = rig.description.fingertip_kind.load(rig.files)
    if not all(isinstance(tip, FingertipCalibration) for tip in tips.values()):
        hint = "See calibrate biotac for BioTacs"
        raise ConfigurationError("has no force fingertips", where=rig.source, hint=hint)
    if finger not in tips:
        hint = "Add its nominal values to the file first"
        raise ConfigurationError(f"does not name {finger}", where=str(rig.files["fingertips"]), hint=hint)
    return dict(tips)


def _data(rig: Rig, finger: str, form: HandForm) -> FingertipData:
    here = rig.installation
    serial = here.devices.get(f"ft/{finger}", "")
    return FingertipData.model_validate(
        {"rig": here.rig, "finger": finger, "serial": serial, "side": form.side, "free": (), "presses": ()}
    )
