"""The page, encrypted."""

from __future__ import annotations

import shutil
import socket
import ssl
import subprocess
import urllib.error
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from drivers.core.errors import ConfigurationError
from tactile_lab.cli.running.page_address import PageAddress
from tactile_lab.view.feed import ViewFeed

TOKEN = "a-token-of-the-tests-0123456789"


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A certificate for this computer, with its key, of a day."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl on this computer")
    folder = tmp_path_factory.mktemp("certificate")
    key, certificate = folder / "key.pem", folder / "page.pem"
    made = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "1"]
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    words = ["openssl", "req", "-x509", *made, *names, "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(words, check=True, capture_output=True)
    certificate.write_text(certificate.read_text() + key.read_text())
    return certificate


@pytest.mark.usefixtures("quick_children")
def test_a_page_with_a_certificate_is_encrypted_and_has_its_token_all_the_same(certificate: Path) -> None:
    trusting = ssl.create_default_context(cafile=str(certificate))
    with ViewFeed("127.0.0.1", 0, TOKEN, "test", certificate=str(certificate)) as feed:
        place = urlsplit(feed.url)
        assert place.scheme == "https"
        bare = f"https://127.0.0.1:{place.port}/"
        with pytest.raises(urllib.error.HTTPError, match="403") as refused:
            urllib.request.urlopen(bare, context=trusting, timeout=60)
        refused.value.close()
        request = urllib.request.Request(bare, headers={"Cookie": f"tactile_lab_token={TOKEN}"})
        with urllib.request.urlopen(request, context=trusting, timeout=60) as answer:
            assert b"<html" in answer.read().lower()
        opener = urllib.request.build_opener(_NoRedirect, urllib.request.HTTPSHandler(context=trusting))
        with pytest.raises(urllib.error.HTTPError) as sent_on:
            opener.open(feed.url, timeout=60)
        sent_on.value.close()
        assert sent_on.value.headers["Set-Cookie"].endswith("; Secure")
        with socket.create_connection(("127.0.0.1", place.port or 0), timeout=60) as client:
            client.sendall(f"GET / HTTP/1.1\r\nCookie: tactile_lab_token={TOKEN}\r\n\r\n".encode())
            assert not client.makefile("rb").read().startswith(b"HTTP")


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *arguments: object) -> None:
        return None


def test_a_file_without_certificate_and_key_is_told_before_anything_starts(certificate: Path, tmp_path: Path) -> None:
    (tmp_path / "noise.pem").write_bytes(b"-----BEGIN CERTIFICATE-----\nno\n")
    alone = tmp_path / "alone.pem"
    alone.write_text(certificate.read_text().partition("-----BEGIN PRIVATE")[0])
    for file, words in (
        (tmp_path / "noise.pem", "does not contain a certificate and its key"),
        (alone, "does not contain a certificate and its key"),
        (tmp_path / "none.pem", "cannot be read"),
        (Path("/dev/zero"), "is a pipe or device"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            PageAddress("127.0.0.1", 0, TOKEN, file).check()
    assert PageAddress("127.0.0.1", 0, TOKEN, certificate).check()[3] == str(certificate)
