"""Sweeps as they are used: computed once, killed and gone on with, failed and retried, shared, shown."""

from __future__ import annotations

import csv
import os
import re
import signal
import sqlite3
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import incipient.sweep
from incipient import cli
from incipient.sweep.procedure import SweepProgress, Watcher

CASE = Path(__file__).parents[2] / "demos" / "cases" / "disc_in_pocket.toml"
# A few hundredths of a second a case, or, with many samples, some tenths.
QUICK = CASE.read_text().partition("[errors]")[0]
LONG = QUICK + "[errors]\nflow_force = [0.06, 0.05]\nfriction = 0.05\nsamples = 40\n"
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


def rows(path: Path, what: str = "*", where: str = "1") -> list[tuple[Any, ...]]:
    with sqlite3.connect(path, timeout=60) as base:
        return base.execute(f"SELECT {what} FROM cases WHERE {where} ORDER BY rowid").fetchall()


def wait_for(path: Path, where: str) -> None:
    """Until a case is as wanted."""
    for _ in range(600):
        try:
            if path.exists() and rows(path, where=where):
                return
        except sqlite3.OperationalError:  # not made yet
            pass
        time.sleep(0.05)
    raise TimeoutError(where)


def children(process: int) -> list[int]:
    """Those of all its threads."""
    found = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):  # a thread that has just ended
            found += map(int, task.read_text().split())
    return found


def gone(process: int) -> bool:
    """Whether a process ends within 30 s: the kernel takes its time to end one that is busy, or that is starting."""
    end = time.monotonic() + 30.0
    while (there := Path(f"/proc/{process}/cwd").exists()) and time.monotonic() < end:
        time.sleep(0.01)
    return not there


def child(process: int) -> int:
    """The one child of a process, waited for: a case is said to run just before its process begins."""
    end = time.monotonic() + 30.0
    while not (found := children(process)) and time.monotonic() < end:
        time.sleep(0.01)
    (one,) = found
    return one


def ranks_of(mpirun: int) -> list[int]:
    """The ranks under an `mpirun`, waited for; MPICH's has one child, under which they are."""
    end = time.monotonic() + 30.0
    while len(found := children(mpirun)) < 2 and time.monotonic() < end:
        if len(found) == 1 and len(below := children(found[0])) == 2:
            return below
        time.sleep(0.01)
    return found


def test_thresholds_in_one_table_and_nothing_computed_twice(tmp_path: Path, capfd: Any) -> None:
    """In Stokes flow the critical Shields number does not hang on the shear rate that the scene begins with."""
    text = COARSE.replace("reynolds = 4.0\n", "").replace("density = 2.65\n", "")
    text = text.replace("[gravity]\nacceleration = 10.0\n", "[units]\ndiameter = 1e-4\n")
    scene, file = written(tmp_path, text), tmp_path / "sweep.sqlite"
    order = [
        "sweep",
        str(scene),
        "--over",
        "units.shear_rate=100,200",
        "--do",
        "threshold",
        "--jobs",
        "1",
    ]
    assert cli.main([*order, "--out", str(file), "--dry-run"]) == 0
    said = capfd.readouterr().out
    assert "2: 0 already in" in said and "MiB a case" in said and not file.exists()
    assert cli.main([*order, "--out", str(file)]) == 0
    found = incipient.sweep.rows(file)
    assert [row["units.shear_rate"] for row in found] == [100.0, 200.0]
    assert found[0]["shields"] == pytest.approx(found[1]["shields"], rel=1e-6)
    for row in (
        found
    ):  # tau = rho nu times the critical shear rate, over (rho_s - rho_f) g d = 1650 x 9.81 x 1e-4
        assert row["bed_stress_si"] == pytest.approx(1e-3 * row["shear_rate_si"])
        assert row["shields_nominal"] == pytest.approx(row["bed_stress_si"] / 1.61865)
    assert all("dolfinx" in row["versions"] and row["cpu"] > 0.0 for row in found)
    before = rows(file)
    assert cli.main([*order, "--out", str(file)]) == 0
    assert rows(file) == before
    assert "0 computed, 2 known before" in capfd.readouterr().out
    assert cli.main(["table", str(file), "--csv"]) == 0
    listed = list(csv.DictReader(capfd.readouterr().out.splitlines()))
    assert [float(row["shields"]) for row in listed] == [row["shields"] for row in found]
    assert cli.main(["show", str(file)]) == 0
    pictures = [Path(line) for line in capfd.readouterr().out.split()]
    assert [path.name for path in pictures] == ["sweep_shields.png", "sweep_threshold.png"]
    assert all(path.stat().st_size > 20_000 for path in pictures)
    assert cli.main(["show", str(file), "--quantity", "nonsense"]) == 5
    assert "has no column nonsense" in capfd.readouterr().err


