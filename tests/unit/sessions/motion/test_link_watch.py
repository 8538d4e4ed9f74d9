"""Links that feel nothing: what the motors' strain gauges tell of a push on them."""

from __future__ import annotations

import numpy as np

from sessions.motion.link_watch import LinkWatch

CYCLE_ns = 10_000_000
WRIST = np.arange(20) == 8


def counts(rng: np.random.Generator, pushed: float = 0.0) -> np.ndarray:
    torques = 300.0 + 10.0 * rng.standard_normal(20)
    torques[18] += pushed
    return torques


def is_touched(watch: LinkWatch, torques: np.ndarray | None, stamp_ns: int) -> bool:
    watch.take(torques, stamp_ns)
    return watch.is_touched


def cycles_until_touched(pushed: float, begins: int, cycles: int = 400) -> int | None:
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    for cycle in range(cycles):
        if is_touched(watch, counts(rng, pushed if cycle >= begins else 0.0), cycle * CYCLE_ns):
            return cycle
    return None


def test_noise_alone_is_no_touch() -> None:
    assert cycles_until_touched(0.0, 0) is None


def test_a_push_is_told_in_its_second_reading() -> None:
    assert cycles_until_touched(400.0, 200) == 201


def test_the_noise_of_the_motion_before_counts_where_the_first_readings_of_this_one_are_alike() -> None:
    def alarms(watch: LinkWatch) -> int:
        watch.restart()
        alike = [np.zeros(20), np.full(20, 2.0)] * 40
        noise = [np.full(20, 40.0 + number) for number in range(4)]
        told = 0
        for number, torques in enumerate(alike + noise):
            watch.take(torques, number * CYCLE_ns)
            told += bool(watch.pushed.any())
        return told

    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    assert alarms(watch) > 0
    watch.restart()
    for number in range(300):
        watch.take(20.0 * rng.standard_normal(20), number * CYCLE_ns)
    assert alarms(watch) == 0


def test_a_lone_jerk_and_the_jerk_of_starting_are_no_touch() -> None:
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    pushes = [900.0 if cycle < 20 or cycle == 100 else 0.0 for cycle in range(200)]
    assert not any(is_touched(watch, counts(rng, push), stamp * CYCLE_ns) for stamp, push in enumerate(pushes))


def test_a_lone_jerk_that_is_looked_at_twice_is_no_touch() -> None:
    """A hand whose statuses come more rarely than the session looks at them."""
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    readings = [counts(rng, 900.0 if number == 100 else 0.0) for number in range(200)]
    assert not any(
        is_touched(watch, reading, stamp * CYCLE_ns) for stamp, reading in enumerate(readings) for _ in range(2)
    )


