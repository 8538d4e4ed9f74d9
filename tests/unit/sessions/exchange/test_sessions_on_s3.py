"""Sessions and tables in an S3 store that runs on this computer."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError, WriteError
from sessions.exchange.addresses import Place, refuse_unwritable_anywhere, write_anywhere
from sessions.exchange.elsewhere import fetch_session, store_session
from sessions.recording.session import Session
from tactile_lab.workflow.cataloguing import catalogue
from tests.support.short_session import files, short_session

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Only to be read."""
    return short_session(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """A bucket of a store on this computer."""
    pytest.importorskip("s3fs", reason="the package s3fs is not installed")
    server_of = pytest.importorskip("moto.server", reason="the package moto is not installed")
    server = server_of.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith("AWS_") or name.lower().endswith("_proxy")]:
            patch.delenv(name)
        patch.setenv("AWS_ACCESS_KEY_ID", "laboratory")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "nothing secret")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        import s3fs

        s3fs.S3FileSystem().mkdir("laboratory")
        yield "s3://laboratory"
    server.stop()


@pytest.fixture(autouse=True, scope="module")
def _threads_of_the_store_begin_before_a_test_counts_them(request: pytest.FixtureRequest) -> None:
    """The store has a thread, and so has what speaks to it."""
    try:
        request.getfixturevalue("bucket")
    except pytest.skip.Exception:
        return


def test_a_session_goes_to_s3_and_back(bucket, closed, tmp_path):
    address = store_session(closed, f"{bucket}/runs")
    assert files(fetch_session(address, tmp_path).folder) == files(closed.folder)
    (line,) = catalogue([Path(f"{bucket}/runs")])
    assert (line["folder"], line["status"]) == (address, "closed")
    write_anywhere(Path(f"{bucket}/all.csv"), "a table")
    assert Place(bucket).read("all.csv") == b"a table"


def test_a_bucket_that_is_not_there_is_one_sentence(bucket, closed):
    for attempt in (
        lambda: store_session(closed, "s3://nobody-s/runs"),
        lambda: catalogue([Path("s3://nobody-s/runs")]),
        lambda: write_anywhere(Path("s3://nobody-s/all.csv"), "a table"),
        lambda: refuse_unwritable_anywhere(Path("s3://nobody-s/all.csv")),
    ):
        with pytest.raises(ConfigurationError, match="there is no such bucket, folder or file"):
            attempt()


def test_a_bucket_that_is_read_only_is_one_sentence(bucket, closed, monkeypatch):
    import s3fs
    from botocore.exceptions import ClientError

    async def denied(self: s3fs.S3FileSystem, method: str, *words: object, **options: object) -> None:
        refusal = {"Error": {"Code": "AccessDenied", "Message": "Access Denied"}}
        raise s3fs.errors.translate_boto_error(ClientError(refusal, method))

    monkeypatch.setattr(s3fs.S3FileSystem, "_call_s3", denied)
    with pytest.raises(WriteError, match="one may not read or write there with these credentials"):
        write_anywhere(Path(f"{bucket}/all.csv"), "a table")
    with pytest.raises(
        WriteError, match=r"laboratory/all\.csv: one may not read or write there with these credentials"
    ):
        refuse_unwritable_anywhere(Path(f"{bucket}/all.csv"))


def test_that_one_may_write_is_found_out_without_a_trace(bucket):
    before = Place(bucket).names()
    refuse_unwritable_anywhere(Path(f"{bucket}/later.parquet"))
    assert Place(bucket).names() == before
