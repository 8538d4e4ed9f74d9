"""A wizard led from its page in a real browser: steps, what is missing, taking back, leaving, and the result."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from calibration.store.store import read_record
from tests.support.browser import Browser, chromium, until
from tests.support.warm_terminal import Terminal, WarmProgram

TOKEN = "a-token-of-the-tests-0123456789"
PAGE = ("--view", "--view-port", 0, "--token", TOKEN)
FAST = {"travel_m_s": 0.5, "turn_rad_s": 2.4, "press_m_s": 0.04, "settle_s": 0.2}
POSES = [{"known_deg": {"FFJ3": a}, "measured_deg": {"FFJ3": b}} for a, b in ((0, 1.1), (45, 46.0), (90, 91.2))]


def opened(terminal: Terminal) -> str:
    """The page's address, as the terminal tells it."""
    terminal.until("page: ")
    terminal.until(TOKEN)
    return terminal.told.rpartition("page: ")[2]


@pytest.mark.long
def test_a_wizard_is_led_from_its_page(program: WarmProgram, tmp_path: Path) -> None:
    browser_program = chromium()
    if browser_program is None:
        pytest.skip("no Chromium on this computer")
    (tmp_path / "fast.yaml").write_text(yaml.safe_dump({"measurer": FAST}))
    (tmp_path / "poses.yaml").write_text(
        yaml.safe_dump({"format": "tactile-joint-poses/1", "rig": "simulated-hand", "poses": POSES})
    )
    words = ("--settings", "fast.yaml", "--touches", 1, "--out", "forearm.yaml", *PAGE)
    terminal = program.terminal(tmp_path, "calibrate", "forearm", *words)
    with Browser(browser_program, opened(terminal), tmp_path / "profile") as browser:
        browser.press("Begin")
        until(lambda: browser.shows("1/5 FF presses table top"), "the first step")
        browser.press("Measure")
        until(lambda: browser.shows("done; not enough yet: touches"), "what is missing in words")
        until(lambda: browser.shows("2/5 "), "the second step")
        assert browser.shows("weight of the weakest direction")
        browser.press("Undo the last step")
        until(lambda: not browser.shows("2/5 "), "the first step again")
        browser.press("Quit")
        assert "Nothing was stored" in terminal.ended(130)
        assert not (tmp_path / "forearm.yaml").exists()

        words = ("--from", "poses.yaml", "--out", "joints.yaml", *PAGE)
        terminal = program.terminal(tmp_path, "calibrate", "joints", *words)
        browser.do("Page.navigate", url=opened(terminal))
        until(lambda: browser.shows("Store it as joints.yaml?"), "the last question")
        assert browser.shows("PASS")
        assert browser.shows("residual, deg")
        browser.press("Yes")
        browser.press("Close it")
        terminal.ended(0)
    assert read_record(tmp_path / "joints.yaml").verdict == "PASS"
