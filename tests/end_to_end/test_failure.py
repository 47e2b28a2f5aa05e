"""Failures and faults: interrupts, kills, full disks, missing libraries."""

from __future__ import annotations

import ctypes
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import psutil
import pytest
from conftest import Session
from environment import environment, finished, on_ranks
from mpi4py import MPI
from processes import (
    CAVITY,
    GRAIN_ON_BED,
    VORTEX_STREET,
    Finished,
    Outcome,
    result_of,
    settings,
)
from scenes import CASES, history_of

import incipient
from incipient import MissingError
from incipient.cli import main
from incipient.errors import ConvergenceError, MeshError, OutputError
from incipient.files import MARK
from incipient.installed import MODULES, required
from incipient.output.series_file import read_step, times
from incipient.output.xdmf import FieldSeries
from incipient.restart import read

# Interrupts, divergence, impossible meshes and full disks: one line, an exit code, no hang, nothing lost.


STEP = 0.005
LONG = [
    "run",
    str(VORTEX_STREET),
    *settings(
        numerics_order=2, numerics_mesh_size=3, time_step=STEP, time_end=100.0, output_every=1
    ),
]
HANGING = 60.0  # seconds after which a run counts as hanging


# -- what must stay readable ---------------------------------------------------------------------------------


def times_of(stem, killed=False):
    """Times of a series; every number of its steps is finite.

    They are those of its XDMF file, which is written after a step: a run that is `killed` may end between both.
    """
    written = times(stem)
    index = ElementTree.parse(stem.with_suffix(".xdmf")).iter("Time")
    listed = [float(time.get("Value")) for time in index]
    assert listed == written or (killed and listed == written[:-1])
    for number in range(len(written)):
        step = read_step(stem, number)
        assert all(np.isfinite(part).all() for part in (step.points, *step.fields.values()))
    return written


def assert_all_kept(directory, killed=False):
    """History and fields reach to the last step; the fields may be one behind, in which the end came."""
    times = history_of(directory)["time"]  # whose rows are all complete
    assert times == pytest.approx(STEP * np.arange(1, len(times) + 1))
    for name in ("fields", "surface"):
        stored = times_of(directory / name, killed)
        assert len(stored) >= len(times) - 1 and stored == pytest.approx(times[: len(stored)])
    return len(times)


# -- interrupts ----------------------------------------------------------------------------------------------


def wait_until(ready, run):
    deadline = time.monotonic() + HANGING
    while not ready():
        assert run.poll() is None, run.communicate()[1]
        assert time.monotonic() < deadline, "the run does not come to the point"
        time.sleep(0.01)


def has_rows(directory, number):
    path = directory / "history.csv"
    return lambda: path.exists() and path.read_bytes().count(b"\n") > number


def ended(run):
    """Exit code and lines; a run that does not end in time fails here."""
    _, said = run.communicate(timeout=HANGING)
    return Outcome([run.returncode], said.splitlines())


