"""Runs every wire fault against a driver; a new driver gets these tests by subclassing :class:`DriverSweep`.

    class TestTheBoxDriver(DriverSweep):
        layout = MessageLayout(...)
        def runtime(self) -> SweptDevice: ...

Each fault is injected into an otherwise healthy stream. The driver must either report it in its health, or stop with a
proper error that names the transport and says what to do. Afterwards it must be possible to connect it again. Faults
that a protocol cannot reveal are listed in ``blind`` with the reason, harmless ones in ``harmless``, and those that may
stop the driver in ``stops``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError, DeviceError, TactileLabError
from drivers.core.transports import Transport
from tests.support.faults import FarEnd, Fault, FaultyTransport, Injectable, MessageLayout, When, standard_faults

STEPS = 160
STEP_ns = 10_000_000


class SweptDriver(Protocol):
    """The driver interface that the sweep needs."""

    def connect(self) -> None: ...
    def close(self) -> None: ...
    def health(self) -> tuple[str, ...]: ...


def _nothing() -> None:
    """Do nothing: there is nothing to repair."""


@dataclass
class SweptDevice:
    """One driver with one device in memory.

    Attributes:
        transport: to the device, without faults.
        clock: clock of both.
        build: makes the driver on a transport.
        step: lets the device send its next message, or do the work of one cycle.
        use: lets the driver process what has arrived, and returns the result.
        repair: repairs the device after one of its own faults.
    """

    transport: Transport
    clock: VirtualClock
    build: Callable[[Transport], SweptDriver]
    step: Callable[[], None]
    use: Callable[[Any], Any]
    repair: Callable[[], None] = _nothing


@dataclass
class Outcome:
    """The outcome of one run: messages of its health, by their text without numbers; why it ended; number of
    samples.
    """

    words: dict[str, str]
    stopped: TactileLabError | None
    samples: int


def _without_figures(text: str) -> str:
    return "".join(letter for letter in text if not letter.isdigit())


def run(runtime: SweptDevice, driver: SweptDriver) -> Outcome:
    """Run a connected driver for the sweep's number of cycles, or until it stops."""
    words: dict[str, str] = {}
    samples = 0
    for _ in range(STEPS):
        runtime.clock.sleep_until_ns(runtime.clock.now_ns() + STEP_ns)
        runtime.step()
        try:
            samples += len(runtime.use(driver))
        except (DeviceError, CodecError) as error:
            return Outcome(words, error, samples)
        words.update({_without_figures(text): text for text in driver.health()})
    return Outcome(words, None, samples)


class DriverSweep:
    """Base class of the sweep tests of one driver."""

    layout: ClassVar[MessageLayout]
    blind: ClassVar[dict[str, str]] = {}
    harmless: ClassVar[frozenset[str]] = frozenset({"counter wrap"})
    stops: ClassVar[frozenset[str]] = frozenset({"unplug"})
    far_end: ClassVar[tuple[str, ...]] = ()
    """Faults of the device itself that the transport can inject (:class:`tests.support.faults.Injectable`)."""

    def __init_subclass__(cls) -> None:
        names = cls.fault_names()

        def swept(self: DriverSweep, fault_name: str, record_property: Callable[[str, object], None]) -> None:
            self.sweep(fault_name, record_property)

        def connecting(self: DriverSweep, fault_name: str) -> None:
            self.connect_under(fault_name)

        connecting_test = pytest.mark.parametrize("fault_name", names)(connecting)
        setattr(cls, "test_connecting_under_a_fault_works_or_says_why", connecting_test)  # noqa: B010
        setattr(  # each subclass has its own faults  # noqa: B010
            cls, "test_a_fault_is_counted_or_ends_in_order", pytest.mark.parametrize("fault_name", names)(swept)
        )

    @classmethod
    def fault_names(cls) -> list[str]:
        """All faults of the sweep."""
        return sorted([*standard_faults(cls.layout), *cls.far_end])

    def runtime(self) -> SweptDevice:
        """A new driver with its device."""
        raise NotImplementedError

    def fault(self, name: str, transport: Transport) -> tuple[Fault, When]:
        """A new fault, and when it strikes."""
        if name not in self.far_end:
            return standard_faults(self.layout)[name]
        assert isinstance(transport, Injectable)
        return FarEnd(name, transport), When()

    def sweep(self, fault_name: str, record_property: Callable[[str, object], None]) -> None:
        """Inject one fault and check the driver's reaction."""
        runtime = self.runtime()
        healthy = runtime.build(runtime.transport)
        healthy.connect()
        clean = run(runtime, healthy)
        healthy.close()
        assert clean.stopped is None

        runtime = self.runtime()
        transport = FaultyTransport(runtime.transport, *self.fault(fault_name, runtime.transport))
        driver = runtime.build(transport)
        transport.armed = False
        driver.connect()
        transport.armed = True
        outcome = run(runtime, driver)
        new = outcome.words.keys() - clean.words.keys()
        record_property("injected", transport.injected)
        counted = "; ".join(outcome.words[each] for each in sorted(new))
        record_property("counted", counted or str(outcome.stopped or "nothing"))
        assert transport.injected > 0, "the fault never struck"
        self._judge(fault_name, outcome, new, clean)
        driver.close()
        driver.close()
        transport.armed = False
        runtime.repair()
        self._works_again(runtime, driver)

    def connect_under(self, fault_name: str) -> None:
        """Inject one fault from the first message on: the driver must connect nevertheless, or say why it cannot."""
        runtime = self.runtime()
        fault, when = self.fault(fault_name, runtime.transport)
        transport = FaultyTransport(runtime.transport, fault, replace(when, first=0))
        driver = runtime.build(transport)
        try:
            driver.connect()
        except (DeviceError, CodecError) as error:
            if not (error.where and error.hint):
                pytest.fail(f"an error that does not say where and what to do: {error}")
        driver.close()
        transport.armed = False
        runtime.repair()
        self._works_again(runtime, driver)

    def _judge(self, fault_name: str, outcome: Outcome, new: set[str], clean: Outcome) -> None:
        if outcome.stopped is not None:
            assert fault_name in self.stops, f"stopped by {outcome.stopped}"
            assert outcome.stopped.where
            assert outcome.stopped.hint
        elif fault_name in self.harmless:
            assert not new
            assert outcome.samples == clean.samples
        elif fault_name in self.blind:
            assert not new, f"no longer blind: {new}"
        else:
            assert new, "the fault went by in silence"

    @staticmethod
    def _works_again(runtime: SweptDevice, driver: SweptDriver) -> None:
        """Check that after closing, with the wire plugged in again, the same driver connects and receives samples."""
        driver.connect()
        runtime.clock.sleep_until_ns(runtime.clock.now_ns() + STEP_ns)
        for _ in range(20):
            runtime.step()
            if runtime.use(driver):
                break
        else:
            pytest.fail("no sample after connecting again")
        driver.close()
