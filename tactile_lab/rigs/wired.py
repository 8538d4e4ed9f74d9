"""Devices on wires: how they are reached and decoded, in a real laboratory or in one that this program emulates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from calibration.forearm.placement import load_forearm
from drivers.ati.wires.wire import ForceWire
from drivers.camera.calibration import load_camera
from drivers.camera.markers import MarkerSettings
from drivers.camera.source_settings import CameraSourceSettings, source_beside
from drivers.core.clock import Clock
from drivers.core.configuration import load_model
from drivers.core.errors import CodecError, ConfigurationError
from drivers.emulators.laboratory.emulated_laboratory import SERIAL, EmulationPlan, HandPlace, Place
from drivers.fingertips.kind import PalmKind
from drivers.fingertips.kinds import WIRES
from drivers.fingertips.wiring import make_wire
from drivers.force.wire_settings import WireSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.hand_info import HandStatement, load_infos, stated_form
from drivers.shadow.protocol.palm_images import USUAL_PALM
from drivers.simulation.settings import SimulationSettings
from sessions.perception.interpreter import HAND_LINK
from tactile_lab.rigs.description import Rig, wire_role
from tactile_lab.rigs.wires import LocalCamera, RemoteCamera, Wires

_HAND_FILES = ("joints", "motors", "boards", "rates", "gains")


def wires_of(rig: Rig) -> Wires:
    """A wired rig's wires."""
    assert rig.description.wires is not None
    return rig.description.wires


def hand_setup(rig: Rig) -> HandSetup:
    """The hand of a rig on wires. Raises ConfigurationError where the rig file names two hands."""
    description, files, wiring = rig.description, rig.files, wires_of(rig).hand
    return HandSetup(
        name=HAND_LINK,
        ethercat=_of_the_named_hand(rig, wiring.ethercat),
        master=wiring.master,
        hand=description.hand.on_wire.model_copy(update={"tactile": tactile_of(rig)}),
        joints=files["joints"].resolve(),
        motors=files["motors"].resolve(),
        boards=_whole(files.get("boards")),
        rates=_whole(files.get("rates")),
        gains=_whole(files.get("gains")),
    )


def _of_the_named_hand(rig: Rig, wiring: EthercatSettings) -> EthercatSettings:
    """The wiring, with the serial number that ``devices`` gives the hand, which the connected one must then have."""
    named = rig.description.devices.get(HAND_LINK, "")
    if not named.isdecimal() or wiring.serial == int(named):
        return wiring
    if wiring.serial is not None:
        what = f"devices names hand {named}, but wires.hand.ethercat.serial hand {wiring.serial}"
        raise ConfigurationError(what, where=rig.source, hint="Name the connected hand in both places")
    return wiring.model_copy(update={"serial": int(named)})


def tactile_of(rig: Rig) -> str:
    """What the rig's palm requests from its fingertips."""
    kind = rig.description.fingertip_kind
    return kind.tactile if isinstance(kind, PalmKind) else "none"


def simulation_settings(rig: Rig, object_name: str) -> SimulationSettings:
    """The simulated world of a rig, with the rig's own settings."""
    description = rig.description
    changes = {"object": object_name, "fingertips": description.fingertips, "positioner": description.positioner}
    if "side" not in description.simulation.model_fields_set:
        changes["side"] = hand_form(rig).side
    return description.simulation.model_copy(update=changes)


def hand_form(rig: Rig) -> HandForm:
    """Which hand a rig has, by the hand's own files and the rig's.

    Raises:
        ConfigurationError: they contradict each other.
    """
    stated = rig.description.hand
    where = f"{rig.source}: hand"
    infos = load_infos(rig.files[role] for role in _HAND_FILES if role in rig.files)
    return stated_form(rig.files["motors"], infos, HandStatement(where, stated.side, stated.fingers))


def with_form(rig: Rig) -> Rig:
    """A rig with its hand's side and fingers named, so that a session keeps which hand it was.

    A simulated hand is of that side too, unless the rig says otherwise.
    """
    form, description = hand_form(rig), rig.description
    changes: dict[str, object] = {
        "hand": description.hand.model_copy(update={"side": form.side, "fingers": form.fingers})
    }
    if "side" not in description.simulation.model_fields_set:
        changes["simulation"] = description.simulation.model_copy(update={"side": form.side})
    return replace(rig, description=description.model_copy(update=changes))


