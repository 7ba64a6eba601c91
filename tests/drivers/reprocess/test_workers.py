"""Re-measuring on other processes: this computer's own, and those of a Dask cluster."""

import importlib.util
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from reprocessing import CALIBRATION, OBJECT, archive, files, only_finished, table

from grabberd.errors import ExtraMissing, InputError, NotReady
from grabberd_reprocess.reprocess_archive import (
    ReprocessProgress,
    ReprocessRequest,
    ReprocessSummary,
    reprocess_archive,
)
from grabberd_reprocess.workers import ALGEBRA_THREADS, cluster_workers, local_workers

CAPTURES, FIELDS = 8, 12


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures")
    archive(folder, CAPTURES, FIELDS)
    return folder


@pytest.fixture
def cluster(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Any]:
    """Of two workers, or as many as the test wants: each is a process that imports for a second."""
    import distributed  # noqa: PLC0415 - a second that only these tests need

    with distributed.LocalCluster(
        n_workers=getattr(request, "param", 2),
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",  # also the port of its HTTP server, which another test may have
        local_directory=str(tmp_path / "dask"),
        silence_logs=50,
    ) as one:
        yield one


def on_cluster(
    captures: Path, out: Path, address: str, on_progress: Any = lambda _: None
) -> ReprocessSummary:
    request = ReprocessRequest([str(captures)], out, CALIBRATION, OBJECT)
    return reprocess_archive(request, lambda folder: cluster_workers(address, folder), on_progress)


def has_all_once(out: Path) -> bool:
    rows = table(out).to_pandas()
    counted = rows.groupby("capture", observed=True).n.nunique()
    twice = rows.duplicated(["capture", "n", "target"]).any()
    return (
        len(files(out)) == CAPTURES and (counted == FIELDS).all() and len(counted) == CAPTURES and not twice
    )


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_dask_cluster_loses_a_worker_and_nothing_is_missing_and_nothing_twice(
    captures: Path, cluster: Any, tmp_path: Path
) -> None:
    killed: list[int] = []

    def kill_one(far: ReprocessProgress) -> None:
        if 0 < far.left < CAPTURES and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    summary = on_cluster(captures, tmp_path / "out", cluster.scheduler_address, kill_one)
    assert killed
    assert (summary.measured + summary.unchanged, summary.refused) == (CAPTURES, [])
    assert has_all_once(tmp_path / "out")
    assert only_finished(tmp_path / "out")
    again = on_cluster(captures, tmp_path / "out", cluster.scheduler_address)
    assert (again.measured, again.unchanged) == (0, CAPTURES)


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_processes_here_lose_one_of_them_and_nothing_is_missing_and_nothing_twice(
    captures: Path, tmp_path: Path
) -> None:
    killed: list[int] = []

    def kill_one(far: ReprocessProgress) -> None:
        if 0 < far.left < CAPTURES and not killed:
            children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
            workers = [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
            killed.append(int(workers[0]))
            os.kill(killed[0], signal.SIGKILL)

    request = ReprocessRequest([str(captures)], tmp_path / "out", CALIBRATION, OBJECT)
    summary = reprocess_archive(request, lambda _: local_workers(2), kill_one)
    assert killed
    assert (summary.measured + summary.unchanged, summary.refused) == (CAPTURES, [])
    assert has_all_once(tmp_path / "out")
    assert only_finished(tmp_path / "out")


@pytest.mark.parametrize("before", [None, "7"])
def test_a_process_here_has_one_thread_of_algebra_and_the_command_what_it_had(
    before: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(ALGEBRA_THREADS, raising=False)
    if before is not None:
        monkeypatch.setenv(ALGEBRA_THREADS, before)
    with local_workers(1) as workers, workers.start() as pool:
        assert pool.submit(os.getenv, ALGEBRA_THREADS).result() == "1"
    assert os.environ.get(ALGEBRA_THREADS) == before


def test_without_dask_it_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ExtraMissing) as caught, cluster_workers("tcp://127.0.0.1:8786", tmp_path):
        pass
    assert "grabberd[fleet]" in caught.value.hint


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:{}", "nonsense", "http://127.0.0.1:{}"])
def test_an_address_without_a_scheduler_is_said(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd_reprocess.workers.CONNECT_S", 1)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # and does not listen
        where = address.format(taken.getsockname()[1])
        with pytest.raises(NotReady, match="no Dask scheduler at"), cluster_workers(where, tmp_path):
            pass


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_cluster_that_goes_away_is_said_and_what_was_done_is_kept(
    captures: Path, cluster: Any, tmp_path: Path
) -> None:
    def close(far: ReprocessProgress) -> None:
        if 0 < far.left < CAPTURES:
            cluster.close()

    with pytest.raises(NotReady, match="went away"):
        on_cluster(captures, tmp_path / "out", cluster.scheduler_address, close)
    assert 1 <= len(files(tmp_path / "out")) < CAPTURES
    assert only_finished(tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("cluster", [1], indirect=True)
def test_workers_that_do_not_see_the_folder_are_found_out_before_any_work(
    cluster: Any, tmp_path: Path
) -> None:
    with (
        pytest.raises(InputError, match="does not see the folder"),
        cluster_workers(cluster.scheduler_address, tmp_path / "elsewhere"),
    ):
        pass