@pytest.mark.parametrize(
    ("ranks", "number"),
    [
        (1, signal.SIGINT),
        (2, signal.SIGTERM),
        pytest.param(1, signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(2, signal.SIGINT, marks=pytest.mark.slow),
    ],
)
def test_an_interrupted_run_ends_at_once_and_keeps_everything(started, tmp_path, ranks, number):
    run = started(ranks, *LONG, "--out", tmp_path)
    wait_until(has_rows(tmp_path, 5), run)
    os.killpg(run.pid, number)
    outcome = ended(run)
    # Rank 0 speaks for all; waiting inside MPI for the other rank it may be ended before it can.
    if ranks == 1 or any(line.startswith("incipient: ") for line in outcome.lines):
        assert outcome.complaint.startswith("interrupted at t = ")
        assert outcome.complaint.endswith(f"; resume with: incipient resume {tmp_path}")
    assert not any("Traceback" in line for line in outcome.lines)
    # Open MPI's mpirun ends with 1 when the signal was for itself, whatever its ranks say; MPICH's with their code.
    by_itself = ranks == 2 and "Open MPI" in MPI.Get_library_version()
    assert outcome.codes == [1 if by_itself else 130]
    # mpirun kills its ranks a second after it has passed the signal on, whatever they are doing: on a busy machine also
    # between a step's file and its entry in the index.
    assert assert_all_kept(tmp_path, killed=ranks == 2) >= 5
    assert ranks == 2 or not list(tmp_path.glob("*.part"))


def test_a_signal_to_one_rank_ends_both(started, tmp_path):
    run = started(2, *LONG, "--out", tmp_path)
    wait_until(has_rows(tmp_path, 3), run)
    # MPICH's mpirun has another program between itself and its ranks.
    below = psutil.Process(run.pid).children(recursive=True)
    ranks = [process for process in below if Path(process.exe()).samefile(sys.executable)]
    ranks[-1].terminate()
    _, said = run.communicate(timeout=HANGING)
    assert run.returncode == 130 and "Traceback" not in said
    assert f"; resume with: incipient resume {tmp_path}\n" in said
    kept = read(tmp_path / "checkpoint.h5", MPI.COMM_SELF)
    assert kept.progress["number"] == assert_all_kept(tmp_path)


def test_a_second_run_into_a_directory_is_refused(started, tmp_path, said_by):
    """The first goes on as if nothing were; when it has been killed, another may run there."""
    run = started(1, *LONG, "--out", tmp_path)
    wait_until(has_rows(tmp_path, 2), run)
    refused = f"incipient: {tmp_path}: another run is using it (process {run.pid} on "
    for words in (["run", str(CAVITY), "--overwrite", "--out"], ["resume"]):
        assert said_by(*words, tmp_path, "--log-level", "error", code=5).startswith(refused)
    rows = len(history_of(tmp_path))
    wait_until(has_rows(tmp_path, rows + 1), run)
    run.kill()
    run.communicate()
    assert assert_all_kept(tmp_path, killed=True) > rows
    small = settings(numerics_order=2, numerics_mesh_size=6)
    assert main(["run", str(CAVITY), *small, "--out", str(tmp_path)]) == 0
    names = {MARK, "scene.toml", "result.json", "fields.xdmf", "fields"}
    assert {path.name for path in tmp_path.iterdir()} == names


# -- error bars that are not computed --------------------------------------------------------------------------

# On a fine mesh the error bars take seconds; so they do where a verdict is to be decided.
FINE = settings(numerics_order=3, numerics_mesh_size=0.5)
DECIDING = settings(numerics_accuracy="verdict", gravity_acceleration=1.98)


def is_provisional(directory):
    path = directory / "result.json"
    return lambda: path.exists() and result_of(directory)["without_error_bars"] != ""


@pytest.mark.parametrize(
    ("options", "ranks", "number"),
    [
        pytest.param(FINE, 1, signal.SIGINT, marks=pytest.mark.slow),
        (FINE, 2, signal.SIGINT),
        (DECIDING, 1, signal.SIGTERM),
        pytest.param(FINE, 1, signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(DECIDING, 1, signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(DECIDING, 2, signal.SIGINT, marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_in_the_error_bars_keeps_the_verdict(
    started, tmp_path, ranks, number, options
):
    run = started(ranks, "run", GRAIN_ON_BED, *options, "--out", tmp_path)
    wait_until(is_provisional(tmp_path), run)
    os.killpg(run.pid, number)
    outcome = ended(run)
    if ranks == 1:
        # Python itself ends by the signal where that came within a call of `exec`, whatever was made of it.
        assert outcome.codes[0] in (130, -signal.SIGINT)
        kept = f"the result without them is kept in {tmp_path}"
        # The other is said of the moment between the result without them and their beginning.
        said = (
            f"interrupted while the error bars were computed; {kept}",
            "interrupted; what was computed so far is kept",
        )
        assert outcome.complaint in said
    assert not any("Traceback" in line for line in outcome.lines)
    result = result_of(tmp_path)
    assert result["status"] == "complete" and result["verdict"]["sentence"]
    assert result["error_bars"] is None
    assert (
        result["without_error_bars"]
        == "not computed: the run has not finished, or was stopped before"
    )
    assert times_of(tmp_path / "fields") == [0.0]


def test_error_bars_that_fail_are_said_to_and_the_rest_is_there(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ConvergenceError("no dual solution found")

    monkeypatch.setattr("incipient.accuracy.errorbars.error_bars", fail)
    result = incipient.run(incipient.load(GRAIN_ON_BED, ["numerics.mesh_size=3"]), tmp_path)
    assert result.verdict is not None and result.error_bars is None
    assert "\nerror bars          not computed: no dual solution found\n" in result.text()
    assert result_of(tmp_path)["without_error_bars"] == "not computed: no dual solution found"


def test_a_budget_spent_before_the_error_bars_keeps_the_verdict(tmp_path):
    """Coarse runs are not begun any more; the verdict then does not count as decided."""
    options = ["numerics.accuracy='verdict'", "numerics.budget_seconds=0.001"]
    incipient.run(incipient.load(GRAIN_ON_BED, options), tmp_path)
    result, spent = result_of(tmp_path), "numerics.budget_seconds = 0.001 is spent"
    assert result["error_bars"]["failed"] == {"gap": spent, "domain": spent}
    assert [term["name"] for term in result["error_bars"]["terms"]] == ["discretisation"]
    assert result["verdict"]["moves"] and not result["adaptation"]["met"]
    assert result["adaptation"]["reason"].startswith("undecided: certain except for unknown errors")


# -- no mesh, no convergence -----------------------------------------------------------------------------------


def contents(directory):
    """Of all files, but for the list of who has worked there."""
    files = [path for path in directory.rglob("*") if path.is_file() and path.name != MARK]
    return {path: path.read_bytes() for path in files}


def test_a_run_without_a_mesh_leaves_the_earlier_one(tmp_path):
    incipient.run(
        incipient.load(GRAIN_ON_BED, ["numerics.mesh_size=6", "numerics.error_bars=false"]),
        tmp_path,
    )
    before = contents(tmp_path)
    with pytest.raises(MeshError):
        incipient.run(incipient.load(GRAIN_ON_BED, ["contact.gap=1e-12"]), tmp_path, overwrite=True)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_meshes_that_cannot_be_made_and_flows_that_are_not_found(session: Session, tmp_path, ranks):
    hard = settings(
        fluid_reynolds=1000.0, numerics_order=2, numerics_mesh_size=8, numerics_max_iterations=1
    )
    touching, lost = session(
        ranks,
        [
            ["plan", GRAIN_ON_BED, *settings(contact_gap=1e-12)],
            ["run", CAVITY, *hard, "--out", "x"],
        ],
    )
    assert touching.codes == [3] * ranks and lost.codes == [4] * ranks
    assert touching.complaint.startswith("the geometry could not be meshed: ")
    assert "narrow passages such as contact.gap wider" in touching.complaint
    assert lost.complaint.startswith("no steady flow beyond")
    result = result_of(tmp_path / "x")
    assert result["status"] == "failed" and result["error"] == lost.complaint
    assert result["cost"]["unknowns"] > 0 and result["verdict"] is None


# -- no space ------------------------------------------------------------------------------------------------


def test_a_full_disk_keeps_the_steps_before(tmp_path, monkeypatch, capsys):
    """Full from the fourth step on: the error is that of the fields, not that of result.json, which has no room."""
    write, unlimited = FieldSeries.write, resource.getrlimit(resource.RLIMIT_FSIZE)

    def filling(self, time, fields):
        if time > 3.5 * STEP:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, unlimited[1]))
        write(self, time, fields)

    monkeypatch.setattr(FieldSeries, "write", filling)
    steps = settings(
        numerics_order=2, numerics_mesh_size=6, time_end=60 * STEP, time_step=STEP, output_every=1
    )
    try:
        assert main(["run", str(VORTEX_STREET), *steps, "--out", str(tmp_path)]) == 5
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    assert assert_all_kept(tmp_path) == 4 and not (tmp_path / "result.json").exists()
    why = f"{tmp_path}/fields/000003.h5: cannot be written: file too large; raise the limit"
    assert f"incipient: {why}" in capsys.readouterr().err


WHILE_GMSH_STARTS = """
import os, signal, threading, time
from incipient.interrupt import handlers_kept
signal.signal(signal.SIGINT, signal.default_int_handler)  # also where a shell in the background ignores it
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()  # as MPI has; signals reach it, too
try:
    with handlers_kept():
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # as gmsh does first when it is imported
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1)
except KeyboardInterrupt:
    print("told")
"""


IN_THREADS = """
import signal, threading
import incipient
from incipient.scene import example, loads
before = signal.getsignal(signal.SIGINT), signal.signal
settings = ["numerics.error_bars=false", "effects.inertia=false"]
scenes = [loads(example(), overrides=[*settings, f"numerics.mesh_size={size}"]) for size in (5, 6, 7)]
found = {}
def compute(place):
    found[place] = incipient.run(scenes[place]).force.flow[0]
threads = [threading.Thread(target=compute, args=(place,)) for place in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert (signal.getsignal(signal.SIGINT), signal.signal) == before
assert [found[place] for place in range(3)] == [incipient.run(one).force.flow[0] for one in scenes]
print("told")
"""


@pytest.mark.parametrize("script", [WHILE_GMSH_STARTS, IN_THREADS], ids=["gmsh", "threads"])
def test_threads_and_starting_libraries_leave_signals_as_they_were(script: str) -> None:
    """An interrupt while gmsh starts is told; three scenes in threads of a fresh process, which load the libraries
    there, have the forces that they have in turn, to the last bit."""
    ended = finished([sys.executable, "-c", script], 240, env=environment())
    assert ended.stdout == "told\n", ended.stderr


IN_THREADS_OF_RANKS = """
import threading
import incipient
from mpi4py import MPI
from incipient.scene import example, loads
settings = ["numerics.error_bars=false", "effects.inertia=false"]
scenes = [loads(example(), overrides=[*settings, f"numerics.mesh_size={size}"]) for size in (5, 6)]
comm, found = MPI.COMM_WORLD, {}
def compute(place, comm):
    try:
        found[place] = incipient.run(scenes[place], comm=comm).force.flow[0]
    except incipient.IncipientError as error:
        found[place] = str(error)
for ranks in (None, comm.Dup(), MPI.COMM_SELF):
    # each rank begins with another scene
    threads = [threading.Thread(target=compute, args=(k, ranks)) for k in (comm.rank, 1 - comm.rank)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if ranks == MPI.COMM_SELF:
        assert [found[k] for k in (0, 1)] == [incipient.run(one, comm=ranks).force.flow[0] for one in scenes]
    else:
        assert all("called in a thread, where ranks cannot synchronise" in found[k] for k in (0, 1)), found
together = [incipient.run(one).force.flow[0] for one in scenes]
assert all(abs(together[k] / found[k] - 1.0) < 1e-9 for k in (0, 1))
"""


@pytest.mark.slow
def test_threads_of_several_ranks_compute_each_for_themselves_alone(mpirun) -> None:
    """What waited for ever: one rank in one scene's collective calls, the other in those of the other scene."""
    mpirun(2, IN_THREADS_OF_RANKS, timeout=240)


# -- errors of one rank ----------------------------------------------------------------------------------------

ALONE = """
import sys
from mpi4py import MPI
from incipient import cli
from incipient.commands import runs
from incipient.errors import ConvergenceError

def fails(options, comm):
    if comm.rank == int(sys.argv[1]):
        raise ConvergenceError("no flow found")
    if sys.argv[2] == "waits":
        comm.barrier()
    return 0

cli.TO_COME = 1.0
runs.run = fails
raise SystemExit(cli.main(["run", "scene.toml"]))
"""


@pytest.mark.parametrize(("rank", "others"), [(1, "waits"), (1, "ends"), (0, "waits"), (0, "ends")])
def test_an_error_of_one_rank_is_said(mpirun, rank, others):
    """Its text had been lost where the first rank had none: the code alone was seen, or mpirun's own words."""
    done = mpirun(2, ALONE, rank, others, timeout=60, code=None)
    assert done.returncode != 0
    assert done.stderr.count("no flow found") == 1
    assert (f"incipient: on rank {rank} alone: no flow" in done.stderr) == (others == "waits")


# What may happen to long work: killed at any moment, asked to end, two at once, no room left on the disk.


TIMES = 20
SAME, NUMBER = 1e-12, re.compile(r"-?\b\d+(?:\.\d+)?(?:e[-+]?\d+)?")  # of JSON


def killed(start: Callable[[], subprocess.Popen[str]], moment: float) -> bool:
    """Whether a process is killed at a moment [s] after its start; False: it had ended by then, as it should.

    A process killed after its last checkpoint, which follows the result, leaves nothing to resume.
    """
    process = start()
    try:
        _, complaint = process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    assert process.returncode == 0 or "the run has already reached" in complaint, complaint
    return False


def assert_same_numbers(one: Any, other: Any) -> None:
    mine, theirs = (
        np.array(NUMBER.findall(json.dumps(data)), dtype=float) for data in (one, other)
    )
    assert mine == pytest.approx(theirs, rel=0.0, abs=SAME * np.abs(theirs).max())


@pytest.mark.slow
def test_a_run_killed_at_random_and_resumed(tmp_path: Path, started: Any, command: Any) -> None:
    """Steps of fixed length, solved to round-off, with a checkpoint after each."""
    steps = settings(
        numerics_order=2, numerics_mesh_size=4, time_end=0.6, time_step=0.01, output_checkpoint=1
    )
    exact = settings(numerics_error_bars=False, numerics_tolerance=1e-13)
    whole, target = tmp_path / "whole", tmp_path / "run"
    order, began = ("run", VORTEX_STREET, *steps, *exact), time.monotonic()
    command(*order, "--out", whole, timeout=120)
    length, rng = time.monotonic() - began, np.random.default_rng(10)
    run = started(1, *order, "--out", target)
    wait_until((target / "checkpoint.h5").exists, run)
    run.kill()
    run.communicate()
    for _ in range(TIMES):
        if not killed(lambda: started(1, "resume", target), rng.uniform(0.0, 0.7 * length)):
            break
    else:
        command("resume", target, timeout=120)
    one, other = (result_of(directory) for directory in (target, whole))
    for name in ("force", "torque", "coefficients"):
        assert_same_numbers(one[name], other[name])


# -- compilation of forms ------------------------------------------------------------------------------------

FEW_FORMS = settings(fluid_inertia=False, numerics_order=2, numerics_mesh_size=4)


@pytest.mark.parametrize(
    "signals",
    [
        (signal.SIGINT,),
        pytest.param((signal.SIGKILL, signal.SIGHUP) * 10, marks=pytest.mark.slow),
    ],
    ids=["interrupted", "killed"],
)
def test_a_first_run_that_ends_while_forms_compile_does_not_block_the_next(
    tmp_path: Path, started: Any, command: Any, signals: Sequence[int]
) -> None:
    """By Ctrl-C, by SIGKILL, as batch systems do, or SIGHUP of a terminal that has gone.

    The form compiler marks a form as begun; left behind, the mark would make later runs wait and fail.
    """
    random, cache = np.random.default_rng(11), {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    scene = ["run", CAVITY, *FEW_FORMS, "--out", tmp_path / "x"]
    for number in signals:
        run = started(1, *scene, **cache)
        if len(signals) == 1:
            wait_until(lambda: list(tmp_path.glob("cache/fenics/incipient/*.*/*.c")), run)
        time.sleep(0.1 if len(signals) == 1 else random.uniform(0.8, 4.0))
        os.killpg(run.pid, number)
        said = run.communicate(timeout=HANGING)[1]
        assert run.returncode in (0, -number, 128 + number) and "PETSC ERROR" not in said, said
    for path in tmp_path.glob("cache/fenics/incipient/*.*"):
        os.utime(path, (0.0, 0.0))  # of hours ago: a newer one may be another process's
    again = command(*scene, **cache)
    assert not any(words in again.stderr for words in ("timed out", "gcc", "running build"))
    # Whatever is compiled next, here with inertia, removes what was left.
    command(*scene, *settings(fluid_inertia=True), **cache)
    left = [path for path in (tmp_path / "cache/fenics/incipient").iterdir() if "." in path.name]
    assert left == [], "folders of compilations that were cut short"


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_cache_that_cannot_be_written_is_named_in_one_line(
    tmp_path: Path, command: Any, monkeypatch: Any, ranks: int
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/cache")
    order = ("run", CAVITY, *FEW_FORMS, "--out", tmp_path / "x")
    done = command(*order, ranks=ranks, code=OutputError.exit_code)
    last = done.stderr.strip().splitlines()[-1] if ranks == 1 else done.stderr
    assert last.count("incipient: /proc/cache/fenics/incipient: compiled forms cannot be kept") == 1
    assert "Traceback" not in done.stderr


# Where mpi4py, dolfinx or what they need, is not installed: what can be done is done, the rest named.


COARSE_OF_MISSING = settings(numerics_order=2, numerics_mesh_size=4)
# The command where some modules cannot be found.
WITHOUT = """
import sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Finder())
from incipient.cli import main
raise SystemExit(main(sys.argv[2:]))
"""


def without(
    modules: str, *arguments: object, ranks: int = 1, code: int = 0, **variables: str
) -> Finished[str]:
    """`incipient ARGUMENTS` in a process, or ranks, of its own that cannot find the modules."""
    start = [*(on_ranks(ranks) if ranks > 1 else []), sys.executable, "-c", WITHOUT, modules]
    return finished([*start, *arguments], 120, code, env=environment() | variables)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--help"], "judge forces from another program"),
        (["plan", GRAIN_ON_BED], "memory are not known: gmsh is not installed"),
        (["judge", CASES / "disc_in_pocket.toml"], "The grain stays at rest"),
        (["schema"], '"properties"'),
    ],
    ids=lambda value: value[0].strip("-") if isinstance(value, list) else "",
)
def test_what_needs_no_flow_works_without_its_libraries(arguments: list[object], said: str) -> None:
    assert said in without(",".join(MODULES), *arguments).stdout


@pytest.mark.parametrize(
    ("module", "ranks"),
    [
        *((module, 1) for module in ("mpi4py", "dolfinx", "h5py", "gmsh")),
        pytest.param("gmsh", 2, marks=pytest.mark.slow),  # which is for the first rank only
    ],
)
def test_a_run_names_the_missing_module(module: str, ranks: int, tmp_path: Path) -> None:
    told = f"{module} is not installed", "apt-get install python3-dolfinx"
    assert_missing(*told, module, tmp_path, ranks=ranks)


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_missing_compiler_is_named(ranks: int, tmp_path: Path) -> None:
    elsewhere = {"CC": "no-such-compiler", "XDG_CACHE_HOME": str(tmp_path)}
    told = "needs a C compiler and Python's headers", "gcc libc6-dev python3-dev"
    assert_missing(*told, "", tmp_path / "x", ranks=ranks, **elsewhere)


def assert_missing(what: str, remedy: str, modules: str, out: Path, **options: Any) -> None:
    """A run without the modules ends with one line, that says what is missing and what to do."""
    order = ("run", CAVITY, *COARSE_OF_MISSING, "--out", out)
    done = without(modules, *order, code=MissingError.exit_code, **options)
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("incipient: ")]
    assert what in line and remedy in line
    assert "Traceback" not in done.stderr


def test_a_missing_library_is_named() -> None:
    with (
        pytest.raises(
            MissingError, match=r"libNone\.so\.7 is not installed: .*apt-get install libglu1-mesa"
        ),
        required(),
    ):
        ctypes.CDLL("libNone.so.7")
