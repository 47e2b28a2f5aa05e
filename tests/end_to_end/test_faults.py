"""What may happen to long work: killed at any moment, asked to end, two at once, no room left on the disk."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import environment, finished
from mpi4py import MPI
from processes import VORTEX_STREET, result_of, settings
from test_sweeps import COARSE, FRICTION, LONG, QUICK, order, rows, written

from incipient.errors import OutputError

TIMES = 20
SAME = 1e-12


def killed(start: Callable[[], subprocess.Popen[str]], moment: float) -> bool:
    """Whether a process is killed at a moment [s] after its start; False: it had ended by then, as it should."""
    process = start()
    try:
        _, complaint = process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    assert process.returncode == 0, complaint
    return False


def numbers(stored: Any, path: str = "") -> dict[str, float]:
    """All numbers of a result by their place, but for what it cost."""
    if isinstance(stored, dict):
        parts = [(name, part) for name, part in stored.items() if name not in ("cost", "versions")]
    else:
        parts = list(enumerate(stored)) if isinstance(stored, list) else []
    found = {path: float(stored)} if isinstance(stored, int | float) else {}
    for name, part in parts:
        found |= numbers(part, f"{path}.{name}")
    return found


def assert_same_numbers(one: Any, other: Any) -> None:
    mine, theirs = numbers(one), numbers(other)
    assert mine.keys() == theirs.keys()
    size = max(map(abs, theirs.values()))
    assert {
        key: value for key, value in mine.items() if abs(value - theirs[key]) > SAME * size
    } == {}


def assert_same_sweep(file: Path, whole: Path) -> None:
    """The same cases, all done, with the same results."""
    one, other = (
        {row[0]: row[1:] for row in rows(path, "id, status, result")} for path in (file, whole)
    )
    assert one.keys() == other.keys()
    for identity, (status, result) in one.items():
        assert status == "done"
        assert_same_numbers(json.loads(result), json.loads(other[identity][1]))


def is_complete(directory: Path) -> bool:
    """Whether a run has left its whole result."""
    return (directory / "result.json").exists() and result_of(directory)["status"] == "complete"


@pytest.mark.slow
def test_a_refined_sweep_killed_at_random_goes_on_to_the_same_cases(
    tmp_path: Path, started: Any, command: Any
) -> None:
    scene, whole, file = (
        written(tmp_path, LONG),
        tmp_path / "whole.sqlite",
        tmp_path / "sweep.sqlite",
    )
    order = (
        "sweep",
        scene,
        "--do",
        "judge",
        "--over",
        FRICTION.format(4),
        "--refine",
        0.02,
        "--jobs",
        2,
    )
    began = time.monotonic()
    assert command(*order, "--out", whole, timeout=120).returncode == 0
    length, rng = time.monotonic() - began, np.random.default_rng(7)
    cut = sum(
        killed(lambda: started(1, *order, "--out", file), rng.uniform(0.0, length))
        for _ in range(TIMES)
    )
    assert cut > 0
    assert command(*order, "--out", file, timeout=120).returncode == 0
    assert_same_sweep(file, whole)


@pytest.mark.slow
def test_a_sweep_of_flows_killed_at_random(tmp_path: Path, started: Any, command: Any) -> None:
    scene, whole, file = (
        written(tmp_path, COARSE),
        tmp_path / "whole.sqlite",
        tmp_path / "sweep.sqlite",
    )
    order = (
        "sweep",
        scene,
        "--over",
        "body.diameter=0.8,1.0,1.2",
        "--do",
        "threshold",
        "--jobs",
        1,
    )
    began = time.monotonic()
    assert command(*order, "--out", whole, timeout=120).returncode == 0
    length, rng = time.monotonic() - began, np.random.default_rng(9)
    for _ in range(TIMES // 4):
        killed(lambda: started(1, *order, "--out", file), rng.uniform(0.0, length))
    assert command(*order, "--out", file, timeout=120).returncode == 0
    assert_same_sweep(file, whole)


@pytest.mark.slow
def test_a_run_killed_at_random_and_resumed(tmp_path: Path, started: Any, command: Any) -> None:
    """Steps of fixed length, solved to round-off, with a checkpoint after each."""
    steps = settings(
        numerics_order=2, numerics_mesh_size=4, time_end=0.6, time_step=0.01, output_checkpoint=1
    )
    exact = settings(numerics_error_bars=False, numerics_tolerance=1e-13)
    whole, target = tmp_path / "whole", tmp_path / "run"
    order = ("run", VORTEX_STREET, *steps, *exact)
    began = time.monotonic()
    assert command(*order, "--out", whole, timeout=120).returncode == 0
    length, rng = time.monotonic() - began, np.random.default_rng(10)

    def further() -> tuple[object, ...]:
        return (
            ("resume", target) if (target / "checkpoint.h5").exists() else (*order, "--out", target)
        )

    resumed = 0
    for _ in range(TIMES):
        resumed += further()[0] == "resume"
        killed(lambda: started(1, *further()), rng.uniform(0.0, 0.7 * length))
        if is_complete(target):  # once more from the start
            shutil.rmtree(target)
    assert resumed > 0
    last = command(*further(), timeout=120)
    assert last.returncode == 0, last.stderr
    one, other = (result_of(directory) for directory in (target, whole))
    for name in ("force", "torque", "coefficients"):
        assert_same_numbers(one[name], other[name])


FULL = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
from incipient.cli import main
sys.exit(main(sys.argv[1:]))
"""