def with_palm(rig: Rig, clock: Clock) -> Rig:
    """A rig on wires with its palm and its cycle named, so that a session keeps how its hand was read and driven.

    Raises:
        DeviceError: neither the rig file nor the ring states it.
    """
    found = hand_setup(rig).with_known_palm(clock).hand
    hand = rig.description.hand.model_copy(update={"palm": found.palm, "cycle_s": found.cycle_s})
    return replace(rig, description=rig.description.model_copy(update={"hand": hand}))


def force_wire(rig: Rig, finger: str) -> ForceWire:
    """How a finger's readings are decoded, live and in a replay.

    Raises:
        ConfigurationError: a calibration file that the wire names cannot be used.
    """
    wiring = wires_of(rig).fingertips[finger]
    named = WIRES[wiring.wire].files(wiring)
    here = {setting: str(rig.files[wire_role(finger, setting)].resolve()) for setting in named}
    wiring = wiring.model_copy(update=here)
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
        what = f"detects {settings.dictionary}, but the markers are from {markers.dictionary}"
        raise ConfigurationError(what, where=where, hint="Remove dictionary: the marker file has it")
    size_px = lens.size_px or settings.size_px
    if "size_px" in given and settings.size_px != size_px:
        stated, made = (" x ".join(map(str, size)) for size in (settings.size_px, size_px))
        what = f"takes pictures of {stated} pixels, but the lens was calibrated with {made}"
        raise ConfigurationError(what, where=where, hint="Calibrate the camera for this size, or remove size_px")
    source = source_beside(settings.source, Path(rig.source).parent)
    known = settings.model_copy(update={"source": source, "dictionary": markers.dictionary, "size_px": size_px})
    known.place()
    return known


def emulation_plan(rig: Rig, seed: int, object_name: str) -> EmulationPlan:
    """What has to be emulated for a rig with emulators.

    Raises:
        ConfigurationError: a wire on which the simulated plant has no emulator.
    """
    wires = wires_of(rig)
    return EmulationPlan(
        simulation=simulation_settings(rig, object_name),
        seed=seed,
        hand=_hand_place(rig),
        base=_base_start(rig),
        tips=rig.files["fingertips"].resolve(),
        wires={finger: _with_emulator(rig, finger, wiring) for finger, wiring in wires.fingertips.items()},
        camera=_camera_place(rig),
    )


def _hand_place(rig: Rig) -> HandPlace:
    wiring = wires_of(rig).hand
    if wiring.far_end is None:
        hint = "Give the other end of the virtual cable, as in the built-in rig sim-wire"
        raise ConfigurationError("emulators need wires.hand.far_end", where=rig.source, hint=hint)
    setup = hand_setup(rig)
    serial = setup.wiring().serial
    return HandPlace(
        near=wiring.ethercat.interface,
        far=wiring.far_end,
        joints=rig.files["joints"].resolve(),
        motors=rig.files["motors"].resolve(),
        palm=setup.stated_palm or USUAL_PALM,
        serial=SERIAL if serial is None else serial,
    )


def _camera_place(rig: Rig) -> Place | None:
    """Address of the plant's emulated camera; a camera of this computer is used directly."""
    camera, eye = wires_of(rig).camera, rig.description.simulation.camera
    if isinstance(camera, RemoteCamera) and (eye.stream_hz is not None or eye.late_ms):
        what, hint = "the emulated camera waits for triggers and answers immediately", "Remove stream_hz and late_ms"
        raise ConfigurationError(what, where=f"{rig.source}: simulation.camera", hint=hint)
    return (camera.host, camera.port) if isinstance(camera, RemoteCamera) else None


def _base_start(rig: Rig) -> dict[str, Any]:
    wiring, kind = wires_of(rig).base, rig.description.positioner_kind
    if not kind.emulator_host:
        what, hint = f"there is no emulator of the positioner {rig.description.positioner}", "Run it on a simulated rig"
        raise ConfigurationError(what, where=f"{rig.source}: wires.base", hint=hint)
    mount = load_forearm(rig.files["forearm"]).world_T_mount.pose()
    return {
        "wiring": wiring.model_dump(mode="json"),
        "settings": rig.description.base.model_dump(mode="json"),
        "world_T_mount": mount.matrix().tolist(),
    }


def _with_emulator(rig: Rig, finger: str, wiring: WireSettings) -> WireSettings:
    if not WIRES[wiring.wire].emulator_host:
        fed = ", ".join(name for name, wire in WIRES.items() if wire.emulator_host)
        where = f"{rig.source}: wires.fingertips.{finger}"
        raise ConfigurationError(f"the simulated plant feeds only {fed} wires", where=where, hint=f"Use wire: {fed}")
    return wiring


def _whole(path: Path | None) -> Path | None:
    return None if path is None else path.resolve()
