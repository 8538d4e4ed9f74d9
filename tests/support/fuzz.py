"""Random and damaged bytes against every codec: each input decodes or raises our error, and nothing else.

    python -m tests.support.fuzz --count 1000000 --seed 1 --only modbus

Half of the inputs are random, half are valid messages with bytes changed, cut, added or repeated. A codec is added by a
line in :data:`CODECS`.
"""

from __future__ import annotations

import argparse
import random
import time
from collections.abc import Callable

import numpy as np

from drivers.ati import can_codec, controller_codec, digital_calibration, gauge_stream, gauge_volts, modbus, rdt_codec
from drivers.ati.controller_codec import AsciiLines, BinaryAnswers, Record
from drivers.ati.gauge_stream import GaugeStream
from drivers.ati.net_box import parse_page
from drivers.emulators import slcan_unit
from drivers.emulators.ati_sensor import emulated_calibration
from drivers.emulators.net_box_unit import NetBoxUnit
from drivers.hardware.can_bus import CanFrame, decode_frame, encode_frame
from tactile_lab.errors import CodecError

Codec = tuple[Callable[[bytes], object], bytes]

_RECORD = Record(0, (-102, -99, -225, -20, 39, -39))
_ONE = np.ones(1, np.int64)

CODECS: dict[str, Codec] = {
    "rdt records": (
        lambda payload: list(rdt_codec.records(payload)),
        rdt_codec.encode_records(_ONE, 7 * _ONE, 0 * _ONE, np.arange(6)[None]),
    ),
    "rdt requests": (rdt_codec.decode_request, rdt_codec.encode_request(rdt_codec.Command.START)),
    "net box page": (parse_page, NetBoxUnit().page("/netftapi2.xml") or b""),
    "modbus": (modbus.decode, modbus.encode(modbus.read_request(0x1D, 1))),
    "modbus replies": (
        lambda payload: modbus.take_reply(bytearray(payload)),
        modbus.encode(modbus.Frame(modbus.SLAVE, modbus.READ_HOLDING, b"\x02\x00\x01")),
    ),
    "calibration block": (
        digital_calibration.decode_block,
        digital_calibration.encode_block(emulated_calibration()),
    ),
    "gauge stream": (
        lambda payload: GaugeStream().feed(payload),
        b"".join(gauge_stream.encode_sample((n, -n, 300, -400, 500, -600)) for n in range(12)),
    ),
    "controller record": (controller_codec.decode_binary, controller_codec.encode_binary(_RECORD)),
    "controller lines": (lambda payload: AsciiLines().feed(payload), controller_codec.encode_ascii(_RECORD)),
    "controller answers": (
        lambda payload: BinaryAnswers().feed(payload),
        b"QR\r\n" + controller_codec.encode_binary(_RECORD) + controller_codec.TERMINATOR,
    ),
    "can frame": (decode_frame, encode_frame(CanFrame(0x200, bytes(8)))),
    "can gauges": (can_codec.decode_first, can_codec.encode_gauges(0, (1, 2, 3, 4, 5, 6))[0].data),
    "slcan line": (slcan_unit.decode_line, slcan_unit.encode_line(CanFrame(0x200, b"\x01"))[:-1]),
    "gauge volts": (gauge_volts.decode_volts, gauge_volts.encode_volts(1, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6))),
}


def damaged(valid: bytes, rng: random.Random) -> bytes:
    """A valid message with up to three things wrong."""
    payload = bytearray(valid)
    for _ in range(rng.randint(1, 3)):
        place = rng.randint(0, len(payload))
        kind = rng.randint(0, 3)
        if kind == 0 and payload:
            payload[place % len(payload)] = rng.randint(0, 255)
        elif kind == 1:
            del payload[place:]
        elif kind == 2:
            payload[place:place] = rng.randbytes(rng.randint(1, 8))
        else:
            payload += payload[place:]
    return bytes(payload)


def fuzz(codec: Codec, count: int, seed: int) -> tuple[int, int]:
    """Feed ``count`` inputs; how many decoded and how many were refused. Anything else than CodecError is raised."""
    decode, valid = codec
    rng, decoded = random.Random(seed), 0
    for number in range(count):
        payload = damaged(valid, rng) if number % 2 else rng.randbytes(rng.randint(0, len(valid) + 4))
        try:
            decode(payload)
            decoded += 1
        except CodecError:
            continue
        except BaseException as error:
            error.add_note(f"input {payload.hex()}")
            raise
    return decoded, count - decoded


def main() -> None:
    """Fuzz the chosen codecs and print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    for name, codec in CODECS.items():
        if chosen.only in name:
            began = time.monotonic()
            decoded, refused = fuzz(codec, chosen.count, chosen.seed)
            took = time.monotonic() - began
            print(f"{name:20} seed {chosen.seed}  {decoded:9} decoded  {refused:9} refused  {took:6.1f} s", flush=True)


if __name__ == "__main__":
    main()