def test_a_sweep_killed_in_the_middle_goes_on(tmp_path: Path, started: Any) -> None:
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    order = (
        "sweep",
        scene,
        "--do",
        "judge",
        "--over",
        FRICTION.format(6),
        "--out",
        file,
        "--jobs",
        2,
    )
    process = started(1, *order)
    wait_for(file, "status = 'done'")
    working = children(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert working and all(gone(one) for one in working)
    done = rows(file, "id, finished, result", "status = 'done'")
    assert done and len(done) < 6
    assert cli.main([str(word) for word in order]) == 0
    assert set(done) <= set(rows(file, "id, finished, result"))
    assert not rows(file, where="status != 'done'")
    assert all(
        tries == 1
        for (tries,) in rows(file, "tries", f"id IN {tuple(one[0] for one in (*done, ('',)))}")
    )


def test_a_killed_case_is_kept_with_its_reason_and_retried(
    tmp_path: Path, started: Any, capfd: Any
) -> None:
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    over = ("--over", FRICTION.format(3), "--out", file, "--jobs", 1)
    order = ("sweep", scene, "--do", "judge", *over, "--tries", 1)
    process = started(1, *order)
    wait_for(file, "status = 'running'")
    working = child(process.pid)
    os.kill(working, signal.SIGKILL)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 4 and "2 computed, 1 failed" in said
    ((reason,),) = rows(file, "reason", "status = 'failed'")
    assert "ended by signal 9" in reason
    again = [str(word) for word in order]
    cli.main(again)
    assert "0 computed" in capfd.readouterr().out  # it is not tried again
    assert cli.main([*again, "--retry"]) == 0
    assert "1 computed" in capfd.readouterr().out
    assert not rows(file, where="status != 'done' OR reason != ''")


def test_a_killed_rank_takes_its_case_alone(tmp_path: Path, started: Any) -> None:
    """Ranks of a case end together; those of the next one are started anew."""
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    order = ("--over", FRICTION.format(3), "--out", file, "--ranks", 2, "--jobs", 1, "--tries", 1)
    process = started(1, "sweep", scene, "--do", "judge", *order)
    wait_for(file, "status = 'done'")
    mpirun = child(process.pid)
    os.kill(ranks_of(mpirun)[0], signal.SIGKILL)
    said, wrong = process.communicate(timeout=60)
    assert process.returncode == 4 and "2 computed, 1 failed" in said, f"{said} {wrong}"
    ((reason,),) = rows(file, "reason", "status = 'failed'")
    # of a program that signal 9 has ended, by Open MPI and by MPICH
    assert re.search(r"its process ended with code (137|9)\b", reason)
    assert gone(mpirun)


def test_failed_cases_keep_their_reason(tmp_path: Path) -> None:
    """A grain that is lighter than the fluid has no threshold; the other is computed all the same."""
    file = tmp_path / "sweep.sqlite"
    scene = written(tmp_path, COARSE)
    progress = incipient.sweep.run(
        scene, file, {"body.density": [0.5, 2.65]}, do="threshold", jobs=1
    )
    assert (progress.failed, progress.done) == (1, 1)
    failed, done = incipient.sweep.rows(file)
    assert failed["status"] == "failed" and "a grain denser than the fluid" in failed["reason"]
    assert done["status"] == "done" and done["reason"] == ""


@pytest.mark.slow
def test_two_sweeps_on_one_file_share_the_cases(tmp_path: Path, started: Any) -> None:
    scene, file = written(tmp_path, LONG), tmp_path / "sweep.sqlite"
    order = (
        "sweep",
        scene,
        "--do",
        "judge",
        "--over",
        FRICTION.format(5),
        "--out",
        file,
        "--jobs",
        1,
    )
    both = [started(1, *order) for _ in range(2)]
    said = [process.communicate(timeout=120)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    computed = [int(text.split("computed")[0].split()[-1]) for text in said]
    assert sum(computed) == 5
    assert rows(file, "status, tries") == [("done", 1)] * 5


def test_ranks_compute_the_cases_of_one_sweep(tmp_path: Path, command: Any) -> None:
    scene, file = written(tmp_path, QUICK), tmp_path / "sweep.sqlite"
    order = ("sweep", scene, "--do", "judge", "--over", FRICTION.format(5), "--out", file)
    done = command(*order, ranks=3)
    assert done.returncode == 0, done.stderr
    assert rows(file, "status, tries") == [("done", 1)] * 5
    few = command(*order, "--ranks", 2, ranks=2)
    assert (
        few.returncode == 2
        and few.stderr.count("incipient: ") == 1
        and "start 3 or more" in few.stderr
    )


@pytest.mark.parametrize(
    ("ranks", "task", "more"),
    [
        (2, "run", ()),
        (3, "threshold", ("--ranks", 2)),
        pytest.param(3, "run", (), marks=pytest.mark.slow),
        pytest.param(2, "threshold", (), marks=pytest.mark.slow),
        pytest.param(3, "run", ("--ranks", 2), marks=pytest.mark.slow),
    ],
)
def test_ranks_compute_flows_in_a_sweep(
    tmp_path: Path, command: Any, ranks: int, task: str, more: tuple[object, ...]
) -> None:
    """PETSc starts on all ranks together, also on the first, which computes no flow: the others waited for it."""
    file = tmp_path / "sweep.sqlite"
    order = (
        "sweep",
        written(tmp_path, COARSE),
        "--do",
        task,
        "--over",
        "fluid.reynolds=1,2",
        "--out",
        file,
    )
    done = command(*order, *more, ranks=ranks, timeout=120)
    assert done.returncode == 0, done.stderr
    assert rows(file, "status, tries") == [("done", 1)] * 2


class Crowded(Watcher):
    """Notes how many cases were computed at a time."""

    most = 0

    def look(self, progress: SweepProgress) -> None:
        self.most = max(self.most, len(progress.running))

    def finished(self, case: Any, outcome: Any, progress: SweepProgress) -> None:
        self.most = max(self.most, len(progress.running) + 1)


@pytest.mark.slow
def test_memory_limits_how_many_cases_go_at_a_time(tmp_path: Path) -> None:
    scene, over = written(tmp_path, QUICK), {"contacts.friction": "lin:0.1:0.9:6"}
    most = {}
    for memory in (200.0, 1000.0):
        watcher = Crowded()
        file = tmp_path / f"{memory:g}.sqlite"
        incipient.sweep.run(
            scene, file, over, do="judge", jobs=2, memory_mib=memory, watcher=watcher
        )
        most[memory] = watcher.most
    assert most == {200.0: 1, 1000.0: 2}
    progress = incipient.sweep.run(
        scene, tmp_path / "none.sqlite", over, do="judge", memory_mib=10.0
    )
    assert progress.failed == 6
    assert (
        "needs about 150 MiB of memory, and 10 are free"
        in rows(tmp_path / "none.sqlite", "reason")[0][0]
    )


def test_the_time_is_kept(tmp_path: Path, command: Any) -> None:
    scene, file = (
        written(tmp_path, LONG.replace("samples = 40", "samples = 1000000")),
        tmp_path / "sweep.sqlite",
    )
    order = (
        "sweep",
        scene,
        "--do",
        "judge",
        "--over",
        FRICTION.format(2),
        "--out",
        file,
        "--jobs",
        1,
    )
    ended = command(*order, "--wall", "2s")
    assert ended.returncode == 130 and "the time is up: 0 of 2 cases are finished" in ended.stderr
    assert rows(file, "status, tries") == [("waiting", 0)] * 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--over", "contacts.friction=0.1,-1"), "case 2 of 2"),
        (("--over", "contacts.nothing=1,2"), "unknown key"),
        (("--over", "contacts.friction"), "is not a key with values"),
        (("--over", "contacts.friction=1,2", "--wall", "soon"), "is not a time"),
        (("--over", "contacts.friction=1,2", "--jobs", "0"), "--jobs 0: is not above zero"),
        (("--cases", "absent.csv"), "absent.csv: cannot be read"),
        ((), "nothing is varied"),
    ],
)
def test_wrong_sweeps_are_refused_in_one_line(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: Any
) -> None:
    file = tmp_path / "sweep.sqlite"
    code = cli.main(["sweep", str(CASE), "--do", "judge", "--out", str(file), *arguments])
    complaint = capsys.readouterr().err
    assert code == 2 and complaint.count("\n") == 1 and said in complaint
    assert not file.exists()
