from __future__ import annotations

import sys

import pytest

from drivers.shadow.ethercat_link import EthercatSettings
from drivers.shadow.pysoem_link import PysoemLink
from tactile_lab.clock import VirtualClock
from tactile_lab.errors import ConfigurationError


def test_without_pysoem_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysoem", None)
    with pytest.raises(ConfigurationError, match=r"pysoem is not installed. Install it with.*\[ethercat\]"):
        PysoemLink("hand", EthercatSettings(interface="lo"), VirtualClock())
