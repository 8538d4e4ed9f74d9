"""Random and damaged bytes against every codec: each input decodes or raises our error, and nothing else.

    python -m tests.support.fuzz --count 1000000 --seed 1 --store

Half of the inputs are random, every other one of these as long as a valid message; half are valid messages with bytes
changed, cut, added or repeated. To add a codec, add a line to :data:`CODECS`.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence

import numpy as np

from drivers.ati.protocols import can_codec, controller_codec, digital_calibration, gauge_stream, modbus, rdt_codec
from drivers.ati.protocols.controller_codec import AsciiLines, BinaryAnswers, Record
from drivers.ati.protocols.gauge_stream import GaugeStream
from drivers.ati.wires import gauge_volts
from drivers.ati.wires.net_box import parse_page
from drivers.biotac import cheetah_log, slot_codec
from drivers.biotac.slot_codec import Slot
from drivers.camera.frames import Detection, Frame, SeenMarker
from drivers.camera.packet import MAGIC, decode_packet, encode_packet
from drivers.core.errors import CodecError
from drivers.core.records import RecordKind, RecordReader, encode_record
from drivers.core.transports import Datagram
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import emulated_calibration
from drivers.emulators.ur.rtde_server import RtdeClient, package
from drivers.ethercat import frames as ethercat
from drivers.ethercat.registers import AlStatus
from drivers.hardware.can_bus import CanFrame, decode_frame, encode_frame
from drivers.hardware.tcp import MessageReader, frame
from drivers.positioner import codec as positioner_codec
from drivers.positioner.codec import PositionerCommand, PositionerStatus
from drivers.positioner.ur.codec import (
    ArmFlags,
    ArmOrder,
    ArmState,
    ArmStatus,
    decode_arm_command,
    decode_arm_status,
    encode_arm_command,
    encode_arm_status,
)
from drivers.shadow.protocol.motor_can import MotorIdentifier
from drivers.shadow.protocol.palm_codec import PalmCommand
from drivers.shadow.protocol.palm_images import PALMS
from tests.support import slcan_unit
from tests.support.stored_table import GrowingTable, Outline, parser

Codec = tuple[Callable[[bytes], object], bytes]

_RECORD = Record(0, (-102, -99, -225, -20, 39, -39))
_ONE = np.ones(1, np.int64)
_SLOT = slot_codec.encode_slot(Slot((2040, 2041), {1: 1700, 2: 2000}), 1)
_TELEGRAMS = (
    ethercat.Telegram(ethercat.Command.LRW, 0x10000, bytes(302)),
    ethercat.Telegram(ethercat.Command.BRD, ethercat.physical(0, 0x130), bytes(2)),
)
_SEEN = Detection("DICT_4X4_50", (8, 8), {0: SeenMarker(np.arange(8.0).reshape(4, 2), 0.5)})
_LOG = "Sensor: BT1\n\nBegin File\n0.000000 1 1 17 2602 0 2713 0\n0.000227 1 1 0 2040 0 2041 1\n"
_ARM = ArmState(1.0, 7, 2, 1, 1.0, (0.0, 0.0, -3.0), ArmFlags.HEARD | ArmFlags.PROGRAM)


class _EmptyBox:
    """A control box with nothing to tell."""

    version, highest_Hz = (5, 12, 0, 0), 500.0

    def output(self, name: str) -> float:
        return 0.0

    def claim(self, client: object, names: Sequence[str]) -> list[str]:
        return ["INT32"] * len(names)

    def on_inputs(self, values: object) -> None:
        """Nothing happens."""


def _read_rtde(payload: bytes) -> bytes:
    return RtdeClient(_EmptyBox()).feed(payload)


def _palm_statuses() -> dict[str, Codec]:
    """A status of each palm, as its emulator would send it."""
    return {
        f"palm {name} status": (image.decode_status, bytes(image.status_bytes)) for name, image in PALMS.items()
    } | {
        f"palm {name} command": (image.decode_command, image.encode_command(PalmCommand(1, 3, 1, 2)))
        for name, image in PALMS.items()
    }


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
        b"".join(gauge_stream.encode_sample((n, -n, 300, -400, 500, -600)) for n in range(9)),
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
    "motor identifier": (lambda payload: str(MotorIdentifier.of(int.from_bytes(payload, "big"))), b"\x04\xa3"),
    "AL status": (lambda payload: str(AlStatus.decode(payload)), AlStatus(4, True, 0x1B).encode()),
    "hand records": (
        lambda payload: RecordReader().feed(payload),
        b"".join(encode_record(kind, 7, b"\x01\x02") for kind in RecordKind),
    ),
    "tcp messages": (lambda payload: MessageReader().feed(payload), frame(b"TRIGGER") + frame(b"")),
    "camera packet": (
        lambda payload: decode_packet(Datagram(MAGIC + payload, 0)),  # anything else, and the picture, is OpenCV's
        encode_packet(Frame(0, None, 5, 0, _SEEN)).removeprefix(MAGIC),
    ),
    "ethercat frame": (ethercat.decode_frame, ethercat.encode_frame(_TELEGRAMS, bytes(6))),
    **_palm_statuses(),
    "biotac slot": (lambda payload: slot_codec.decode_slot(payload, 1), _SLOT),
    "cheetah log": (lambda payload: cheetah_log.decode_log(payload.decode("latin-1")), _LOG.encode()),
    "positioner status": (
        positioner_codec.decode_status,
        positioner_codec.encode_status(PositionerStatus(7, np.arange(6.0))),
    ),
    "arm status": (decode_arm_status, encode_arm_status(ArmStatus(7, np.arange(6.0), _ARM))),
    "arm command": (decode_arm_command, encode_arm_command(PositionerCommand(7, np.arange(6.0)), ArmOrder.FOLLOW)),
    "arm's RTDE": (_read_rtde, package(ord("V"), b"\x00\x02") + package(ord("O"), bytes(8) + b"timestamp")),
    "positioner command": (
        positioner_codec.decode_command,
        positioner_codec.encode_command(PositionerCommand(7, np.arange(6.0))),
    ),
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
        size = len(valid) if number % 4 else rng.randint(0, len(valid) + 4)
        payload = damaged(valid, rng) if number % 2 else rng.randbytes(size)
        try:
            decode(payload)
            decoded += 1
        except CodecError:
            continue
        except BaseException as error:
            error.add_note(f"input {payload.hex()}")
            raise
    return decoded, count - decoded


OUTLINE = Outline(
    "fuzz",
    "Codecs against random and damaged bytes.",
    ("python -m tests.support.fuzz --count 1000000 --seed 1 --store",),
    "Half of the inputs are random, every other one of these as long as a valid message; half are valid messages with "
    "bytes changed, cut, added or repeated. Each decoded or raised our error; nothing else came.",
    ("Codec", "Inputs", "Seed", "Decoded", "Refused", "Time, s"),
)


def main() -> None:
    """Fuzz the chosen codecs, print one line for each, and store the table where that is asked for."""
    options = parser(__doc__)
    options.add_argument("--count", type=int, default=1_000_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", default="")
    chosen = options.parse_args()
    table = GrowingTable(chosen.docs, OUTLINE, [(name,) for name in CODECS])
    for name, codec in CODECS.items():
        if chosen.only in name:
            began = time.monotonic()
            figures = (chosen.count, chosen.seed, *fuzz(codec, chosen.count, chosen.seed))
            table.put((name,), (*map(str, figures), f"{time.monotonic() - began:.0f}"))
    table.publish()


if __name__ == "__main__":
    main()
