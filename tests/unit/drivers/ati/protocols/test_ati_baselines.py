"""Bits, bytes and units of ATI's devices: each bit in words, each message in bytes, each unit in newtons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from drivers.ati.protocols import can_codec, controller_codec, digital_calibration, modbus, rdt_codec
from drivers.ati.protocols.cal_file import (
    FORCE_UNITS_N,
    AtiCalibration,
    LENGTH_UNITS_m,
    TemperatureTerms,
    TORQUE_UNITS_Nm,
    tool_transform,
)
from drivers.ati.protocols.gauge_stream import GaugeStream, encode_sample
from drivers.ati.wires import digital_wire
from drivers.core.errors import CodecError
from drivers.emulators.ati.sensor import emulated_calibration
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain


def refused(act: Callable[[], object]) -> str:
    """What an act gives, or the words with which it is refused."""
    try:
        return repr(plain(act()))
    except CodecError as error:
        return f"{error.where}: {error.what} / {error.hint}"


def told_by_a_sensor() -> digital_calibration.DigitalCalibration:
    """A calibration that is the same to the last bit everywhere."""
    told = emulated_calibration()
    return replace(told, matrix=np.round(told.matrix, 3) + 0.0)


def test_each_status_bit_in_words() -> None:
    found: dict[str, Any] = {}
    for bit in range(32):
        status = 1 << bit
        found[f"box {bit}"] = plain([rdt_codec.describe_status(status), rdt_codec.judge_status(status | 1 << 31)])
        if bit < 16:
            found[f"can {bit}"] = [can_codec.describe_status(status), can_codec.describe_status(status | 1 << 15)]
            found[f"digital {bit}"] = digital_wire.describe_status(status)
    found["none"] = [
        rdt_codec.describe_status(0).messages,
        can_codec.describe_status(0),
        digital_wire.describe_status(0),
    ]
    assert_baseline("ati/bits", found)


def test_messages_in_bytes() -> None:
    counts = (1, -2, 3, -4, 5, -70000)
    rows = np.array([counts, counts])
    found: dict[str, Any] = {
        "requests": {c.name: rdt_codec.encode_request(c, 5).hex() for c in rdt_codec.Command},
        "record": rdt_codec.encode_record(2**32 + 3, 7, 1 << 31, counts).hex(),
        "records": rdt_codec.encode_records(np.array([1, 2**32]), np.array([3, 4]), np.array([0, 1]), rows).hex(),
        "can": {op.name: [can_codec.identifier(op), plain(can_codec.request(op, b"ab", 0x30))] for op in can_codec.Op},
        "gauges": plain(can_codec.encode_gauges(0x8001, (1, -2, 3, -4, 5, -6), 0x40)),
        "pair": [can_codec.encode_pair(1.5, -2.0).hex(), can_codec.encode_counts(7, 1 << 20).hex()],
        "split": [plain(can_codec.split_identifier(word)) for word in (0x200, 0x3A1, 0x20D)],
        "binary": controller_codec.encode_binary(controller_codec.Record(1, (1, -2, 3, -4, 5, -6))).hex(),
        "ascii": controller_codec.encode_ascii(controller_codec.Record(0, (10, -20, 300, -4, 5, -32768))).hex(),
        "modbus": modbus.encode(modbus.read_request(0x1D, 2)).hex(),
        "crc": [modbus.crc16(bytes(range(n))) for n in range(12)],
        "sample": [encode_sample((1, -2, 3, -4, 5, -6)).hex(), encode_sample((-1,) * 6, status_error=True).hex()],
        "block": digital_calibration.encode_block(told_by_a_sensor()).hex(),
        "exceptions": [modbus.Frame(10, 0x83, bytes([code])).exception for code in range(8)],
    }
    assert_baseline("ati/messages", found)


def test_messages_that_are_refused() -> None:
    reply = modbus.encode(modbus.Frame(10, 3, b"\x02\x00\x05"))
    calibration = digital_calibration.encode_block(told_by_a_sensor())
    acts: dict[str, Callable[[], object]] = {
        "count": lambda: rdt_codec.encode_request(rdt_codec.Command.START, 1 << 32),
        "most": lambda: rdt_codec.encode_request(rdt_codec.Command.START, (1 << 32) - 1).hex(),
        "short request": lambda: rdt_codec.decode_request(b"1234567"),
        "header": lambda: rdt_codec.decode_request(bytes.fromhex("1235000200000000")),
        "command": lambda: rdt_codec.decode_request(bytes.fromhex("1234000500000000")),
        "record": lambda: list(rdt_codec.records(bytes(35))),
        "counts": lambda: rdt_codec.encode_record(0, 0, 0, (1, 2, 3, 4, 5, 1 << 31)),
        "shape": lambda: rdt_codec.encode_records(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 5))),
        "long": lambda: modbus.encode(modbus.Frame(10, 3, bytes(253))),
        "longest": lambda: len(modbus.encode(modbus.Frame(10, 3, bytes(252)))),
        "short": lambda: modbus.decode(b"123"),
        "checksum": lambda: modbus.decode(reply[:-1] + b"\0"),
        "registers": lambda: modbus.read_request(0, 126),
        "no registers": lambda: modbus.read_request(0, 0),
        "last register": lambda: modbus.read_request(1 << 16, 1),
        "reply": lambda: modbus.take_reply(bytearray(b"\x0a\x03junk" + reply)),
        "others": lambda: modbus.take_reply(bytearray(b"\x0b" + reply[1:])),
        "gauge": lambda: encode_sample((32768, 0, 0, 0, 0, 0)),
        "block": lambda: digital_calibration.decode_block(calibration[:-1]),
        "empty block": lambda: digital_calibration.decode_block(bytes(len(calibration))),
        "units": lambda: digital_calibration.unit_names(7, 1),
        "first unit": lambda: digital_calibration.unit_names(1, 6),
        "no unit": lambda: digital_calibration.unit_names(0, 1),
        "can": lambda: can_codec.decode_first(b"1234567"),
        "pair": lambda: can_codec.decode_pair(b"1234567"),
        "ascii": lambda: controller_codec.decode_ascii(b"0,1,2,3"),
        "binary": lambda: controller_codec.decode_binary(bytes(5)),
    }
    assert_baseline("ati/refused", {name: refused(act) for name, act in acts.items()})


def test_a_stream_of_gauges_that_is_cut_and_damaged() -> None:
    stream, told = GaugeStream(), []
    samples = [encode_sample((n, -2 * n, 3 * n, 900 - n, 5, -6), status_error=n % 7 == 0) for n in range(60)]
    line = b"".join(samples[:12]) + b"\x01\x02\x03" + b"".join(samples[12:40])
    line += samples[40][:5] + b"".join(samples[41:60])
    for start in range(0, len(line), 97):
        gauges, errors, lost = stream.feed(line[start : start + 97])
        told.append([gauges[:, 0].tolist(), errors.tolist(), lost, stream.skipped_bytes, stream.resyncs])
    assert_baseline("ati/gauges", {"told": plain(told)})


def test_lines_and_answers_of_a_controller_in_pieces() -> None:
    record = controller_codec.Record(0, (10, -20, 300, -4, 5, -6))
    line, answer = controller_codec.encode_ascii(record), controller_codec.encode_binary(record)
    lines, answers = controller_codec.AsciiLines(), controller_codec.BinaryAnswers()
    pieces = [b"QS\r\n" + line[:9], line[9:] + b"rubbish\r\n" + line, b"\r\n>"]
    told = [plain(lines.feed(piece)) for piece in pieces]
    told += [plain(answers.feed(piece)) for piece in (b"QR\r\n" + answer[:7], answer[7:] + controller_codec.PROMPT)]
    assert_baseline("ati/pieces", {"told": told, "left": plain([vars(lines), vars(answers)])})


def test_units_and_tools() -> None:
    matrix = np.arange(36.0).reshape(6, 6) / 10.0 + np.eye(6)
    terms = TemperatureTerms(np.linspace(0.1, 0.6, 6), np.linspace(1e-3, 6e-3, 6), np.array(0.4))
    block = digital_calibration.decode_block(digital_calibration.encode_block(told_by_a_sensor()))
    calibration = AtiCalibration("FT1", "SI-12-0.12", "DAQ", "lbf", "lbf-in", matrix, None, np.arange(1.0, 7.0))
    found = {
        "units": [dict(FORCE_UNITS_N), dict(LENGTH_UNITS_m), dict(TORQUE_UNITS_Nm)],
        "corrected": terms.correct(np.linspace(1.0, 2.0, 6), np.array(0.7)),
        "tool": tool_transform(np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3])),
        "matrix": [calibration.working_matrix, calibration.ranges_SI],
        "sensor": [plain(block), block.working_matrix, block.ranges_SI],
    }
    assert_baseline("ati/units", found)
