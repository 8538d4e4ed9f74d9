"""The page's certificate, where it is to be encrypted."""

from __future__ import annotations

import ssl
from pathlib import Path

from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import MB, check_size


def load_certificate(file: Path) -> ssl.SSLContext:
    """What a server needs to encrypt, TLS 1.2 or later.

    Args:
        file: PEM, with the certificate, those that vouch for it, and the key without a password.

    Raises:
        ConfigurationError: the file cannot be read, or does not hold a certificate with its key.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        check_size(file, MB)
        context.load_cert_chain(file, password=lambda: "")
    except ssl.SSLError as error:
        hint = "Give a PEM file with both, the key without a password"
        what = "does not contain a certificate and its key"
        raise ConfigurationError(what, where=str(file), hint=hint) from error
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read ({error.strerror})", where=str(file), hint="Check the path"
        ) from error
    return context
