"""Bytes, bits and words of the hand: every field of every palm's image, every flag, every identifier."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drivers.core.errors import CodecError
from drivers.ethercat.registers import AlState, AlStatus, Fmmu, Register, SyncManager
from drivers.shadow.device.tactile_requests import TactileQuestion, TactileRotation, electrode_request
from drivers.shadow.protocol.motor_can import MotorIdentifier, bus_of
from drivers.shadow.protocol.motor_configuration import TorqueLoop
from drivers.shadow.protocol.motor_data import (
    FromMotor,
    SlowData,
    ToMotor,
    as_signed,
    celsius,
    config_crc,
    config_upload,
    crc16,
    describe_flags,
    volts,
)
from drivers.shadow.protocol.palm_images import PALMS, SIDES, PalmName, describe_product
from drivers.shadow.protocol.palm_messages import SENSORS, CanFrame, PalmAuxiliary, PalmCommand, PalmStatus
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

COMMAND = PalmCommand(
    edc_command=1,
    from_motor_data_type=int(FromMotor.TEMPERATURE),
    which_motors=1,
    to_motor_data_type=int(ToMotor.DEMAND_TORQUE),
    motor_data=tuple(range(-900, 1100, 100)),
    tactile_data_type=0xFFFC,
    can=CanFrame(2, 3, 0x5A1, b"abc45678"),
    imu_command=1,
    imu_scales=(2, 3),
    aux_data_type=5,
)


def status(slots: int) -> PalmStatus:
    auxiliary = PalmAuxiliary(np.arange(40, dtype=np.uint16).reshape(5, 8), 7, np.arange(100, 116, dtype=np.uint16))
    return PalmStatus(
        edc_command=1,
        sensors=np.arange(1000, 1037, dtype=np.uint16),
        motor_data_type=int(FromMotor.CURRENT),
        which_motors=1,
        arrived=0xFFBFF,
        had_errors=0x00020,
        torque=np.arange(-5, 5, dtype=np.int16),
        misc=np.arange(65000, 65010, dtype=np.uint16),
        tactile_data_type=3,
        tactile_valid=0b10110,
        tactile=(np.arange(5 * slots) % 256).astype(np.uint8).reshape(5, slots),
        idle_time_us=77,
        can=CanFrame(1, 8, 0x2B3, b"12345678"),
        auxiliary=auxiliary,
    )


@pytest.mark.parametrize("name", PALMS)
def test_the_images_of_each_palm(name: PalmName) -> None:
    palm = PALMS[name]
    told = status({"0230": 32, "0250": 78}.get(name, 16))
    sent, answered = palm.encode_command(COMMAND), palm.encode_status(told)
    back = palm.decode_status(answered)
    refused = []
    for content in (sent[:-1], answered + b"\0"):
        for decode in (palm.decode_command, palm.decode_status):
            with pytest.raises(CodecError) as error:
                decode(content)
            refused.append(f"{error.value.where}: {error.value.what} / {error.value.hint}")
    found = {
        "command": sent.hex(),
        "status": answered.hex(),
        "command read": plain(palm.decode_command(sent)),
        "status read": {key: value for key, value in plain(back).items() if key != "heard_places"},
        "managers": [manager.encode().hex() for manager in (*palm.sync_managers(), *palm.sync_managers(watched=True))],
        "memory": [each.encode().hex() for each in palm.fmmus()],
        "products": [list(palm.products), palm.command_bytes, palm.status_bytes],
        "refused": refused,
    }
    assert_baseline(f"palm/{name}", found)


def test_which_motors_were_heard() -> None:
    found = {}
    for parity in (0, 1, 2):
        for arrived, wrong in ((0xFFFFF, 0), (0x00FF3, 0x00110)):
            heard = PalmStatus(**{**vars(status(16)), "which_motors": parity, "arrived": arrived, "had_errors": wrong})
            places = [part.indices(20) if isinstance(part, slice) else part.tolist() for part in heard.heard_places]
            found[f"{parity} {arrived:x}"] = [heard.heard_motors, places, heard.written]
    assert_baseline("palm/heard", found)


def test_words_of_the_motors() -> None:
    words = np.array([0, 1, 255, 256, 32767, 32768, 65535], dtype=np.uint16)
    loop = TorqueLoop(
        torque_limit=0x7FFF, torque_limiter_gain=-0x200, max_pwm=0x3FF, sgleftref=3, sgrightref=5, f=1, p=2, i=3, d=4,
        imax=5, deadband=6, sign=1,
    )  # fmt: skip
    found = {
        "flags": {hex(1 << bit): list(describe_flags(1 << bit)) for bit in range(16)},
        "signed": as_signed(words),
        "units": [volts(words), celsius(words)],
        "crc": [crc16(bytes(range(n))) for n in range(20)] + [crc16(bytes([1 << bit])) for bit in range(8)],
        "loop": list(loop.words),
        "upload": [[kind.name, int(kind), word] for kind, word in config_upload(loop.words)],
        "zero": config_crc((0,) * 10),
        "kinds": [{kind.name: int(kind) for kind in kinds} for kinds in (FromMotor, ToMotor, SlowData)],
    }
    assert_baseline("palm/motors", found)


def test_identifiers_on_the_motors_buses() -> None:
    every = [MotorIdentifier.of(bits) for bits in (*range(0, 0x800, 37), 0x7FF, 0x21A, 0x6AA, 0x6BA)]
    words = {hex(each.identifier): str(each) for each in every}
    found = {"words": words, "buses": [bus_of(motor) for motor in range(20)]}
    found["motors"] = [MotorIdentifier.of(0x200 | motor << 5).motor(bus) for bus in (1, 2) for motor in (0, 9)]
    assert_baseline("palm/identifiers", found)


def test_what_fingertips_are_asked() -> None:
    rotations = {
        f"{kind} {names}": [rotation.next() for _ in range(48)]
        for kind in ("none", "biotac")
        for names in (False, True)
        for rotation in [TactileRotation(kind, names=names)]
    }
    found = {"rotations": rotations, "electrodes": [electrode_request(number) for number in (1, 24)]}
    found["questions"] = {question.name: int(question) for question in TactileQuestion}
    assert_baseline("palm/tactile", found)


def test_registers_states_and_products_in_words() -> None:
    found: dict[str, Any] = {
        "codes": {hex(code): str(AlStatus(4, True, code)) for code in range(0x60)},
        "states": {str(state): str(AlStatus(state)) for state in range(17)},
        "sent": {
            state.name: AlStatus(state, error, 0x1B).encode().hex() for state in AlState for error in (False, True)
        },
        "read": [
            plain(AlStatus.decode(bytes.fromhex(sent))) for sent in ("120000001b00", "080000000000", "ff00aaaa0100")
        ],
        "registers": {register.name: int(register) for register in Register},
        "manager": [SyncManager(0x1000, 70, to_slave=flag, watched=flag).encode().hex() for flag in (False, True)],
        "memory": [Fmmu(0x10000, 232, 0x1046, to_slave=flag).encode().hex() for flag in (False, True)],
        "products": {
            hex(product): describe_product(product) for product in (0, 5, 6, 9, 10, *range(0x1000000, 0x1000004))
        },
        "sides": {hex(product): side for product, side in SIDES.items()},
        "sensors": list(SENSORS),
    }
    assert_baseline("palm/registers", found)