def test_a_lone_jerk_that_comes_in_two_answers_is_no_touch() -> None:
    """A hand that is heard twice for every reading of a motor."""
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    readings = [counts(rng, 900.0 if number == 200 else 0.0) for number in range(400)]
    assert not any(is_touched(watch, readings[cycle // 2], cycle * CYCLE_ns // 5) for cycle in range(800))


def test_a_motion_starts_with_a_jerk_that_takes_as_long_however_often_the_hand_is_heard() -> None:
    for cycle_ns in (CYCLE_ns, CYCLE_ns // 10):
        rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
        jerk = 240_000_000 // cycle_ns
        pushes = [900.0 if cycle < jerk else 0.0 for cycle in range(4 * jerk)]
        assert not any(is_touched(watch, counts(rng, push), cycle * cycle_ns) for cycle, push in enumerate(pushes))


def test_a_touch_stays_one_until_something_else_is_heard() -> None:
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    told = [
        is_touched(watch, counts(rng, 900.0 if stamp >= 100 else 0.0), min(stamp, 101) * CYCLE_ns)
        for stamp in range(110)
    ]
    assert not any(told[:101])
    assert all(told[101:])


def test_a_new_motion_is_compared_with_itself() -> None:
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    assert not any(is_touched(watch, counts(rng), stamp * CYCLE_ns) for stamp in range(100))
    watch.restart()
    assert not any(is_touched(watch, counts(rng, 900.0), (100 + stamp) * CYCLE_ns) for stamp in range(100))


def test_a_push_that_grows_slowly_is_told() -> None:
    """A link that comes down on a rim: what grows over half a second must not become what is usual."""
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    told = [is_touched(watch, counts(rng, max(0, cycle - 200) * 8.0), cycle * CYCLE_ns) for cycle in range(270)]
    assert not any(told[:200])
    assert told[240]


def cycle_of_a_push(pushed: float, jerks: tuple[int, ...] = ()) -> int | None:
    """The cycle in which motor 18 shows a push that begins at the 200th if it stands still; None if it does not."""
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    for cycle in range(400):
        shown = 130.0 if cycle in jerks else pushed if cycle >= 200 else 0.0
        watch.take(np.round(counts(rng, shown)), cycle * CYCLE_ns)
        if watch.pushed.any():
            assert watch.pushed[18]
            return cycle
    return None


def test_a_motor_that_stands_still_tells_a_light_push_in_its_third_reading() -> None:
    assert cycle_of_a_push(60.0) == 202
    assert cycle_of_a_push(0.0) is None


def test_a_motor_that_stands_still_tells_nothing_of_lone_jerks() -> None:
    assert cycle_of_a_push(0.0, jerks=(26, 27, 100, 101, 150)) is None


def test_a_hand_that_answers_500_times_a_second_tells_pushes_and_nothing_of_its_controllers_noise() -> None:
    """Its joints' controllers differentiate noise over a shorter time: bursts of some readings, but not of 30 ms."""
    rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
    burst, told = np.zeros(20), []
    for cycle in range(2000):
        if cycle % 4 == 0:
            burst = np.where(rng.random(20) < 0.003, 80.0, 0.0)
        watch.take(counts(rng, 60.0 if cycle >= 1500 else 0.0) + burst, cycle * CYCLE_ns // 5)
        if watch.pushed.any():
            told.append(cycle)
    assert 1505 <= told[0] <= 1520


def test_a_hand_without_strain_gauges_tells_nothing() -> None:
    watch = LinkWatch(WRIST)
    assert not any(is_touched(watch, None, stamp * CYCLE_ns) for stamp in range(50))


def first_told(pushes: dict[int, float], wrist: np.ndarray, begins: int = 200, lasts: int = 100) -> int | None:
    """The cycle in which a push is told first, given in counts by motor; the first reading with it is number 0."""
    rng, watch = np.random.default_rng(0), LinkWatch(wrist)
    for cycle in range(begins + lasts):
        torques = 300.0 + 3.0 * rng.standard_normal(20)
        if cycle >= begins:
            torques[list(pushes)] += list(pushes.values())
        watch.take(torques, cycle * CYCLE_ns)
        if watch.pushed.any():
            return cycle - begins
    return None


def test_both_motors_of_the_wrist_tell_together_what_one_tells_later() -> None:
    wrist = np.isin(np.arange(20), (8, 9))
    assert first_told({8: -80.0, 9: 80.0}, wrist) == 1
    assert first_told({8: -80.0}, wrist) == 4
    assert first_told({8: -80.0, 9: 80.0}, wrist, lasts=1) is None


def test_a_hand_without_a_wrist_tells_no_push_where_there_is_none() -> None:
    assert first_told({}, np.zeros(20, dtype=bool)) is None


def test_a_finger_that_is_laid_on_and_leans_on_a_link_is_told_in_two_readings() -> None:
    for count, leans in ((45.0, False), (90.0, True)):
        rng, watch = np.random.default_rng(0), LinkWatch(WRIST)
        for cycle in range(102):
            torques = 300.0 + 3.0 * rng.standard_normal(20)
            torques[3] += count if cycle >= 100 else 0.0
            watch.take(torques, cycle * CYCLE_ns)
        assert watch.is_leaning is leans


def leans_after(pushes: list[dict[int, float]]) -> bool:
    """Whether a link leans hard after further readings, with counts added by motor."""
    rng, watch = np.random.default_rng(0), LinkWatch(np.isin(np.arange(20), (8, 9)))
    for cycle in range(100 + len(pushes)):
        torques = 300.0 + 3.0 * rng.standard_normal(20)
        for motor, count in pushes[cycle - 100].items() if cycle >= 100 else ():
            torques[motor] += count
        watch.take(torques, cycle * CYCLE_ns)
    return watch.is_leaning_hard


def test_a_push_that_grows_and_stays_is_compared_with_the_motion_before_it() -> None:
    growing = [{8: 60.0 * number} for number in range(1, 7)]
    rng, watches = np.random.default_rng(0), [LinkWatch(WRIST), LinkWatch(WRIST)]
    for cycle in range(40 + len(growing)):
        torques = 300.0 + 25.0 * rng.standard_normal(20)
        for motor, count in growing[cycle - 40].items() if cycle >= 40 else ():
            torques[motor] += count
        if cycle == 40:
            watches[0].keep_usual()
        for watch in watches:
            watch.take(torques, cycle * CYCLE_ns)
    assert [watch.is_leaning_hard for watch in watches] == [True, False]


def test_the_wrist_tells_a_link_that_leans_while_fingers_are_laid_on_whose_own_motors_show_nothing() -> None:
    assert leans_after([{8: 100.0, 9: -100.0}] * 3)
    assert leans_after([{8: 400.0}] * 2)
    assert not leans_after([{8: 100.0, 9: -100.0}] * 2), "what fingertips feel shows as well"
    assert not leans_after([{8: 200.0}] * 5)
