from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import FromMotor, as_signed
from drivers.shadow.protocol.palm_codec import SENSORS, CanFrame, PalmCommand, PalmStatus
from tests.support.palm_layouts import COMMAND_0220, STATUS_0220

quick = settings(max_examples=60, deadline=None, derandomize=True)
u16, u32, i16 = st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF), st.integers(-0x8000, 0x7FFF)
can_frames = st.builds(CanFrame, st.integers(0, 255), st.integers(0, 255), u16, st.binary(min_size=8, max_size=8))
commands = st.builds(
    PalmCommand, u32, u32, i16, u32, st.lists(i16, min_size=20, max_size=20).map(tuple), u32, can_frames
)


def status_bytes(record: dict[str, object]) -> bytes:
    """A published status record packed by hand, field after field, as protocol tables list them."""
    packets = np.array([record["motor_data_packet_torque"], record["motor_data_packet_misc"]], "<i2").T
    tactile = np.zeros((5, 8), "<u2")
    tactile[:, 0] = record["tactile"]
    parts = [
        np.array(1, "<u4"),
        np.array(record["sensors"], "<u2"),
        np.array(record["motor_data_type"], "<u4"),
        np.array(record["which_motors"], "<i2"),
        np.array(record["which_motor_data_arrived"], "<u4"),
        np.array(record["which_motor_data_had_errors"], "<u4"),
        packets,
        np.array(record["tactile_data_type"], "<u4"),
        np.array(record["tactile_data_valid"], "<u2"),
        tactile,
        np.array(record["idle_time_us"], "<u2"),
        np.zeros(12, "u1"),
    ]
    return b"".join(part.tobytes() for part in parts)


@pytest.fixture(scope="module")
def published(lab_data: Path) -> list[dict[str, object]]:
    records = yaml.safe_load((lab_data / "shadow_published_debug_ethercat.yaml").read_text())
    assert len(records) == 2
    return list(records)


def empty_status() -> PalmStatus:
    return palm_codec.decode_status(bytes(232))


@given(st.binary(min_size=STATUS_0220.itemsize, max_size=STATUS_0220.itemsize))
def test_a_status_decodes_as_the_published_layout_has_it(payload: bytes) -> None:
    record, status = np.frombuffer(payload, STATUS_0220)[0], palm_codec.decode_status(payload)
    np.testing.assert_array_equal(status.sensors, record["sensors"])
    np.testing.assert_array_equal(status.torque, record["motor_data_packet"]["torque"])
    np.testing.assert_array_equal(status.misc, record["motor_data_packet"]["misc"])
    np.testing.assert_array_equal(status.tactile, record["tactile"])
    numbers = (status.which_motors, status.arrived, status.had_errors, status.tactile_valid, status.idle_time_us)
    names = (
        "which_motors",
        "which_motor_data_arrived",
        "which_motor_data_had_errors",
        "tactile_data_valid",
        "idle_time_us",
    )
    assert numbers == tuple(int(record[name]) for name in names)


def test_a_command_stands_as_the_published_layout_has_it() -> None:
    duties = np.arange(-10, 10, dtype=np.int16)
    command = PalmCommand(1, 2, 1, 3, duties, 4, CanFrame(1, 2, 0x123, b"12345678"))
    record = np.frombuffer(palm_codec.encode_command(command), COMMAND_0220)[0]
    assert [int(record[name]) for name in COMMAND_0220.names[:4]] == [1, 2, 1, 3]
    np.testing.assert_array_equal(record["motor_data"], duties)
    assert int(record["tactile_data_type"]) == 4
    assert (int(record["can"]["bus"]), int(record["can"]["id"])) == (1, 0x123)


def test_sensor_channels_stand_where_the_palm_puts_them() -> None:
    where = {name: SENSORS.index(name) for name in ("FFJ1", "MFJ1", "RFJ4", "LFJ5", "THJ5B", "WRJ1A", "WRJ2", "ACCX")}
    assert where == {
        "FFJ1": 0, "MFJ1": 4, "RFJ4": 11, "LFJ5": 16, "THJ5B": 22, "WRJ1A": 23, "WRJ2": 25, "ACCX": 26,
    }  # fmt: skip
    assert len(SENSORS) == 37


