"""Bytes of ATI's CAN board, digital sensor, controller and of an acquisition program.

(protocols: Net CAN OEM; Digital F/T; F/T controller; Gauge volts)
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.ati.protocols import can_codec, controller_codec, digital_calibration, gauge_stream, modbus
from drivers.ati.protocols.can_codec import Op
from drivers.ati.protocols.controller_codec import AsciiLines, BinaryAnswers, Record
from drivers.ati.protocols.gauge_stream import GaugeStream
from drivers.ati.protocols.modbus import Frame
from drivers.ati.wires import gauge_volts
from drivers.ati.wires.digital_wire import describe_status
from drivers.ati.wires.net_box import achievable_rate, parse_page
from drivers.core.errors import CodecError
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import RANGES, EmulatedSensor, emulated_calibration

WORD16 = st.integers(-32768, 32767)
GAUGES = st.tuples(*[WORD16] * 6)
QUICK = settings(max_examples=60, derandomize=True, deadline=None)


def golden(lab_data: Path, name: str) -> dict[str, str]:
    content: dict[str, dict[str, str]] = json.loads((lab_data / "golden_vectors.json").read_text())
    return content[name]


# --- RS-485 --------------------------------------------------------------------------------------------------------


def test_modbus_frames_match_the_golden_vectors(lab_data: Path) -> None:
    vectors = golden(lab_data, "ati_rs485")
    made = {
        "start_stream_req": Frame(10, modbus.START_STREAM, b"\x55"),
        "start_stream_ok": Frame(10, modbus.START_STREAM, b"\x01"),
        "unlock_req": Frame(10, modbus.UNLOCK, b"\xaa"),
        "unlock_ok": Frame(10, modbus.UNLOCK, b"\x01"),
        "lock_req": Frame(10, modbus.UNLOCK, b"\x18"),
        "read_status_0x001D": modbus.read_request(0x001D, 1),
        "read_gains_offsets": modbus.read_request(0, 12),
        "read_cal1_first_regs(0x00E3,96)": modbus.read_request(digital_calibration.FIRST_REGISTER, 96),
    }
    assert {name: modbus.encode(frame).hex() for name, frame in made.items()} == {name: vectors[name] for name in made}
    assert all(modbus.decode(bytes.fromhex(vectors[name])) == frame for name, frame in made.items())


def test_a_gauge_sample_matches_the_golden_vector(lab_data: Path) -> None:
    vectors = golden(lab_data, "ati_rs485")
    in_wire_order = (100, -200, 300, -400, 500, -600)
    gauges = tuple(in_wire_order[gauge_stream.WIRE_ORDER.index(gauge)] for gauge in range(6))
    good, bad = (gauge_stream.encode_sample(gauges, error).hex() for error in (False, True))
    assert good == vectors["sample_G0,G2,G4,G1,G3,G5=[100, -200, 300, -400, 500, -600]_ok"]
    assert bad == vectors["same_with_status_error"]


@QUICK
@given(st.integers(1, 247), st.integers(0, 255), st.binary(max_size=252))
def test_modbus_frames_survive_encoding_and_decoding(slave: int, function: int, data: bytes) -> None:
    assert modbus.decode(modbus.encode(Frame(slave, function, data))) == Frame(slave, function, data)


@QUICK
@given(st.binary(max_size=40), st.binary(max_size=250), st.data())
def test_a_reply_is_found_behind_any_remains_however_it_is_cut(noise: bytes, data: bytes, draw: st.DataObject) -> None:
    reply = Frame(modbus.SLAVE, modbus.READ_HOLDING, bytes([len(data)]) + data)
    line = noise + modbus.encode(reply)
    cut = draw.draw(st.integers(0, len(line)))
    buffer, found = bytearray(), None
    for piece in (line[:cut], line[cut:]):
        buffer += piece
        while found != reply and (taken := modbus.take_reply(buffer)) is not None:
            found = taken
    assert found == reply


def test_a_reply_of_refusal_is_told_in_words() -> None:
    frame = modbus.take_reply(bytearray(modbus.encode(Frame(10, 0x83, b"\x02"))))
    assert frame is not None
    assert frame.exception == "no such register"
    assert Frame(10, 0x83, b"\x63").exception == "exception 99"


@pytest.mark.parametrize("act", [lambda: modbus.read_request(0, 126), lambda: modbus.encode(Frame(1, 3, bytes(253)))])
def test_what_does_not_fit_a_modbus_frame_is_refused(act: Callable[[], object]) -> None:
    with pytest.raises(CodecError):
        act()


def test_a_calibration_block_survives_encoding_and_has_its_fields_where_the_manual_says() -> None:
    made = emulated_calibration("FT12345")
    block = digital_calibration.encode_block(made)
    assert (block[:8], block[208:210]) == (b"FT12345\0", bytes((2, 3)))
    assert int.from_bytes(block[234:238], "big") == 1_000_000
    read = digital_calibration.decode_block(block)
    np.testing.assert_allclose(read.working_matrix, made.working_matrix, rtol=1e-6)
    np.testing.assert_allclose(read.ranges_SI, RANGES, rtol=1e-6)
    assert (read.serial, read.part_number) == ("FT12345", "SI-12-0.12")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda block: block[:-2], "bytes instead of"),
        (lambda block: bytes(len(block)), "unit codes 0 and 0"),
        (lambda block: block[:64] + bytes(144) + block[208:], "empty or not finite"),
        (lambda block: block[:234] + bytes(8) + block[242:], "no scale"),
    ],
)
def test_a_block_that_can_be_no_calibration_is_refused(change: Callable[[bytes], bytes], complaint: str) -> None:
    with pytest.raises(CodecError, match=complaint):
        digital_calibration.decode_block(change(digital_calibration.encode_block(emulated_calibration())))


@QUICK
@given(st.lists(GAUGES, min_size=8, max_size=30), st.data())
def test_a_clean_stream_gives_every_sample_however_it_is_cut(rows: list[tuple[int, ...]], draw: st.DataObject) -> None:
    line = b"".join(gauge_stream.encode_sample(row) for row in rows)
    cuts = sorted(draw.draw(st.lists(st.integers(0, len(line)), max_size=5)))
    stream = GaugeStream()
    taken = [stream.feed(line[a:b])[0] for a, b in zip([0, *cuts], [*cuts, len(line)], strict=True)]
    np.testing.assert_array_equal(np.concatenate(taken), np.array(rows))
    assert (stream.skipped_bytes, stream.resyncs) == (0, 0)


def noisy_stream(count: int, seed: int) -> tuple[list[tuple[int, ...]], list[bytes]]:
    sensor = EmulatedSensor(noise_counts=3.0, seed=seed)
    sensor.press(np.array([1.0, -0.5, 2.0, 0.01, 0.0, 0.005]))
    rows = [sensor.gauges() for _ in range(count)]
    return rows, [gauge_stream.encode_sample(row) for row in rows]


@pytest.mark.parametrize("lost", range(1, 13))
def test_the_stream_finds_its_feet_after_lost_bytes(lost: int) -> None:
    rows, samples = noisy_stream(400, lost)
    line = b"".join(samples[:100]) + samples[100][lost:] + b"".join(samples[101:])
    stream = GaugeStream()
    gauges, _, missing = stream.feed(line)
    assert stream.resyncs == 1
    assert missing == 1
    np.testing.assert_array_equal(gauges[:100], np.array(rows[:100]))
    np.testing.assert_array_equal(gauges[-299:], np.array(rows[101:]))


def test_one_wrong_byte_costs_one_sample() -> None:
    rows, samples = noisy_stream(60, 1)
    samples[20] = bytes([samples[20][0] ^ 1]) + samples[20][1:]
    stream = GaugeStream()
    gauges, _, missing = stream.feed(b"".join(samples))
    np.testing.assert_array_equal(gauges, np.array(rows[:20] + rows[21:]))
    assert (missing, stream.skipped_bytes) == (1, 13)


def test_the_status_flag_is_read() -> None:
    stream = GaugeStream()
    line = b"".join(gauge_stream.encode_sample((1, 2, 3, 4, 5, 6), error) for error in [False] * 9 + [True])
    assert stream.feed(line)[1].tolist() == [False] * 9 + [True]


def test_status_words_of_the_sensor_are_told_in_words() -> None:
    assert describe_status(0) == ()
    assert describe_status(16 | 4096) == ("supply voltage too high", "thermistor too low")
    assert describe_status(64) == ("undocumented status bits 0x0040",)


# --- RS-232 --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ati_rs232_published_frame", "ati_rs232_published_frame2"])
def test_published_frames_of_the_controller_are_read(lab_data: Path, name: str) -> None:
    vector = json.loads((lab_data / "golden_vectors.json").read_text())[name]
    captured = bytes.fromhex(vector["hex"])
    answers = BinaryAnswers()
    (record,) = answers.feed(captured)
    assert (record.error, list(record.counts)) == (vector["error"], vector["counts"])
    (again,) = answers.feed(captured)  # the echo of the next question stands before it
    assert again == record
    assert answers.damaged == 0


@QUICK
@given(st.integers(0, 255), GAUGES)
def test_records_survive_both_forms(error: int, counts: tuple[int, ...]) -> None:
    record = Record(error, counts)
    assert controller_codec.decode_binary(controller_codec.encode_binary(record)) == record
    assert AsciiLines().feed(controller_codec.encode_ascii(record)) == [record]


def test_a_published_line_is_read_between_echo_and_prompt_and_a_damaged_one_counted() -> None:
    lines = AsciiLines()
    (record,) = lines.feed(b"QR\r\n0,  -102,   -99,  -225,   -20,    39,   -39\r\n>")
    assert record == Record(0, (-102, -99, -225, -20, 39, -39))
    assert lines.feed(b"\r\n0,  -102,   -9") == []
    assert lines.feed(b"9,  -2#5,   -20,    39,   -39\r\n") == []
    assert lines.damaged == 1


# --- CAN -----------------------------------------------------------------------------------------------------------


def test_gauge_frames_have_the_layout_of_the_manual() -> None:
    first, second = can_codec.encode_gauges(0x8001, (1, 2, 3, 4, 5, -6))
    assert (first.identifier, second.identifier) == (0x200, 0x201)
    assert first.data == bytes.fromhex("8001000100030005")
    assert second.data == bytes.fromhex("00020004fffa")
    assert can_codec.decode_first(first.data) == (0x8001, (1, 3, 5))
    assert can_codec.decode_second(second.data) == (2, 4, -6)
    assert can_codec.split_identifier(0x20F) == (0x20, Op.FIRMWARE)


@QUICK
@given(st.integers(0, 0xFFFF), GAUGES, st.integers(0, 0x7F))
def test_gauge_frames_survive_encoding_and_decoding(status: int, gauges: tuple[int, ...], base: int) -> None:
    first, second = can_codec.encode_gauges(status, gauges, base)
    assert can_codec.split_identifier(second.identifier) == (base, Op.GAUGES_SECOND)
    assert can_codec.decode_first(first.data) == (status, gauges[0::2])
    assert can_codec.decode_second(second.data) == gauges[1::2]


def test_status_words_of_the_board_are_told_in_words() -> None:
    assert can_codec.describe_status(0) == ()
    assert can_codec.describe_status(0x8010) == ("supply voltage too high",)
    assert can_codec.describe_status(0x8000) == ("the board reports an error without naming it",)
    assert can_codec.describe_status(0x0200) == ("undocumented status bits 0x0200",)


# --- volts and pages -----------------------------------------------------------------------------------------------


@QUICK
@given(st.integers(0, 2**32 - 1), st.lists(st.floats(-10, 10), min_size=6, max_size=7))
def test_volts_survive_encoding_and_decoding(counter: int, volts: list[float]) -> None:
    read, values = gauge_volts.decode_volts(gauge_volts.encode_volts(counter, tuple(volts)))
    assert read == counter
    assert values.tolist() == volts


def test_a_page_of_the_box_is_read_in_its_own_units() -> None:
    page = NetBoxUnit().page("/netftapi2.xml")
    assert page is not None
    read = parse_page(page)
    assert (read.serial, read.counts_per_N, read.rate_hz, read.rdt_enabled) == ("FT00001", 1e6, 7000, True)
    pounds = page.replace(b">N<", b">lbf<").replace(b">Nm<", b">lbf-in<")
    assert parse_page(pounds).counts_per_N == pytest.approx(1e6 / 4.4482216)
    assert parse_page(pounds).counts_per_Nm == pytest.approx(1e6 / 0.11298483)


@pytest.mark.parametrize(
    "page",
    [b"", b"<netft/>", b"<html>404</html>", b"<!DOCTYPE a><netft/>", b"<netft><cfgcalsn>x</cfgcalsn></netft>"],
)
def test_what_is_no_page_of_a_box_is_refused(page: bytes) -> None:
    with pytest.raises(CodecError, match="not that of a Net F/T box"):
        parse_page(page)


def test_the_box_divides_its_own_rate_by_whole_numbers() -> None:
    assert [achievable_rate(rate) for rate in (7000, 1000, 500, 300, 1, 6000)] == [7000, 1000, 500, 304, 1, 7000]


FUZZED: dict[str, Callable[[bytes], object]] = {
    "modbus": modbus.decode,
    "modbus replies": lambda payload: modbus.take_reply(bytearray(payload)),
    "calibration block": digital_calibration.decode_block,
    "gauge stream": lambda payload: GaugeStream().feed(payload),
    "controller record": controller_codec.decode_binary,
    "controller line": controller_codec.decode_ascii,
    "controller lines": lambda payload: AsciiLines().feed(payload),
    "controller answers": lambda payload: BinaryAnswers().feed(payload),
    "first gauges": can_codec.decode_first,
    "matrix pair": can_codec.decode_pair,
    "volts": gauge_volts.decode_volts,
    "page": parse_page,
}


@pytest.mark.parametrize("name", FUZZED)
@settings(max_examples=80, derandomize=True, deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_decode_or_raise_our_error(name: str, payload: bytes) -> None:
    try:
        FUZZED[name](payload)
    except CodecError as error:
        assert error.where  # noqa: PT017


@pytest.mark.parametrize(
    ("act", "complaint"),
    [
        (lambda: can_codec.split_identifier(0x1FA), "identifier 0x1fa is not a message of an F/T board"),
        (lambda: can_codec.encode_gauges(0, (0, 0, 0, 0, 0, 1 << 15)), "do not fit"),
        (lambda: controller_codec.encode_binary(Record(0, (1 << 15, 0, 0, 0, 0, 0))), "does not fit 13 bytes"),
        (lambda: controller_codec.decode_binary(bytes(12)), "12 bytes instead of the 13 of a record"),
        (lambda: controller_codec.encode_ascii(Record(0, (1, 2, 3))), "3 counts instead of six"),
        (lambda: gauge_stream.encode_sample((0, 0, 0, 0, 0, 32768)), "does not fit 16 bits"),
        (lambda: gauge_stream.encode_sample((-32769, 0, 0, 0, 0, 0)), "does not fit 16 bits"),
        (lambda: gauge_volts.encode_volts(1, (0.0,) * 5), "5 volts instead of six or seven"),
        (lambda: gauge_volts.decode_volts(bytes(51)), "51 bytes instead of 52 or 60"),
        (lambda: gauge_volts.decode_volts(gauge_volts.encode_volts(1, (float("nan"),) * 6)), "not finite"),
    ],
)
def test_what_fits_no_message_is_refused_in_words(act: Callable[[], object], complaint: str) -> None:
    with pytest.raises(CodecError, match=complaint):
        act()


def test_the_largest_and_smallest_gauges_fit_a_sample() -> None:
    assert len(gauge_stream.encode_sample((32767, -32768, 0, 0, 0, 0))) == gauge_stream.SIZE
