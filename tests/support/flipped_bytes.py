"""Changes one byte anywhere in a recording: what is lost, and is the loss reported correctly?

    python -m tests.support.flipped_bytes --places 2000
    python -m tests.support.flipped_bytes --recording runs/SESSION/traffic.mcap --places 2000

Prints lines of figures. The recording has several chunks and topics and an attachment, and is whole or truncated; or it
is that of a session, and the bytes are those of its first chunk and of the one in its middle.
"""

from __future__ import annotations

import argparse
import struct
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.writer import TrafficWriter

TOPICS = ("/link/hand/rx", "/link/hand/tx", "/link/ft/FF/rx")
_STEP_ns = 3_000_000


@dataclass(frozen=True)
class Recording:
    """A recording with its true contents.

    Attributes:
        content: its bytes.
        topics, data: of each message, by its number.
        chunks: the chunk of each message.
        spans: position of each chunk, including its indices.
    """

    content: bytes
    topics: list[str]
    data: list[bytes]
    chunks: list[int]
    spans: list[tuple[int, int]]

    def chunk_at(self, place: int) -> int | None:
        """The chunk to which a byte belongs."""
        return next((number for number, (start, end) in enumerate(self.spans) if start <= place < end), None)


def make_recording(folder: Path, count: int = 400, *, whole: bool = True) -> Recording:
    """Numbered messages on three topics, in chunks of 80 ms; truncated in the last chunk unless ``whole``."""
    path, random = folder / "made.mcap", np.random.default_rng(1)
    attached = (Attached("calibration/joints.yaml", "application/yaml", b"a: 1\n" * 20),)
    writer = TrafficWriter(
        path, {"session": "s"}, attachments=attached, settings=TrafficSettings(tell_streams=False, tail=False)
    )
    topics = [TOPICS[number % len(TOPICS)] for number in range(count)]
    for number, topic in enumerate(topics):
        writer.write(topic, number.to_bytes(4, "little") + random.bytes(20), number * _STEP_ns)
    writer.close()
    made = read_recording(path)
    path.unlink()
    assert made.topics == topics
    return made if whole else replace(made, content=made.content[: made.spans[-1][1]])


def read_recording(path: Path) -> Recording:
    """A sound recording in one file, whose messages are numbered from 0."""
    content, messages = path.read_bytes(), list(TrafficReader(path).messages())
    assert [message.sequence for message in messages] == list(range(len(messages)))
    chunks: list[int] = []
    spans: list[tuple[int, int]] = []
    for opcode, start, end in _records(content):
        if opcode == Opcode.CHUNK:
            records = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(content[start + 9 : end]))))
            chunks += [len(spans)] * sum(isinstance(record, Message) for record in records)
            spans.append((start, end))
        elif opcode == Opcode.MESSAGE_INDEX:
            spans[-1] = (spans[-1][0], end)
    assert len(chunks) == len(messages)
    topics, data = [message.topic for message in messages], [message.data for message in messages]
    return Recording(content, topics, data, chunks, spans)


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    position = 8
    while position + 9 <= len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, position)
        yield opcode, position, position + 9 + length
        position += 9 + length


def read_flipped(made: Recording, place: int, by: int, path: Path) -> tuple[set[int], str]:
    """Flip a byte, read, and compare.

    Args:
        place: position of the byte.
        by: its bits to change.
        path: path of a file to use.

    Returns:
        The numbers of the lost messages, and what was reported wrongly; "" if all was correct.
    """
    changed = bytearray(made.content)
    changed[place] ^= by
    path.write_bytes(changed)
    reader = TrafficReader(path)
    messages = list(reader.messages())
    found = [message.sequence for message in messages]
    lost = set(range(len(made.topics))) - set(found)
    wrong = []
    if found != sorted(set(found)) or not set(found) <= set(range(len(made.topics))):
        wrong.append("messages that are none, twice, or out of order")
    elif any(one.data != made.data[one.sequence] or one.topic != made.topics[one.sequence] for one in messages):
        wrong.append("messages that are changed")
    if lost and len({made.chunks[number] for number in lost}) > 1:
        wrong.append("more than one chunk")
    if reader.loss.missing_messages != len(lost):
        wrong.append(f"{reader.loss.missing_messages} said to be missing, {len(lost)} are")
    if lost and reader.loss.by_topic != dict(Counter(made.topics[number] for number in lost)):
        wrong.append(f"by topic {reader.loss.by_topic}")
    if lost and not reader.loss:
        wrong.append("nothing said")
    return lost, "; ".join(wrong)


def main() -> None:
    """Change bytes at random places."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--chunk", type=int, help="of the recording, instead of the first and the middle one")
    asked = parser.parse_args()
    random = np.random.default_rng(asked.seed)
    with tempfile.TemporaryDirectory() as folder:
        if asked.recording is not None:
            made = read_recording(asked.recording)
            chunks = (0, len(made.spans) // 2) if asked.chunk is None else (asked.chunk,)
            for number in chunks:
                places = random.integers(*made.spans[number], asked.places // len(chunks))
                _tell(f"chunk {number} of a session", made, places, random, Path(folder))
            return
        for whole in (True, False):
            made = make_recording(Path(folder), whole=whole)
            places = random.integers(len(made.content), size=asked.places)
            _tell("whole" if whole else "torn", made, places, random, Path(folder))


def _tell(kind: str, made: Recording, places: np.ndarray, random: np.random.Generator, folder: Path) -> None:
    bad: Counter[str] = Counter()
    most = beyond = 0
    for place in map(int, places):
        by = int(random.integers(1, 256))
        try:
            lost, wrong = read_flipped(made, place, by, folder / "flipped.mcap")
        except Exception as error:
            lost, wrong = set(), f"{type(error).__name__}: {error}"
        most = max(most, len(lost))
        beyond = max(beyond, sum(made.chunks[number] != made.chunk_at(place) for number in lost))
        if wrong:
            bad[f"{wrong} (at {place} of {len(made.content)}, chunk {made.chunk_at(place)}, by {by})"] += 1
    figures = f"at most {most} messages lost, {beyond} beyond the damaged chunk, {bad.total()} told wrongly"
    print(f"{kind}: {len(places)} flips in {len(made.spans)} chunks, {figures}")
    for words, number in bad.most_common(20):
        print(f"  {number} x {words}")


if __name__ == "__main__":
    main()
