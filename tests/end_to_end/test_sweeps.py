"""Sweeps as they are used: computed once, killed and continued, failed and retried, on a cluster, shown."""

from __future__ import annotations

import csv
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from multiprocessing import resource_tracker, spawn
from pathlib import Path
from typing import Any

import psutil
import pytest
from environment import end, environment
from processes import GRAIN_ON_BED
from scenes import CASES

import incipient.sweep
from incipient import cli
from incipient.errors import OutputError
from incipient.progress import Silent
from incipient.sweep.worker import local_client

CASE = CASES / "disc_in_pocket.toml"
# A few hundredths of a second a case, or, with many samples, some tenths.
QUICK = CASE.read_text().partition("[errors]")[0]
LONG = QUICK + "[errors]\nflow_force = [0.06, 0.05]\nfriction = 0.05\nsamples = 40\n"
ENDLESS = LONG.replace("samples = 40", "samples = 1000000")
COARSE = """
[domain]
length = 12.0
height = 6.0
[fluid]
reynolds = 4.0
scale = "grain"
inertia = false
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 1.0
x = 4.0
density = 2.65
[bed]
kind = "half-discs"
radius = 0.5
spacing = 1.2
offset = 1.0
[gravity]
acceleration = 10.0
[contact]
friction = 0.5
[numerics]
order = 2
mesh_size = 4.0
error_bars = false
"""
FRICTION = "contacts.friction=lin:0.1:0.9:{}"


def written(directory: Path, text: str) -> Path:
    path = directory / "case.toml"
    path.write_text(text)
    return path


def order(scene: Path, file: Path, number: int, *more: object) -> list[object]:
    """The command of a sweep of cases to judge."""
    over = FRICTION.format(number)
    return ["sweep", scene, "--do", "judge", "--over", over, "--out", file, *more]


def rows(path: Path, what: str = "*", where: str = "1") -> list[tuple[Any, ...]]:
    with sqlite3.connect(path, timeout=60) as base:
        return base.execute(f"SELECT {what} FROM cases WHERE {where} ORDER BY rowid").fetchall()


def wait_for(path: Path, where: str) -> None:
    """Until a case is as wanted."""
    for _ in range(1200):
        with suppress(sqlite3.OperationalError):  # not made yet
            if path.exists() and rows(path, where=where):
                return
        time.sleep(0.05)
    raise TimeoutError(where)


def worker_processes(parent: int, number: int = 0) -> list[int]:
    """Worker processes of a process, of which there are so many at least after a while."""
    for _ in range(600):
        children = [child.pid for child in psutil.Process(parent).children()]
        result = [child for child in children if "spawn_main" in command_line(child)]
        if len(result) >= number:
            return sorted(result)
        time.sleep(0.05)
    raise TimeoutError(f"{number} worker processes")


