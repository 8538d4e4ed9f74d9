"""Shared fixtures: where the recorded real data lie, and a guard against leaks."""

from __future__ import annotations

import fcntl
import gc
import os
import signal
import threading
from collections.abc import Generator, Iterator
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.support.forked_children import forked_children

REPOSITORY = Path(__file__).resolve().parent.parent

# A shell without job control starts what runs in the background with Ctrl+C ignored, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Sessions with physics are chaotic: a last digit decides where a finger is some grasps later, and OpenBLAS has kernels
# with other last digits for other processors. These run on all of them, so that stored values hold. Numpy comes later.
os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

# On a busy machine any example may take long: nothing is wrong with it then.
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")


def pytest_xdist_auto_num_workers() -> int:
    """Three workers for two cores: a third of the time a test waits for a device, a page or another process."""
    return max(1, 3 * len(os.sched_getaffinity(0)) // 2)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays to the end: looking through it for garbage again and again takes a fifth of the time.

    Afterwards garbage is looked for as rarely as the program itself looks for it.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000)
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Modules that run in real time are spread out, so that no worker waits until another is through with its own."""
    modules = [list(tests) for _, tests in groupby(items, key=lambda item: item.path)]
    alone: list[list[pytest.Item]] = []
    others: list[list[pytest.Item]] = []
    for module in modules:
        (alone if "real_time_alone" in getattr(module[0], "fixturenames", ()) else others).append(module)
    for place, module in enumerate(alone):
        others.insert(place * len(modules) // len(alone), module)
    items[:] = [test for module in others for test in module]


@pytest.fixture(scope="session")
def lab_data() -> Path:
    """Folder of real recordings; tests that need it skip, with the reason, where it is absent."""
    folder = Path(os.environ.get("TACTILE_LAB_DATA", REPOSITORY.parent / "shared" / "data"))
    if not (folder / "golden_vectors.json").is_file():
        pytest.skip(f"no recorded data at {folder} (set TACTILE_LAB_DATA)")
    return folder


_ENDING_s = 2.0


@pytest.fixture(autouse=True)
def no_leaked_threads() -> Iterator[None]:
    """A test that leaves a thread behind fails."""
    before = set(threading.enumerate())
    yield
    new = [thread for thread in threading.enumerate() if thread not in before]
    for thread in new:
        thread.join(_ENDING_s)  # it may be ending just now
    left = [thread.name for thread in new if thread.is_alive()]
    assert not left, f"threads left running: {left}"


@pytest.fixture(scope="module")
def real_time_alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """For a module whose rigs run in real time: no other such module runs meanwhile, in no worker.

    Two emulated hands and their masters ask for real-time scheduling and for a core each: on two cores nothing else,
    their own sessions included, would get on.
    """
    with (tmp_path_factory.getbasetemp().parent / "real-time.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.fixture
def quick_children() -> Iterator[None]:
    """Child processes are copies of the test's: a new interpreter for each would take most of the time."""
    with forked_children():
        yield
