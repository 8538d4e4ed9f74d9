from __future__ import annotations

import io
import os

import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from sessions.recording.traffic.mcap_writer import McapWriter

CHUNK_BYTES = 4096


def messages(count):
    """Channel, log time, data, publish time and sequence of messages on three channels, of all kinds of sizes."""
    for number in range(count):
        data = bytes([number % 251]) * (number * 37 % 700)
        yield 1 + number % 3, 1000 + number // 2, data, 990 + number, number


def by_the_library(count, flush_every=0):
    file = io.BytesIO()
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(profile="p", library="l")
    writer.add_metadata("facts", {"a": "b", "c": ""})
    schema = writer.register_schema("s", "jsonschema", b"{}")
    writer.register_channel("/one", "json", schema)
    writer.register_channel("/two", "raw", 0)
    writer.register_channel("/three", "raw", 0)
    for sequence, message in enumerate(messages(count), start=1):
        writer.add_message(*message)
        if flush_every and not sequence % flush_every:
            writer.flush()
    writer.finish()
    return file.getvalue()


def by_ours(count, flush_every=0):
    file = io.BytesIO()
    writer = McapWriter(file, CHUNK_BYTES, "p", "l")
    writer.add_metadata("facts", {"a": "b", "c": ""})
    schema = writer.add_schema("s", "jsonschema", b"{}")
    for topic, encoding, number in (("/one", "json", schema), ("/two", "raw", 0), ("/three", "raw", 0)):
        writer.add_channel(topic, encoding, number)
    for sequence, message in enumerate(messages(count), start=1):
        writer.add_message(*message)
        if flush_every and not sequence % flush_every:
            writer.flush()
    writer.finish()
    return file.getvalue()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_file_of_one_chunk_is_the_librarys_own_byte_for_byte(count):
    assert by_ours(count) == by_the_library(count)


@pytest.mark.parametrize("flush_every", [0, 1, 7])
def test_a_file_of_many_chunks_says_what_the_librarys_own_says(flush_every):
    ours, theirs = (make_reader(io.BytesIO(made(500, flush_every))) for made in (by_ours, by_the_library))
    assert list(ours.iter_messages()) == list(theirs.iter_messages())
    one, other = ours.get_summary(), theirs.get_summary()
    assert (one.schemas, one.channels) == (other.schemas, other.channels)
    assert one.statistics.channel_message_counts == other.statistics.channel_message_counts


def test_every_chunk_describes_the_channels_of_its_messages():
    content = by_ours(500)
    chunks = [
        record for record in StreamReader(io.BytesIO(content), emit_chunks=True).records if isinstance(record, Chunk)
    ]
    assert len(chunks) > 10
    for chunk in chunks:
        described = set()
        for record in breakup_chunk(chunk):
            if isinstance(record, Channel):
                described.add(record.id)
            assert not isinstance(record, Message) or record.channel_id in described


def test_the_librarys_reader_finds_every_message_in_order():
    reader = make_reader(io.BytesIO(by_ours(500)), validate_crcs=True)
    read = [
        (channel.id, message.log_time, message.data, message.publish_time, message.sequence)
        for _, channel, message in reader.iter_messages(log_time_order=False)
    ]
    assert read == list(messages(500))
    assert reader.get_summary().statistics.message_count == 500


def test_the_index_leads_to_the_messages_of_one_topic():
    reader = make_reader(io.BytesIO(by_ours(500)))
    read = [message.sequence for _, _, message in reader.iter_messages(topics="/two")]
    assert read == [number for number in range(500) if number % 3 == 1]


def test_large_messages_close_their_chunk_at_once():
    file = io.BytesIO()
    writer = McapWriter(file, CHUNK_BYTES, "p", "l")
    channel = writer.add_channel("/big", "raw")
    before = file.tell()
    writer.add_message(channel, 0, os.urandom(CHUNK_BYTES), 0, 0)
    assert file.tell() > before + CHUNK_BYTES
