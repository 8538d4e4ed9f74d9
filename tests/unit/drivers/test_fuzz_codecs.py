"""A short run of the fuzzer, so that it stays usable; the long ones are run by hand."""

from __future__ import annotations

import pytest

from tests.support.fuzz import CODECS, fuzz


@pytest.mark.parametrize("name", CODECS)
def test_random_and_damaged_bytes_decode_or_raise_our_error(name: str) -> None:
    decoded, refused = fuzz(CODECS[name], 400, seed=5)
    assert decoded + refused == 400
