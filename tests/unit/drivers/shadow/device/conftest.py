"""A connected hand with a fake palm at the other end."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.fake_palm import (
    Rig,
)


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    rig.hand.connect()
    yield rig
    rig.hand.close()
