"""Experiments on a Dask cluster: the same rows, a worker that dies, and clusters that cannot be used."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import distributed
import pytest
from distributed import Client

from drivers.core.errors import ConfigurationError, SessionError
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.execution import cluster as cluster_module
from tactile_lab.experiments.runner import RunnerSettings, run_cells
from tests.support import cluster_work
from tests.support.dask_cluster import DaskCluster

CELLS = [Cell((("noise", noise),), seed) for seed in range(6) for noise in (25, 50)]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with DaskCluster(tmp_path_factory.mktemp("cluster"), workers=2) as started:
        with Client(started.address) as client:
            client.submit(os.getpid).result()  # Dask's threads in this process, which stay
        yield started


def rows_of(cluster: DaskCluster, file: Path, work: object, cells: list[Cell] = CELLS) -> list[Row]:
    return run_cells("test", cells, work, file, RunnerSettings(scheduler=cluster.address))  # type: ignore[arg-type]


def test_a_cluster_makes_the_rows_that_one_process_makes(cluster: DaskCluster, tmp_path: Path) -> None:
    alone = run_cells("test", CELLS, cluster_work.square, tmp_path / "alone.jsonl")
    assert rows_of(cluster, tmp_path / "together.jsonl", cluster_work.square) == alone
    assert alone[3].problem == "nothing fits"  # a failed run is a result


def test_what_a_client_left_undone_is_made_by_the_next(cluster: DaskCluster, tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    with pytest.raises(KeyboardInterrupt):
        run_cells(
            "test",
            CELLS,
            cluster_work.square,
            file,
            RunnerSettings(scheduler=cluster.address),
            finished=_interrupt_at_four,
        )
    kept = len(file.read_text().splitlines()) - 1
    assert kept == 4
    assert len(rows_of(cluster, file, cluster_work.square)) == len(CELLS)
    assert len(file.read_text().splitlines()) - 1 == len(CELLS)


def _interrupt_at_four(row: Row, done: int, total: int) -> None:
    if done == 4:
        raise KeyboardInterrupt


def test_a_worker_that_is_killed_costs_no_run(cluster: DaskCluster, tmp_path: Path) -> None:
    def kill_one(row: Row, done: int, total: int) -> None:
        if done == 3:
            os.kill(int(row.figures["process"]), signal.SIGKILL)  # type: ignore[index]

    settings = RunnerSettings(scheduler=cluster.address)
    rows = run_cells("test", CELLS, cluster_work.named, tmp_path / "runs.jsonl", settings, kill_one)
    assert [row.cell for row in rows] == CELLS
    assert len({row.figures["process"] for row in rows if row.figures}) >= 2


@pytest.mark.long  # its workers die and start again four times
def test_a_run_that_kills_its_workers_is_named_when_all_others_are_made(cluster: DaskCluster, tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    with pytest.raises(SessionError, match=r"workers died in 25, seed 4.*resumes behind them"):
        rows_of(cluster, file, cluster_work.deadly)
    assert len(file.read_text().splitlines()) - 1 == len(CELLS) - 1


def test_workers_have_to_see_the_folder_that_runs_write_into(
    cluster: DaskCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Client(cluster.address) as client:
        cluster_module._check_shared(client, tmp_path)
        monkeypatch.setattr(cluster_module, "_sees", cluster_work.sees_nothing)
        with pytest.raises(ConfigurationError, match="does not see this folder"):
            cluster_module._check_shared(client, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_worker_with_another_version_is_refused(cluster: DaskCluster, tmp_path: Path) -> None:
    version = cluster_module.version()
    cluster_module.version = lambda: "another"  # type: ignore[assignment]
    try:
        with pytest.raises(ConfigurationError, match=f"another version of the program, {version}"):
            rows_of(cluster, tmp_path / "runs.jsonl", cluster_work.square)
    finally:
        cluster_module.version = lambda: version  # type: ignore[assignment]


@pytest.mark.parametrize(
    ("threads", "version", "program", "words"),
    [
        ([], distributed.__version__, "", r"has no workers.*dask worker tcp://there"),
        ([1, 2], distributed.__version__, "", r"1 of 2 workers have several threads.*--nthreads 1"),
        ([1], "1.0", "", r"worker tcp://0 has distributed 1.0, this program \d"),
        ([1], distributed.__version__, ImportError("No module named 'x'"), r"worker tcp://0 cannot make.*'x'.*Install"),
        ([1], distributed.__version__, "0123", r"worker tcp://0 has another version of the program, 0123"),
    ],
)
def test_workers_that_give_other_results_are_refused(
    threads: list[int], version: str, program: str | ImportError, words: str
) -> None:
    workers = {f"tcp://{number}": {"nthreads": each} for number, each in enumerate(threads)}
    versions = {name: {"packages": {"distributed": version}} for name in workers}
    client: Any = SimpleNamespace(
        get_versions=lambda check: {"workers": versions},
        run=lambda asked, on_error: dict.fromkeys(workers, program),
        scheduler_info=lambda n_workers: {"workers": workers},
        wait_for_workers=lambda number, timeout: None,
    )
    with pytest.raises(ConfigurationError, match=words):
        cluster_module._check_workers(client, "tcp://there")


def test_a_scheduler_of_another_version_is_told_in_our_words_and_costs_no_earlier_result(
    cluster: DaskCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "runs.jsonl"
    monkeypatch.setattr("tactile_lab.experiments.runner.version", lambda: "an earlier one")
    run_cells("test", CELLS[:1], cluster_work.square, file)
    monkeypatch.undo()
    earlier = file.read_bytes()
    monkeypatch.setattr(distributed, "__version__", "2025.1.0")
    with pytest.raises(ConfigurationError, match=r"the scheduler has distributed \d.*, this program 2025.1.0"):
        rows_of(cluster, file, cluster_work.square)
    assert file.read_bytes() == earlier


def test_no_scheduler_leaves_nothing_and_is_not_asked_for_where_all_runs_are_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "_CONNECT_s", 0.2)
    settings, file = RunnerSettings(scheduler="tcp://127.0.0.1:9"), tmp_path / "runs.jsonl"
    with pytest.raises(ConfigurationError, match="no scheduler answers"):
        run_cells("test", CELLS[:1], cluster_work.square, file, settings)
    assert not file.exists()
    rows = run_cells("test", CELLS[:1], cluster_work.square, file)
    assert run_cells("test", CELLS[:1], cluster_work.square, file, settings) == rows


@pytest.mark.long
def test_a_scheduler_that_ends_ends_the_experiment(tmp_path: Path) -> None:
    with DaskCluster(tmp_path, workers=1) as started:
        settings = RunnerSettings(scheduler=started.address)
        with pytest.raises(SessionError, match=r"scheduler has (ended|lost the runs)"):
            run_cells(
                "test", CELLS, cluster_work.square, tmp_path / "r.jsonl", settings, lambda *_: started.end_scheduler()
            )


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (b"", "no scheduler answers .silent for"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "something else.*8787 is its web page"),
    ],
)
def test_whoever_listens_there_but_is_no_scheduler_holds_nothing_up(
    said: bytes, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "_CONNECT_s", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            visitor, _ = server.accept()
            with visitor:
                visitor.sendall(said)
                while visitor.recv(4096):
                    pass

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(ConfigurationError, match=words), cluster_module._connected(_address(server)):
            pass
        thread.join(10)


def _address(server: socket.socket) -> str:
    return f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.long  # it is given time
def test_no_scheduler_is_told_with_how_to_start_one(tmp_path: Path) -> None:
    command = ["-m", "tactile_lab", "sweep", "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path)]
    ended = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=False)
    assert ended.returncode == 2, ended.stderr
    assert "no scheduler answers" in ended.stderr
    assert "dask scheduler" in ended.stderr
    assert "Traceback" not in ended.stderr