def test_published_records_decode_to_what_their_authors_printed(published: list[dict[str, object]]) -> None:
    for record in published:
        status = palm_codec.decode_status(status_bytes(record))
        assert status.written
        assert status.sensors.tolist() == record["sensors"]
        assert status.motor_data_type == record["motor_data_type"]
        assert status.torque.tolist() == record["motor_data_packet_torque"]
        assert as_signed(status.misc).tolist() == record["motor_data_packet_misc"]
        assert status.tactile[:, :2].copy().view("<u2").ravel().tolist() == record["tactile"]
        assert status.tactile_valid == record["tactile_data_valid"]
        assert status.idle_time_us == record["idle_time_us"]
        assert palm_codec.encode_status(status) == status_bytes(record)


def test_published_records_alternate_even_and_odd_motors(published: list[dict[str, object]]) -> None:
    even, odd = (palm_codec.decode_status(status_bytes(record)) for record in published)
    assert (even.which_motors, odd.which_motors) == (0, 1)
    assert even.heard_motors.tolist() == list(range(0, 20, 2))
    assert odd.heard_motors.tolist() == list(range(1, 20, 2))
    assert even.motor_data_type == FromMotor.PWM
    assert dict(zip(even.heard_motors.tolist(), as_signed(even.misc).tolist(), strict=True))[12] == 120
    assert odd.motor_data_type == FromMotor.FLAGS
    assert not odd.misc.any()


def test_a_silent_or_wrong_motor_is_told_from_the_others() -> None:
    missing_four = 0x55555 & ~(1 << 4)
    status = palm_codec.decode_status(palm_codec.encode_status(_answer(arrived=missing_four, had_errors=1 << 8)))
    assert 4 not in status.heard_motors
    assert 8 not in status.heard_motors


def test_a_status_of_unknown_parity_names_no_motor() -> None:
    status = _answer(which_motors=7, arrived=0xFFFFFFFF)
    assert status.heard_motors.size == 0


def test_the_default_command_is_the_all_zero_image() -> None:
    assert palm_codec.encode_command(PalmCommand()) == bytes(70)


@quick
@given(command=commands)
def test_commands_survive_the_wire(command: PalmCommand) -> None:
    decoded = palm_codec.decode_command(palm_codec.encode_command(command))
    assert vars(decoded) | {"motor_data": tuple(decoded.motor_data)} == vars(command)


@quick
@given(payload=st.binary(min_size=70, max_size=70))
def test_every_70_bytes_are_a_command(payload: bytes) -> None:
    assert palm_codec.encode_command(palm_codec.decode_command(payload)) == payload


@quick
@given(payload=st.binary(min_size=232, max_size=232))
def test_every_232_bytes_are_a_status(payload: bytes) -> None:
    status = palm_codec.decode_status(payload)
    assert palm_codec.encode_status(status) == payload
    assert set(status.heard_motors) <= set(range(20))


@quick
@given(payload=st.binary(max_size=300).filter(lambda payload: len(payload) not in (70, 232)))
def test_any_other_length_is_refused_with_both_lengths_named(payload: bytes) -> None:
    with pytest.raises(CodecError, match=f"{len(payload)} bytes instead of 70"):
        palm_codec.decode_command(payload)
    with pytest.raises(CodecError, match=f"{len(payload)} bytes instead of 232"):
        palm_codec.decode_status(payload)


@pytest.mark.parametrize(
    "command",
    [
        PalmCommand(motor_data=[0x8000] + [0] * 19),
        PalmCommand(motor_data=[0] * 19),
        PalmCommand(motor_data=np.full(20, 1.5)),  # type: ignore[arg-type]
        PalmCommand(which_motors=-0x8001),
        PalmCommand(edc_command=-1),
        PalmCommand(can=CanFrame(data=bytes(9))),
    ],
)
def test_values_that_do_not_fit_are_refused_instead_of_wrapped(command: PalmCommand) -> None:
    with pytest.raises(CodecError, match="palm 0220"):
        palm_codec.encode_command(command)


def test_a_tactile_block_of_the_wrong_size_is_refused() -> None:
    with pytest.raises(CodecError, match="tactile slots of 64 bytes"):
        palm_codec.encode_status(_answer(tactile=np.zeros((4, 16), np.uint8)))


def _answer(**fields: object) -> PalmStatus:
    return PalmStatus(**vars(empty_status()) | fields)  # type: ignore[arg-type]
