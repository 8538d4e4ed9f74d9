"""The camera's own process without a process: pictures from a list, commands from a pipe, records in a list."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.camera import camera_worker
from drivers.camera.camera_worker import CameraWorker
from drivers.camera.packet import decode_packet, picture_of
from drivers.camera.pictures import Picture
from drivers.camera.rendering.board_camera import table_pictures
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.records import RecordKind
from drivers.core.transports import Datagram

SETTINGS = CameraSourceSettings(size_px=(640, 480))
MS = 1_000_000


class Source:
    """Gives pictures with gaps between their numbers, then nothing until it is opened again."""

    def __init__(self, pictures: list[np.ndarray]) -> None:
        self._pictures, self._left = pictures, list(enumerate(pictures))
        self.opened = 0

    def open(self) -> None:
        self.opened += 1
        self._left = list(enumerate(self._pictures))

    def close(self) -> None:
        self._left = []

    def read(self) -> Picture | None:
        if not self._left:
            return None
        number, image = self._left.pop(0)
        return Picture(7 * MS * (number + 1), 3 * number, number, image)

    def notes(self) -> tuple[str, ...]:
        return ("grey",)


class Records:
    dropped_blocks = 2

    def __init__(self) -> None:
        self.put_down: list[tuple[RecordKind, int, bytes]] = []
        self.flushed = 0

    def put(self, kind: RecordKind, stamp_ns: int, payload: bytes) -> None:
        self.put_down.append((kind, stamp_ns, payload))

    def flush(self) -> None:
        self.flushed += 1


@pytest.fixture
def orders(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The writing end of the worker's standard input."""
    ours, theirs = os.pipe()
    with os.fdopen(ours) as reading, os.fdopen(theirs, "w") as writing:
        monkeypatch.setattr(camera_worker.sys, "stdin", reading)
        yield writing


@pytest.fixture(scope="module")
def pictures() -> list[np.ndarray]:
    drawn = table_pictures(SETTINGS, 2, np.random.default_rng(0))
    return [drawn[0], np.full((480, 640), 150, np.uint8), drawn[1]]


def worker(camera: Source, records: Records, **changes: object) -> tuple[CameraWorker, VirtualClock]:
    made = CameraWorker(camera, SETTINGS.model_copy(update=changes), records)  # type: ignore[arg-type]
    made._clock = VirtualClock()
    made._began_ns = 0
    return made, made._clock


def order(writing: Any, **content: object) -> None:
    writing.write(json.dumps(content) + "\n")
    writing.flush()


def test_every_frame_becomes_a_packet_and_the_wanted_ones_have_their_picture(
    orders: Any, pictures: list[np.ndarray]
) -> None:
    source, records = Source(pictures), Records()
    made, _ = worker(source, records)
    order(orders, pictures=1)
    with pytest.raises(DeviceError, match=r"the video or folder has ended.*repeat: true"):
        made.run()
    kinds, stamps, payloads = zip(*records.put_down, strict=True)
    assert kinds == (RecordKind.RECEIVED,) * 3
    assert stamps == (7 * MS, 14 * MS, 21 * MS)
    frames = [decode_packet(Datagram(payload, stamp)) for payload, stamp in zip(payloads, stamps, strict=True)]
    assert [frame.counter for frame in frames] == [0, 3, 6]
    assert [frame.dropped for frame in frames] == [0, 1, 2]
    assert [len(frame.detection.markers) for frame in frames if frame.detection] == [2, 0, 2]
    assert [bool(picture_of(payload)) for payload in payloads] == [False, True, False]  # asked for after the first
    assert records.flushed == 3


def test_a_report_tells_of_frames_and_markers_and_the_end_of_the_orders_ends_it(
    orders: Any, pictures: list[np.ndarray]
) -> None:
    source, records = Source(pictures), Records()
    made, _ = worker(source, records)
    order(orders, report=True)
    orders.close()
    made.run()
    (report,) = [json.loads(payload) for kind, _, payload in records.put_down if kind is RecordKind.REPORT]
    assert report == {"frames": 1, "markers": 2, "dropped_blocks": 2, "notes": ["grey"]}
    assert len(records.put_down) == 2


def test_a_folder_is_played_at_its_rate_and_again_if_it_had_pictures(
    orders: Any, pictures: list[np.ndarray], tmp_path: Path
) -> None:
    source, records = Source(pictures[1:2]), Records()
    made, clock = worker(source, records, source=str(tmp_path), rate_hz=20.0, repeat=True)
    seen = []
    read = source.read

    def counted() -> Picture | None:
        seen.append(clock.now_ns() // MS)
        if len(seen) == 6:
            order(orders, end=True)
        return read()

    source.read = counted  # type: ignore[method-assign]
    made.run()
    assert seen == [0, 50, 50, 100, 100, 150, 150]
    assert source.opened == 3
    empty, _ = worker(Source([]), records, source=str(tmp_path), repeat=True)
    with pytest.raises(DeviceError, match="has ended"):
        empty.run()
