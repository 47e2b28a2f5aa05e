"""Sweeps whose workers are those of any executor, and die: each case is computed, once, and its log says where."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from environment import end, environment
from test_sweeps import COARSE, LONG, QUICK, children, rows, wait_for, written

import incipient.sweep
from incipient import cli
from incipient.errors import OutputError, SceneError
from incipient.sweep import executors
from incipient.sweep.procedure import Watcher

NUMBER = 40
OVER = {"contacts.friction": f"lin:0.1:0.9:{NUMBER}"}
ENDLESS = LONG.replace("samples = 40", "samples = 1000000")
# As docs/howto/cluster.md starts them: a worker ends with its scheduler, and is started again.
WORKER = "while true; do {} -m distributed.cli.dask_worker {} --nthreads 1 --no-dashboard; sleep 0.3; done"
SCHEDULER = (
    "-m",
    "distributed.cli.dask_scheduler",
    "--no-dashboard",
    "--host",
    "127.0.0.1",
    "--port",
)


class Counted(Watcher):
    """Counts how often each case is finished, and says that the first one is."""

    def __init__(self) -> None:
        self.finishes: Counter[str] = Counter()
        self.begun = threading.Event()

    def finished(self, case: Any, outcome: Any, progress: Any) -> None:
        self.finishes[case.identity] += 1
        self.begun.set()


def swept(
    directory: Path,
    text: str = QUICK,
    seed: int | None = None,
    victims: Callable[[], list[int]] = list,
    **how: Any,
) -> Path:
    """The file of a sweep of forty cases, each finished once, while a process is killed at a random moment."""
    watcher, file = Counted(), directory / f"{seed}.sqlite"

    def kill() -> None:
        watcher.begun.wait(60)
        time.sleep(random.Random(seed).uniform(0.0, 0.4))
        os.kill(random.Random(seed).choice(victims()), signal.SIGKILL)

    thread = threading.Thread(target=kill)
    if seed is not None:
        thread.start()
    try:
        progress = incipient.sweep.run(
            written(directory, text), file, OVER, do="judge", watcher=watcher, **how
        )
    finally:
        watcher.begun.set()
        if seed is not None:
            thread.join()
    assert (progress.done, progress.failed) == (NUMBER, 0)
    assert set(watcher.finishes.values()) == {1} and len(watcher.finishes) == NUMBER
    assert set(rows(file, "status, reason")) == {("done", "")}
    logs = [log for (log,) in rows(file, "log")]
    assert all(
        f"host {socket.gethostname()}, process " in log and "ranks 1, threads 1" in log
        for log in logs
    )
    return file


@contextmanager
def cluster() -> Iterator[Any]:
    """A real cluster of two workers of one thread."""
    distributed = pytest.importorskip("distributed", reason="needs pip install 'incipient[dask]'")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as found:
        yield found


def address(found: Any) -> str:
    return found.scheduler_address.replace("tcp://", "dask://")


@pytest.mark.parametrize("times", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_a_killed_worker_of_dask_loses_no_case(tmp_path: Path, times: int) -> None:
    with cluster() as found:

        def pids() -> list[int]:
            return [one.pid for one in found.workers.values()]

        for seed in range(times):
            file = swept(tmp_path, LONG, seed, pids, executor=address(found))
            assert len(rows(file, "tries")) == NUMBER


@pytest.mark.parametrize("times", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_a_killed_process_loses_no_case(tmp_path: Path, times: int) -> None:
    """Of the two processes of this machine; the case that it was at is begun once more, and it alone."""
    for seed in range(times):
        before = set(children(os.getpid()))

        def workers(before: set[int] = before) -> list[int]:
            return sorted({*children(os.getpid())} - before)

        file = swept(tmp_path, QUICK, seed, workers, jobs=2)
        assert sum(tries for (tries,) in rows(file, "tries")) <= NUMBER + 1


@contextmanager
def scheduler(port: int) -> Iterator[None]:
    process = subprocess.Popen(
        [sys.executable, *SCHEDULER, str(port)],
        env=environment(),
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_a_scheduler_that_goes_away_and_comes_back_loses_no_case(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="needs pip install 'incipient[dask]'")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    shell = WORKER.format(sys.executable, f"tcp://127.0.0.1:{port}")
    workers = [
        subprocess.Popen(
            shell,
            shell=True,
            text=True,
            env=environment(),
            stderr=subprocess.PIPE,
            start_new_session=True,
            cwd=tmp_path,
        )
        for _ in range(2)
    ]
    found: list[Path] = []
    thread = threading.Thread(
        target=lambda: found.append(swept(tmp_path, LONG, executor=f"dask://127.0.0.1:{port}"))
    )
    try:
        with scheduler(port):
            thread.start()
            wait_for(tmp_path / "None.sqlite", "status = 'done'")
        time.sleep(1.0)
        with scheduler(port):
            thread.join(120)
            assert found
    finally:
        for worker in workers:
            end(worker)


def test_a_scheduler_that_is_not_there_is_named(
    tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    pytest.importorskip("distributed", reason="needs pip install 'incipient[dask]'")
    monkeypatch.setattr(executors, "START", 0.5)
    order = [
        "sweep",
        str(written(tmp_path, QUICK)),
        "--do",
        "judge",
        "--over",
        "contacts.friction=0.1,0.2",
    ]
    for where in (f"dask://{tmp_path}/none.json", "dask://127.0.0.1:9"):
        assert cli.main([*order, "--out", str(tmp_path / "sweep.sqlite"), "--executor", where]) == 5
        complaint = capsys.readouterr().err
        assert complaint.count("incipient: ") == 1 and f"{where}: no scheduler answers" in complaint


@pytest.mark.slow
def test_any_executor_of_python_computes_a_sweep(tmp_path: Path) -> None:
    """One of processes ends as a whole when a worker dies; then what was computed is kept, and the rest follows."""
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, context) as executor:
        executor.submit(os.getpid).result()
        with pytest.raises(OutputError, match="the executor is broken"):
            swept(tmp_path, QUICK, 0, lambda: list(executor._processes), executor=executor)
    kept = rows(tmp_path / "0.sqlite", "id, finished", "status = 'done'")
    assert kept and len(kept) < NUMBER
    with concurrent.futures.ThreadPoolExecutor(2) as executor:
        scene = written(tmp_path, QUICK)
        progress = incipient.sweep.run(
            scene, tmp_path / "0.sqlite", OVER, do="judge", executor=executor
        )
    assert (progress.known, progress.done) == (len(kept), NUMBER - len(kept))
    assert set(kept) <= set(rows(tmp_path / "0.sqlite", "id, finished"))


POOL = """
import sys
import incipient.sweep
from mpi4py.futures import MPIPoolExecutor

