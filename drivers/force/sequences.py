"""Evaluates the counters of a force sensor: losses, disorder, a stuck sensor loop, a restarted stream."""

from __future__ import annotations

WORD = 1 << 32
STUCK_AFTER = 3
"""Records in a row that count the same measurement, after which the loop counts as stuck (protocols: Failures)."""

RESTART_AFTER = 10
"""Old records in a row after which they count as a new stream of a device that was switched off and on."""


def _step(newer: int, older: int) -> int:
    """Signed difference of two 32-bit counters that wrap."""
    return (newer - older + WORD // 2) % WORD - WORD // 2


class SequenceMonitor:
    """Follows the two counters of one sensor.

    Args:
        stuck_after: records with the same measured in a row after which the sensor counts as stuck.
        step: how far measured moves from record to record (7000 / rate); 0 if unknown.

    Attributes:
        seen: records received.
        lost: records that the box sent and that never arrived.
        skipped: records that the box should have sent by its measuring rate and did not.
        disordered: records that arrived after a newer one, or twice.
        restarts: number of new streams of the box.
    """

    def __init__(self, stuck_after: int = STUCK_AFTER, step: int = 0) -> None:
        self.seen = self.lost = self.skipped = self.disordered = self.restarts = 0
        self._stuck_after, self._expected = stuck_after, step
        self._sent: int | None = None
        self._old_in_a_row = 0
        self._measured = 0
        self._repeats = 0

    def is_new(self, sent: int, measured: int) -> bool:
        """Note one record's counters; False for a record older than one already seen."""
        if self._sent is not None and not self._follows(sent, measured, self._sent):
            self.disordered += 1
            self._old_in_a_row += 1
            if self._old_in_a_row < RESTART_AFTER:
                return False
            self.restarts += 1
        self._old_in_a_row = 0
        self._repeats = self._repeats + 1 if self.seen and measured == self._measured else 0
        self._sent, self._measured = sent, measured
        self.seen += 1
        return True

    @property
    def stuck(self) -> bool:
        """Whether the box sends records, but its sensor has stopped measuring."""
        return self._repeats >= self._stuck_after

    def _follows(self, sent: int, measured: int, previous: int) -> bool:
        step = _step(sent, previous)
        if step > 0:
            self.lost += step - 1
            self._note_skipped(step, _step(measured, self._measured))
            return True
        if _step(measured, self._measured) > 0:  # sent from the beginning again, measured later: a new stream
            self.restarts += 1
            return True
        return False

    def _note_skipped(self, records: int, measured: int) -> None:
        """Compare the measurements between two records with the expected number."""
        if self._expected:
            surplus = measured - records * self._expected
            self.skipped += max(0, surplus + self._expected // 2) // self._expected