def command_line(process: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text()
    return ""


def gone(process: int) -> bool:
    """Whether a process ends within 30 s: the kernel takes its time to end one that is busy, or that is starting."""
    until = time.monotonic() + 30.0
    while (there := Path(f"/proc/{process}/cwd").exists()) and time.monotonic() < until:
        time.sleep(0.01)
    return not there


class Counted(Silent):
    """Counts the cases that are finished."""

    lines = 0

    def say(self, message: str) -> None:
        self.lines += "is repeated" not in message


def test_thresholds_in_one_table_and_nothing_computed_twice(tmp_path: Path, said_by: Any) -> None:
    """In Stokes flow the critical Shields number does not depend on the shear rate that the scene begins with."""
    text = COARSE.replace("reynolds = 4.0\n", "").replace("density = 2.65\n", "")
    text = text.replace("[gravity]\nacceleration = 10.0\n", "[units]\ndiameter = 1e-4\n")
    scene, file = written(tmp_path, text), tmp_path / "sweep.sqlite"
    varied = ["--over", "units.shear_rate=100,200", "--do", "threshold", "--out", str(file)]
    call = ["sweep", str(scene), *varied, "--jobs", "2"]
    assert (
        f"2: 0 already in {file}, 2 to compute" in said_by(*call, "--dry-run") and not file.exists()
    )
    assert cli.main(call) == 0
    result = incipient.sweep.rows(file)
    assert [row["units.shear_rate"] for row in result] == [100.0, 200.0]
    assert result[0]["shields"] == pytest.approx(result[1]["shields"], rel=1e-6)
    for row in result:
        # tau = rho nu times the critical shear rate, over (rho_s - rho_f) g d = 1650 x 9.81 x 1e-4
        assert row["bed_stress_si"] == pytest.approx(1e-3 * row["shear_rate_si"])
        assert row["shields_nominal"] == pytest.approx(row["bed_stress_si"] / 1.61865)
    assert all("dolfinx" in row["versions"] and row["cpu"] > 0.0 for row in result)
    before = rows(file)
    assert "0 computed, 2 computed before" in said_by(*call)
    assert rows(file) == before
    listed = csv.DictReader(said_by("table", file, "--csv").splitlines())
    assert [float(row["shields"]) for row in listed] == [row["shields"] for row in result]
    pictures = [Path(line) for line in said_by("show", file).split()]
    assert [path.name for path in pictures] == ["sweep_shields.png", "sweep_threshold.png"]
    assert all(path.stat().st_size > 20_000 for path in pictures)
    assert "has no column nonsense" in said_by("show", file, "--quantity", "nonsense", code=2)


def test_failed_cases_keep_their_reason(tmp_path: Path) -> None:
    """A grain that is lighter than the fluid has no threshold; the other is computed all the same."""
    scene, file = written(tmp_path, COARSE), tmp_path / "sweep.sqlite"
    densities = {"body.density": [0.5, 2.65]}
    progress = incipient.sweep.run(scene, file, densities, do="threshold", jobs=1)
    assert (progress.failed, progress.done) == (1, 1)
    failed, done = incipient.sweep.rows(file)
    assert failed["status"] == "failed" and "a grain denser than the fluid" in failed["reason"]
    assert done["status"] == "done" and done["reason"] == ""


def test_outcomes_that_take_longer_to_come_than_a_look_are_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy machine half a second was too short, and each case failed with an error of Dask's."""
    monkeypatch.setattr("incipient.sweep.procedure.LOOK", 3e-4)
    scene, file = written(tmp_path, QUICK), tmp_path / "sweep.sqlite"
    over = {"contacts.friction": "lin:0.1:0.9:4"}
    progress = incipient.sweep.run(scene, file, over, do="judge", jobs=1)
    assert (progress.done, progress.failed) == (4, 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_a_worker_killed_at_random_loses_no_case(tmp_path: Path, seed: int) -> None:
    """Each of 40 cases is finished once; the one that was lost is begun once more."""
    voice, file, chance = Counted(), tmp_path / "sweep.sqlite", random.Random(seed)

    def kill() -> None:
        wait_for(file, "status = 'done'")
        time.sleep(chance.uniform(0.0, 0.5))
        os.kill(chance.choice(worker_processes(os.getpid(), 2)), signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    over = {"contacts.friction": "lin:0.1:0.9:40"}
    scene = written(tmp_path, LONG)
    progress = incipient.sweep.run(scene, file, over, do="judge", jobs=2, voice=voice)
    killer.join()
    assert (progress.done, progress.failed, voice.lines) == (40, 0, 40)
    assert set(rows(file, "status, reason")) == {("done", "")}
    assert Counter(rows(file, "tries")) in ({(1,): 39, (2,): 1}, {(1,): 40})
    assert not worker_processes(os.getpid())


@pytest.mark.slow
def test_a_case_whose_worker_dies_fails_with_its_reason_and_is_retried(
    tmp_path: Path, started: Any, said_by: Any
) -> None:
    scene, file = written(tmp_path, ENDLESS), tmp_path / "sweep.sqlite"
    call = order(scene, file, 1, "--jobs", 1, "--tries", 1)
    process = started(1, *call)
    (worker,) = worker_processes(process.pid, 1)
    time.sleep(4.0)
    os.kill(worker, signal.SIGKILL)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 4 and "0 computed, 1 failed" in said
    ((reason, tries),) = rows(file, "reason, tries", "status = 'failed'")
    assert "was killed, or a library has crashed" in reason and tries == 1
    assert "0 computed, 1 computed before" in said_by(*call)  # it is not tried again


@pytest.mark.slow
def test_others_go_on_beside_a_case_that_never_ends(tmp_path: Path) -> None:
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    how: dict[str, Any] = {"do": "judge", "jobs": 2}
    # Numba compiles in the first case of a checkout, which takes longer than the limit.
    incipient.sweep.run(scene, tmp_path / "first.sqlite", {"contacts.friction": [0.3]}, **how)
    over = {"errors.samples": [40, 1000000, 41, 42]}
    progress = incipient.sweep.run(scene, file, over, limit="15s", **how)
    assert (progress.done, progress.failed) == (3, 1)
    endless = ("failed", "was stopped: it took longer than 15 s")
    assert rows(file, "status, reason") == [("done", ""), endless, ("done", ""), ("done", "")]


@pytest.mark.slow
def test_a_case_that_takes_too_much_memory_fails_with_its_reason(tmp_path: Path) -> None:
    """A 2-D flow on coarse cells takes 246 MiB (`peak_mib`), of which 95% of 190 are allowed."""
    scene, file, over = (
        written(tmp_path, COARSE),
        tmp_path / "sweep.sqlite",
        {"fluid.reynolds": [1]},
    )
    assert incipient.sweep.run(scene, file, over, jobs=1, memory_mib=190.0, tries=2).failed == 1
    ((reason,),) = rows(file, "reason")
    assert "exceeded the memory of its worker; give fewer --jobs (tried 2 times)" in reason


def test_a_sweep_killed_in_the_middle_goes_on(tmp_path: Path, started: Any) -> None:
    """Its workers end with it, also those within a call of a library."""
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    call = order(scene, file, 8, "--jobs", 2)
    process = started(1, *call)
    wait_for(file, "status = 'done'")
    workers = worker_processes(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert workers and all(map(gone, workers))
    done = rows(file, "id, finished, result", "status = 'done'")
    assert done
    assert cli.main([str(word) for word in call]) == 0
    assert set(done) <= set(rows(file, "id, finished, result"))
    assert rows(file, "status, tries") == [("done", 1)] * 8


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_sweep_asked_to_end_leaves_no_process_and_keeps_what_is_done(
    tmp_path: Path, started: Any, number: int
) -> None:
    """Ctrl-C reaches all processes of the terminal, a batch system's SIGTERM the sweep alone."""
    table, file = tmp_path / "cases.csv", tmp_path / "sweep.sqlite"
    table.write_text("errors.samples\n40\n1000000\n999999\n")
    scene = written(tmp_path, LONG)
    call = ("sweep", scene, "--do", "judge", "--cases", table, "--out", file, "--jobs", 2)
    process = started(1, *call)
    wait_for(file, "status = 'done'")
    workers = worker_processes(process.pid, 2)
    (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 130 and all(map(gone, workers))
    lines = [line for line in complaint.splitlines() if "errors.samples" not in line]
    assert len(lines) == 1
    assert "interrupted: 1 of 3 cases are finished and kept in" in lines[0]
    assert [status for (status,) in rows(file, "status")] == ["done", "waiting", "waiting"]


def test_workers_that_an_interrupt_meets_while_they_start_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = list[str]()

    class Cluster(AbstractContextManager[Any]):
        def __init__(self, **_: Any):
            signal.raise_signal(signal.SIGINT)
            said.append("started")

        def __exit__(self, *_: object) -> None:
            said.append("closed")

    monkeypatch.setattr("distributed.LocalCluster", Cluster)
    with pytest.raises(KeyboardInterrupt), local_client(1, None):
        pass
    assert said == ["started", "closed"]


def test_processes_that_cannot_begin_end_the_sweep_and_fail_no_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What cannot even load its libraries, represented by a script, says nothing of a case."""
    scene, file, broken = written(tmp_path, QUICK), tmp_path / "sweep.sqlite", tmp_path / "python"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    resource_tracker.ensure_running()  # which outlives the sweep
    monkeypatch.setattr(spawn, "_python_exe", os.fsencode(broken))
    with pytest.raises(OutputError, match=r"no worker process starts: .*; free memory or give fe"):
        incipient.sweep.run(scene, file, {"contacts.friction": [0.1, 0.2]}, do="judge", jobs=1)
    assert rows(file, "status, tries") == [("waiting", 0)] * 2


@pytest.mark.slow
def test_the_time_is_kept(tmp_path: Path, command: Any) -> None:
    scene, file = written(tmp_path, ENDLESS), tmp_path / "sweep.sqlite"
    ended = command(*order(scene, file, 2, "--jobs", 1, "--wall", "2s"), code=130)
    assert "the time limit is reached: 0 of 2 cases are finished" in ended.stderr
    assert rows(file, "status, tries") == [("waiting", 0)] * 2


FREE_OF_GUARD = """
import sys
import incipient.sweep
incipient.sweep.run(sys.argv[1], sys.argv[2], {"contacts.friction": [0.1, 0.2]}, do="judge", jobs=1)
"""


@pytest.mark.slow
def test_a_script_without_a_main_guard_is_told_so(tmp_path: Path, mpirun: Any) -> None:
    scene, file = written(tmp_path, QUICK), tmp_path / "sweep.sqlite"
    ended = mpirun(1, FREE_OF_GUARD, scene, file, code=None)
    assert ended.returncode != 0
    assert 'put the calls of the script below `if __name__ == "__main__":`' in ended.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--over", "contacts.friction=0.1,-1"), "case 2 of 2"),
        (("--over", "contacts.friction=1,2", "--limit", "20x"), "--limit 20x: is not a time"),
        (("--over", "contacts.friction=1,2", "--ranks", "2"), "computes each case on one rank"),
        (("--executor", "dask://HOST:9"), "is now --scheduler; write --scheduler tcp://HOST:9"),
    ],
)
def test_wrong_sweeps_are_refused_in_one_line(
    arguments: tuple[str, ...], said: str, tmp_path: Path, said_by: Any
) -> None:
    file = tmp_path / "sweep.sqlite"
    complaint = said_by("sweep", CASE, "--do", "judge", "--out", file, *arguments, code=2)
    assert complaint.count("\n") == 1 and said in complaint
    assert not file.exists()


def test_ranks_of_mpirun_are_refused_in_one_line(tmp_path: Path, session: Any) -> None:
    sweep = order(written(tmp_path, QUICK), tmp_path / "sweep.sqlite", 2)
    for ended in session(2, [sweep, ["survey", "bed.toml"], ["cost", GRAIN_ON_BED]]):
        assert ended.codes == [2, 2]
        assert "it without mpirun" in ended.complaint


# -- clusters ---------------------------------------------------------------------------------------------------


@contextmanager
def scheduler(port: int) -> Iterator[None]:
    """A scheduler of Dask, killed at the end."""
    call = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    where = ["--host", "127.0.0.1", "--port", str(port)]
    quiet: dict[str, Any] = {"stderr": subprocess.DEVNULL, "start_new_session": True}
    process = subprocess.Popen([*call, *where], env=environment(), **quiet)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextmanager
def workers(directory: Path, port: int) -> Iterator[None]:
    """Two workers of Dask that start again when they end, as docs/howto/sweeps.md has them."""
    call = f"{sys.executable} -m distributed.cli.dask_worker tcp://127.0.0.1:{port}"
    loop = f"while true; do {call} --nthreads 1 --no-dashboard; sleep 0.3; done"
    quiet: dict[str, Any] = {"stderr": subprocess.PIPE, "start_new_session": True, "text": True}
    result = [
        subprocess.Popen(loop, shell=True, env=environment(), cwd=directory, **quiet)
        for _ in range(2)
    ]
    try:
        yield
    finally:
        for process in result:
            end(process)


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.mark.slow
def test_a_scheduler_that_goes_away_and_comes_back_loses_no_case(
    tmp_path: Path, started: Any
) -> None:
    port, scene, file = free_port(), written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    with workers(tmp_path, port):
        with scheduler(port):
            process = started(1, *order(scene, file, 40, "--scheduler", f"tcp://127.0.0.1:{port}"))
            wait_for(file, "status = 'done'")
        time.sleep(1.0)
        with scheduler(port):
            said, complaint = process.communicate(timeout=120)
    assert process.returncode == 0, complaint
    assert (
        "40 computed" in said
        and "the connection to the scheduler is lost; waiting for it" in complaint
    )
    assert rows(file, "status, tries") == [("done", 1)] * 40


@pytest.mark.slow
def test_workers_of_a_cluster_do_not_go_on_with_a_sweep_that_is_interrupted(
    tmp_path: Path, started: Any
) -> None:
    from distributed import Client

    port, scene, file = free_port(), written(tmp_path, ENDLESS), tmp_path / "sweep.sqlite"
    with workers(tmp_path, port), scheduler(port):
        process = started(1, *order(scene, file, 2, "--scheduler", f"127.0.0.1:{port}"))
        with Client(f"tcp://127.0.0.1:{port}", set_as_default=False) as client:
            until = time.monotonic() + 60.0
            while sum(map(len, client.processing().values())) < 2 and time.monotonic() < until:
                time.sleep(0.1)
            before = {pid for pid in client.run(os.getpid).values()}
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 130
            assert all(map(gone, before))
            assert not any(client.processing().values())
