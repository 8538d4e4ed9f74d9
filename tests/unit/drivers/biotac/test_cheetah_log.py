"""Logs of stand-alone BioTacs on the Cheetah adapter, and the tare that follows drift."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.biotac.biotac import BioTac, BioTacCalibration, BioTacSettings
from drivers.biotac.cheetah_log import BEGIN, decode_log, encode_log
from drivers.biotac.slot_codec import Channel, Slot, electrode_channel
from drivers.core.errors import CodecError

LINE = "0.000000 1 1 17 2602 0 2713 0 2391 1"
UPRIGHT = np.eye(3)


def sensor(electrodes: int = 19, follow_s: float = 30.0) -> BioTac:
    model = {"electrodes": electrodes, "distal_T_sensor": {"translation_m": (0.0, 0.0, 0.013)}}
    return BioTac("FF", BioTacCalibration.model_validate(model), BioTacSettings(follow_s=follow_s))


def test_a_line_is_time_batch_frame_channel_and_a_value_with_parity_for_each_sensor() -> None:
    log = decode_log(f"Sensor: BT1\nSampRate: 4400\n\n{BEGIN}\n{LINE}\n0.25 1 1 0 2040 0 2041 0 2042 0\n")
    assert log.header == {"Sensor": "BT1", "SampRate": "4400"}
    assert log.sensors == 3
    assert log.electrodes == 19
    assert log.values.tolist() == [[2602, 2713, 2391], [2040, 2041, 2042]]
    assert log.parity_errors.tolist() == [[False, False, True], [False, False, False]]
    assert list(log.slots(0)) == [(0, Slot((), {electrode_channel(1): 2602})), (250_000_000, Slot((2040,), {}))]
    assert [slot for _, slot in log.slots(2)] == [Slot((2042,), {})]  # the other came with wrong parity


def test_without_times_the_samples_are_counted_at_the_sensors_rate() -> None:
    log = decode_log("\n".join([LINE] * 45))
    assert log.times_s[44] == pytest.approx(0.01)


NO_SAMPLES = (
    "",
    "x 1 1 17 2602 0",
    "0 1 1 17 2602",
    "0 1 1 16 2602 0",
    "0 1 1 41 1 0",
    "0 1 1 17 4096 0",
    "0 1 1 17 1 2",
    "nan 1 1 17 1 0",
)


@pytest.mark.parametrize("line", NO_SAMPLES)
def test_a_line_that_is_no_sample_is_named(line: str) -> None:
    with pytest.raises(CodecError, match="line 2" if line else "no samples"):
        decode_log(f"0 1 1 17 1 0\n{line}\n" if line else "")


def test_a_line_of_another_number_of_sensors_is_named() -> None:
    with pytest.raises(CodecError, match="line 2: 1 sensors, but 3 before"):
        decode_log(f"{LINE}\n0 1 1 17 2602 0\n")


@settings(max_examples=60, derandomize=True)
@given(st.text(alphabet="0123456789. -\nxBeginFl:", max_size=80))
def test_any_text_decodes_or_raises_a_codec_error(text: str) -> None:
    try:
        log = decode_log(text)
    except CodecError:
        return
    again = decode_log(encode_log(log))
    assert again.values.tolist() == log.values.tolist()


def test_the_recorded_log_of_three_sensors_comes_back_and_feeds_the_device(lab_data: Path) -> None:
    text = (lab_data / "cncr_biotac_sp_cheetah" / "output.txt").read_text()
    log = decode_log(text)
    assert log.values.shape == (13_200, 3)
    assert not log.parity_errors.any()
    assert decode_log(encode_log(log)).values.tolist() == log.values.tolist()
    tip = sensor()
    for stamp_ns, slot in log.slots(0):
        tip.take(slot, stamp_ns)
    assert tip.channels.newest((Channel.PDC,))[0] == pytest.approx(2593, abs=30)
    assert tip.health() == ("not tared",)
    tip.tare(UPRIGHT)
    assert tip.health() == ()


# --- the tare follows drift ----------------------------------------------------------------------------------------


def drifting(tip: BioTac, seconds: float, pdc_per_s: float, electrode_per_s: float, *, squeezed: float = 0.0) -> None:
    """Feed readings at 100 Hz whose channels creep; one electrode is squeezed besides."""
    for step in range(round(seconds * 100)):
        t = step / 100.0
        values = {int(Channel.PDC): round(1700 + pdc_per_s * t), int(Channel.TAC): 2000, int(Channel.TDC): 2280}
        values |= {electrode_channel(n): round(3000 + electrode_per_s * t) for n in range(1, 20)}
        values[electrode_channel(7)] -= round(squeezed)
        tip.take(Slot((2040,), values), step * 10_000_000)
        if step == 10:
            tip.tare(UPRIGHT)


def test_the_tare_follows_a_slow_drift_of_an_untouched_finger() -> None:
    following, fixed = sensor(follow_s=5.0), sensor(follow_s=0.0)
    for tip in (following, fixed):
        drifting(tip, 60.0, pdc_per_s=0.5, electrode_per_s=-1.0)
    assert following.load_N(UPRIGHT) < 0.05
    assert fixed.load_N(UPRIGHT) > 0.1  # 30 counts of drift taken for a touch


def test_a_press_is_not_taken_for_drift() -> None:
    tip = sensor(follow_s=5.0)
    drifting(tip, 1.0, 0.0, 0.0)
    pressed = {int(Channel.PDC): 1760} | {electrode_channel(n): 2900 for n in range(1, 20)}
    for step in range(6000):
        tip.take(Slot((2040,), pressed), 1_000_000_000 + step * 10_000_000)
    assert tip.load_N(UPRIGHT) == pytest.approx(19 * 100 * 0.001)


def test_a_light_touch_that_squeezes_an_electrode_holds_the_tare() -> None:
    tip = sensor(follow_s=5.0)
    drifting(tip, 1.0, 0.0, 0.0)
    light = {int(Channel.PDC): 1704} | {electrode_channel(n): 2950 if n == 7 else 3000 for n in range(1, 20)}
    for step in range(3000):
        tip.take(Slot((2040,), light), 1_000_000_000 + step * 10_000_000)
    assert tip.load_N(UPRIGHT) == pytest.approx(0.05)