def test_a_full_disk_ends_a_sweep_in_one_line_and_keeps_what_there_is(
    tmp_path: Path, command: Any
) -> None:
    """A limit on the size of files stands for the disk; the file has room for some of the results."""
    scene, file = written(tmp_path, QUICK), tmp_path / "sweep.sqlite"
    call = order(scene, file, 12, "--jobs", 1)
    if "MPICH" in MPI.Get_library_version():
        pytest.skip("the memory that MPICH's ranks share is a file, which the limit holds for, too")
    full = finished([sys.executable, "-c", FULL, *call], 120, env=environment(), cwd=tmp_path)
    assert full.returncode == 5 and full.stderr.count("incipient: ") == 1
    assert (
        f"{file}: " in full.stderr
        and "free some space" in full.stderr
        and "Traceback" not in full.stderr
    )
    done = rows(file, "id, result", "status = 'done'")
    assert 0 < len(done) < 12
    again = command(*call)
    assert again.returncode == 0, again.stderr
    assert (
        set(done) <= set(rows(file, "id, result"))
        and len(rows(file, where="status = 'done'")) == 12
    )


# -- compilation of forms ------------------------------------------------------------------------------------

FEW_FORMS = settings(fluid_inertia=False, numerics_order=2, numerics_mesh_size=4)
CAVITY = Path(__file__).parents[2] / "demos" / "scenes" / "cavity.toml"


@pytest.mark.slow
@pytest.mark.parametrize("times", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_a_first_run_killed_at_random_does_not_block_the_next(
    tmp_path: Path, started: Any, command: Any, times: int
) -> None:
    """By SIGKILL, as batch systems do, or SIGHUP of a terminal that has gone, while its forms are compiled."""
    random, cache = np.random.default_rng(11), {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    scene = ["run", CAVITY, *FEW_FORMS, "--out", tmp_path / "x"]
    for number in range(times):
        run = started(1, *scene, **cache)
        time.sleep(random.uniform(0.8, 4.0))
        os.killpg(run.pid, (signal.SIGKILL, signal.SIGHUP)[number % 2])
        said = run.communicate()[1]
        assert (
            run.returncode in (0, -signal.SIGKILL, -signal.SIGHUP) and "PETSC ERROR" not in said
        ), said
    again = command(*scene, **cache)
    assert again.returncode == 0 and "timed out" not in again.stderr, again.stderr
    left = [path for path in (tmp_path / "cache/fenics/incipient").iterdir() if "." in path.name]
    assert left == [], "folders of compilations that were cut short"


@pytest.mark.slow
def test_two_first_runs_at_once_are_right(tmp_path: Path, started: Any) -> None:
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    both = [
        started(1, "run", CAVITY, *FEW_FORMS, "--out", tmp_path / name, **cache) for name in "xy"
    ]
    said = [run.communicate(timeout=120)[1] for run in both]
    assert [run.returncode for run in both] == [0, 0], said
    assert_same_numbers(
        result_of(tmp_path / "x")["centrelines"], result_of(tmp_path / "y")["centrelines"]
    )


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_cache_that_cannot_be_written_is_named_in_one_line(
    tmp_path: Path, command: Any, monkeypatch: Any, ranks: int
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/cache")
    done = command("run", CAVITY, *FEW_FORMS, "--out", tmp_path / "x", ranks=ranks)
    assert done.returncode == OutputError.exit_code, done.stderr
    last = done.stderr.strip().splitlines()[-1] if ranks == 1 else done.stderr
    assert last.count("incipient: /proc/cache/fenics/incipient: compiled forms cannot be kept") == 1
    assert "Traceback" not in done.stderr