if __name__ == "__main__":
    with MPIPoolExecutor() as executor:
        scene, file, key, values = sys.argv[1:]
        progress = incipient.sweep.run(scene, file, {key: values}, do="judge", executor=executor)
    print(progress.done, progress.failed, progress.places)
"""


@pytest.mark.slow
def test_a_pool_of_ranks_computes_a_sweep(tmp_path: Path, mpirun: Any) -> None:
    """`mpi4py.futures` under `mpirun -n 3`: one rank gives out, two compute. MPI ends all ranks when one dies."""
    start = f"import runpy, sys; sys.argv[:1] = ['-m', {str(tmp_path / 'pool.py')!r}]\n"
    (tmp_path / "pool.py").write_text(POOL)
    start += "runpy.run_module('mpi4py.futures', run_name='__main__', alter_sys=True)\n"
    start = start.replace("['-m', ", "['mpi4py.futures', ")
    file = tmp_path / "sweep.sqlite"
    ((key, values),) = OVER.items()
    done = mpirun(3, start, written(tmp_path, QUICK), file, key, values)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(NUMBER), "0", "2"]
    assert rows(file, "status, tries") == [("done", 1)] * NUMBER


def test_a_case_that_never_ends_fails_with_its_reason(tmp_path: Path) -> None:
    file = tmp_path / "sweep.sqlite"
    how: dict[str, Any] = {"do": "judge", "jobs": 1, "tries": 2, "limit": "1s"}
    progress = incipient.sweep.run(
        written(tmp_path, ENDLESS), file, {"contacts.friction": [0.1]}, **how
    )
    assert progress.failed == 1
    assert rows(file, "tries, reason") == [
        (2, "was ended: it took longer than 1 s (tried 2 times)")
    ]


@pytest.mark.slow
def test_others_go_on_beside_a_case_that_never_ends(tmp_path: Path) -> None:
    table, file = tmp_path / "cases.csv", tmp_path / "sweep.sqlite"
    table.write_text("errors.samples\n40\n1000000\n41\n42\n")
    how: dict[str, Any] = {"do": "judge", "jobs": 2, "tries": 2, "limit": "15s"}
    progress = incipient.sweep.run(written(tmp_path, LONG), file, cases=table, **how)
    assert (progress.done, progress.failed) == (3, 1)
    assert rows(file, "status, tries") == [("done", 1), ("failed", 2), ("done", 1), ("done", 1)]


@pytest.mark.slow
def test_a_case_that_takes_too_much_memory_fails_with_its_reason(tmp_path: Path) -> None:
    """A flow in the plane on coarse cells takes 190 MiB and more; 120 are too few for its libraries alone."""
    file = tmp_path / "sweep.sqlite"
    with concurrent.futures.ThreadPoolExecutor(1) as executor:
        progress = incipient.sweep.run(
            written(tmp_path, COARSE),
            file,
            {"fluid.reynolds": [1]},
            executor=executor,
            memory_mib=120.0,
            tries=1,
        )
    assert progress.failed == 1
    ((reason,),) = rows(file, "reason")
    assert "MiB of memory, more than 120" in reason


def test_what_cannot_be_is_refused_in_one_line(
    tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    order = [
        "sweep",
        str(written(tmp_path, QUICK)),
        "--do",
        "judge",
        "--over",
        "contacts.friction=0.1,0.2",
    ]
    order += ["--out", str(tmp_path / "sweep.sqlite")]
    many = 1 + len(os.sched_getaffinity(0))
    for more, said in (
        (["--executor", "slurm"], "--executor slurm: is not known; give dask://HOST:PORT"),
        (["--ranks", str(many)], f"--ranks {many}: this machine has {many - 1} cores"),
        (["--limit", "0.5x"], "--limit 0.5x: is no multiple above 1"),
        (["--tries", "0"], "--tries 0: is not above zero"),
    ):
        assert cli.main([*order, *more]) == 2
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1 and said in complaint
    assert cli.main([*order, "--executor", "dask://HOST:9", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert (
        "2 to compute, by the workers of the executor" in said and "up to 150 MiB a case\n" in said
    )
    scene = tmp_path / "case.toml"
    with (
        concurrent.futures.ThreadPoolExecutor(1) as executor,
        pytest.raises(SceneError, match="fewer ranks, or start"),
    ):
        incipient.sweep.run(
            scene, tmp_path / "few.sqlite", OVER, do="judge", executor=executor, ranks=many
        )
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert cli.main([*order, "--executor", "dask://127.0.0.1:9"]) == 6
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1 and "pip install 'incipient[dask]'" in complaint
