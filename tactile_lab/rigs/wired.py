"""Devices on wires: how they are reached and decoded, in a real laboratory or in one that this program emulates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from drivers.ati.wire import ForceWire
from drivers.ati.wiring import NetBoxWiring, VoltsWiring, Wiring, make_wire
from drivers.camera.calibration import load_camera
from drivers.camera.markers import MarkerSettings
from drivers.camera.source_settings import CameraSourceSettings, source_beside
from drivers.emulators.wired.stand_ins import SERIAL, HandPlace, Place, StandInPlan
from drivers.shadow.hand_setup import HandSetup
from drivers.shadow.palm_images import USUAL_PALM
from sessions.interpreter import HAND_LINK
from tactile_lab.clock import Clock
from tactile_lab.errors import CodecError, ConfigurationError
from tactile_lab.rigs.description import Rig, gauge_role
from tactile_lab.rigs.wires import LocalCamera, RemoteCamera, Wires
from tactile_lab.strict_yaml import load_model


def wires_of(rig: Rig) -> Wires:
    """A wired rig's wires."""
    assert rig.description.wires is not None
    return rig.description.wires


def hand_setup(rig: Rig) -> HandSetup:
    """The hand of a rig on wires."""
    description, files, wiring = rig.description, rig.files, wires_of(rig).hand
    tactile = "biotac" if description.fingertips == "biotac" else "none"
    return HandSetup(
        name=HAND_LINK,
        ethercat=wiring.ethercat,
        master=wiring.master,
        hand=description.hand.on_wire.model_copy(update={"tactile": tactile}),
        joints=files["joints"].resolve(),
        motors=files["motors"].resolve(),
        boards=_whole(files.get("boards")),
        rates=_whole(files.get("rates")),
        gains=_whole(files.get("gains")),
    )


def with_palm(rig: Rig, clock: Clock) -> Rig:
    """A rig on wires with its palm and its cycle named, so that a session keeps how its hand was read and driven.

    Raises:
        DeviceError: the rig file leaves it to the ring, which does not tell.
    """
    found = hand_setup(rig).known(clock).hand
    hand = rig.description.hand.model_copy(update={"palm": found.palm, "cycle_s": found.cycle_s})
    return replace(rig, description=rig.description.model_copy(update={"hand": hand}))


def force_wire(rig: Rig, finger: str) -> ForceWire:
    """How a finger's readings are decoded, live and in a replay.

    Raises:
        ConfigurationError: a calibration file that the wire names can not be used.
    """
    wiring: Wiring = wires_of(rig).fingertips[finger]
    if isinstance(wiring, VoltsWiring):
        wiring = wiring.model_copy(update={"calibration": str(rig.files[gauge_role(finger)].resolve())})
    try:
        return make_wire(wiring, Path())
    except CodecError as error:
        where = f"{rig.source}: wires.fingertips.{finger}"
        raise ConfigurationError(error.what, where=where, hint=error.hint) from error


def camera_source(rig: Rig, wiring: LocalCamera) -> CameraSourceSettings:
    """A camera of this computer; what its lens and markers say need not be said again.

    Raises:
        ConfigurationError: no such camera, folder or file, or one that contradicts the lens or the markers.
    """
    settings, where = wiring.settings, f"{rig.source}: wires.camera"
    lens, markers = load_camera(rig.files["camera"]), load_model(rig.files["markers"], MarkerSettings)
    given = settings.model_fields_set
    if "dictionary" in given and settings.dictionary != markers.dictionary:
        what = f"looks for {settings.dictionary}, the markers are of {markers.dictionary}"
        raise ConfigurationError(what, where=where, hint="Leave dictionary out: the marker file says it")
    size_px = lens.size_px or settings.size_px
    if "size_px" in given and settings.size_px != size_px:
        stated, made = (" x ".join(map(str, size)) for size in (settings.size_px, size_px))
        what = f"takes pictures of {stated} pixels, the lens was calibrated with {made}"
        raise ConfigurationError(what, where=where, hint="Calibrate the camera for this size, or leave size_px out")
    source = source_beside(settings.source, Path(rig.source).parent)
    known = settings.model_copy(update={"source": source, "dictionary": markers.dictionary, "size_px": size_px})
    known.place()
    return known


def stand_in_plan(rig: Rig, seed: int, object_name: str) -> StandInPlan:
    """What has to be emulated for a rig with stand-ins.

    Raises:
        ConfigurationError: a wire on which the simulated plant has no emulator.
    """
    wires, description = wires_of(rig), rig.description
    changes = {"object": object_name, "fingertips": description.fingertips}
    return StandInPlan(
        simulation=description.simulation.model_copy(update=changes),
        seed=seed,
        hand=_hand_place(rig),
        base=(wires.base.host, wires.base.port),
        boxes={finger: _box(rig, finger, wiring) for finger, wiring in wires.fingertips.items()},
        camera=_camera_place(rig),
    )


def _hand_place(rig: Rig) -> HandPlace:
    wiring = wires_of(rig).hand
    if wiring.far_end is None:
        hint = "Name the other end of the virtual cable, as the shipped sim-wire rig does"
        raise ConfigurationError("stand-ins need wires.hand.far_end", where=rig.source, hint=hint)
    return HandPlace(
        near=wiring.ethercat.interface,
        far=wiring.far_end,
        joints=rig.files["joints"].resolve(),
        motors=rig.files["motors"].resolve(),
        palm=hand_setup(rig).stated_palm or USUAL_PALM,
        serial=SERIAL if wiring.ethercat.serial is None else wiring.ethercat.serial,
        biotacs=rig.files["fingertips"].resolve() if rig.description.fingertips == "biotac" else None,
    )


def _camera_place(rig: Rig) -> Place | None:
    """Where the plant's camera is served; a camera of this computer is used as it is, and sees what it sees."""
    camera, eye = wires_of(rig).camera, rig.description.simulation.camera
    if isinstance(camera, RemoteCamera) and (eye.stream_hz is not None or eye.late_ms):
        what, hint = "the stand-in camera waits for triggers, and answers at once", "Leave stream_hz and late_ms out"
        raise ConfigurationError(what, where=f"{rig.source}: simulation.camera", hint=hint)
    return (camera.host, camera.port) if isinstance(camera, RemoteCamera) else None


def _box(rig: Rig, finger: str, wiring: Wiring) -> NetBoxWiring:
    if not isinstance(wiring, NetBoxWiring):
        where = f"{rig.source}: wires.fingertips.{finger}"
        raise ConfigurationError("the simulated plant feeds net-ft wires alone", where=where, hint="Use wire: net-ft")
    return wiring


def _whole(path: Path | None) -> Path | None:
    return None if path is None else path.resolve()
