"""Standard streams that go away: what is written then is dropped, and told where it mattered."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
from contextlib import contextmanager, redirect_stdout

import pytest

from drivers.core.errors import WriteError
from tactile_lab.cli import console
from tactile_lab.cli.streams import LastingStream


@contextmanager
def deserted():
    """Standard output as a pipe whose reader has gone."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as stream, redirect_stdout(stream):
        yield stream


def test_a_pipe_without_a_reader_takes_whatever_is_said():
    lasting = LastingStream("stdout")
    with deserted() as stream:
        for _ in range(3):
            lasting.write("a line\n")
            lasting.flush()
        stream.write("what a library says itself")  # lands in the null device, and nothing complains at the end
        stream.flush()
    assert lasting.failure is not None
    assert lasting.failure.errno == errno.EPIPE


def test_characters_that_a_stream_does_not_have_are_escaped():
    narrow = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    with redirect_stdout(narrow):
        LastingStream("stdout").write("3 ± 1 \udcff")
    assert narrow.buffer.getvalue() == rb"3 \xb1 1 \udcff"


def test_an_answer_that_nobody_reads_is_no_error_and_one_that_cannot_be_written_is(monkeypatch):
    lasting = LastingStream("stdout")
    monkeypatch.setattr(console, "_out", lasting)
    with deserted():
        console.emit_json({"a": 1})
    assert lasting.failure is not None
    console.check_output()
    lasting.failure = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(WriteError, match="standard output: the disk is full"):
        console.check_output()


def test_a_stream_that_was_closed_is_no_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    lasting = LastingStream("stderr")
    assert not lasting.isatty()
    assert lasting.write("dropped") == len("dropped")
    with pytest.raises(OSError, match="Bad file descriptor"):
        lasting.fileno()


def test_answers_go_out_and_remarks_to_the_side_unless_output_is_for_json(monkeypatch):
    out, err = io.StringIO(), io.StringIO()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    console.keep_output_for_json(False)
    console.say("remark")
    console.answer("answer")
    console.show_table("table", ["a"], [["cell"]])
    assert ("answer" in out.getvalue(), "cell" in out.getvalue(), err.getvalue()) == (True, True, "remark\n")
    console.keep_output_for_json(True)
    out.truncate(0)
    console.answer("beside")
    console.show_facts("facts", [("name", "value")])
    console.keep_output_for_json(False)
    assert out.getvalue() == ""
    assert "beside" in err.getvalue()
    assert "value" in err.getvalue()


def test_files_never_take_the_place_of_a_closed_stream(tmp_path):
    """One process for all three: closed before it begins, and a file opened afterwards has another number."""
    code = (
        "import sys; from tactile_lab.cli.streams import open_missing_streams; open_missing_streams();"
        f"f = open({str(tmp_path / 'recording')!r}, 'w'); print('to nobody'); sys.stderr.write('either');"
        "f.write(str(f.fileno())); f.close()"
    )
    closing = "import os, sys; os.closerange(0, 3); os.execv(sys.executable, [sys.executable, '-c', sys.argv[1]])"
    subprocess.run([sys.executable, "-c", closing, code], check=True, timeout=60)
    assert int((tmp_path / "recording").read_text()) > 2
