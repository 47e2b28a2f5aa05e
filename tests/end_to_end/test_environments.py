"""The command line in surroundings that nobody asked for: one line and a code, or the same answer as anywhere else."""

from __future__ import annotations

import io
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import environment, finished
from processes import CAVITY, GRAIN_ON_BED, Finished, result_of, settings
from test_sweeps import rows

from incipient.cli import interrupt_again
from incipient.interrupt import open_streams

CASE = CAVITY.parents[1] / "cases" / "block_on_incline.toml"
COARSE = settings(
    numerics_order=2, numerics_mesh_size=6, numerics_error_bars=False, effects_inertia=False
)
OUT = ["--log-level", "error", "--out", "out"]
COMMANDS: dict[str, list[object]] = {
    "plan": ["plan", CAVITY, "--log-level", "error"],
    "run": ["run", CAVITY, *COARSE, *OUT],
    "draw": ["run", GRAIN_ON_BED, *COARSE, *settings(output_pictures=True), *OUT],
    "judge": ["judge", CASE],
    "judge --out": ["judge", CASE, "--out", "out"],
    "sweep": [
        *("sweep", CASE, "--do", "judge", "--over", "contacts.friction=0.1,0.2"),
        *("--jobs", 2, "--out", "s.sqlite"),
    ],
    "new": ["new", "grain"],
    "schema": ["schema"],
}


@dataclass(frozen=True)
class Surroundings:
    """A command among odd things, its exit code, and how its one line of complaint begins.

    before, after: of the command in the shell; variables: of the environment, None: without
    """

    command: str
    code: int = 0
    line: str = ""
    before: str = ""
    after: str = ""
    variables: dict[str, str | None] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What is odd, and the command."""
        odd = [f"{key}={value}" for key, value in self.variables.items()]
        return " ".join([self.before, *odd, self.command, self.after]).strip()


def among(command: str, code: int = 0, line: str = "", **variables: str | None) -> Surroundings:
    return Surroundings(command, code, line, variables=variables)


def shell(before: str, command: str, code: int = 0, line: str = "") -> Surroundings:
    return Surroundings(command, code, line, before)


def streams(after: str, command: str, code: int = 0, line: str = "") -> Surroundings:
    return Surroundings(command, code, line, after=after)


FULL = "the standard output cannot be written (No space left on device)"
REMOVED = "mkdir gone; cd gone; rmdir ../gone;"
QUICK = [  # for every run of the tests
    shell("ulimit -v 250000;", "plan", 5, "the memory is too small"),
    shell("ulimit -n 10;", "plan", 5, "ulimit -n is 10, too small"),
    shell(REMOVED, "sweep", 5, "the working directory has been"),
    among("plan", 5, "TMPDIR=file: temporary files cannot be written there", TMPDIR="file"),
    among("new", PYTHONWARNINGS="error"),
    # As other programs leave: 128 and the number of SIGPIPE.
    *(streams("| head -0", command, 141) for command in ("plan", "schema", "run")),
    Surroundings("schema", 141, after="| head -0", variables={"PYTHONUNBUFFERED": "1"}),
    *(streams(ends, "judge") for ends in ("<&- >&- 2>&-", "2>/dev/full")),
    *(streams(ends, "judge", 5, FULL) for ends in (">/dev/full", ">/dev/full 2>/dev/full")),
]
SLOW = [
    # what is closed, full or not read
    *(streams(ends, "run") for ends in ("<&-", ">&-", "2>&-", "<&- >&-", "<&- 2>&-", ">&- 2>&-")),
    *(streams(ends, "plan") for ends in ("<&- >&- 2>&-", "2>/dev/full", ">&- 2>/dev/full")),
    *(streams(ends, "judge --out") for ends in ("<&- >&- 2>&-", "</dev/full", "2>/dev/full")),
    *(streams(">/dev/full", command, 5, FULL) for command in ("plan", "run", "sweep")),
    *(streams(ends, "run", 5) for ends in (">/dev/full 2>&-", ">/dev/full 2>/dev/full")),
    streams("| head -0", "sweep", 141),
    # languages
    *(among(command, LC_ALL="C") for command in ("plan", "judge --out", "draw")),
    *(among("plan", LC_ALL=language) for language in ("xx_YY.UTF-8", "", "tr_TR.UTF-8")),
    *(among("judge", PYTHONIOENCODING=encoding) for encoding in ("ascii", "latin-1:strict")),
    among("new", LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"),
    # directories
    *(among("run", HOME=home, XDG_CACHE_HOME="cache") for home in (None, "", "/proc")),
    among("run", 5, "/proc/.cache/fenics", HOME="/proc", XDG_CACHE_HOME=None),
    *(among("run", 5, where, XDG_CACHE_HOME=where) for where in ("/proc/x", "file", "/dev/null")),
    *(among("run", 5, f"TMPDIR={where}: ", TMPDIR=where) for where in ("/proc", "absent")),
    among("judge", 5, "TMP=file: ", TMP="file"),
    *(shell("cd /proc;", command, 5, line) for command, line in (
        ("run", "out: cannot be written"), ("new", "grain.toml: cannot be written"),
        ("judge --out", "out: cannot be written"), ("sweep", "s.sqlite: cannot be written"),
    )),
    shell("cd /proc;", "plan"),
    *(shell(REMOVED, command, 5, "the working directory has been")
      for command in ("plan", "run", "new", "judge")),
    *(shell("umask 777;", command) for command in ("new", "judge --out")),
    # limits
    *(shell(f"ulimit -v {size};", "judge", 5, "the memory is too small") for size in (60_000, 200_000)),
    shell("ulimit -v 500000;", "run", 5, "the memory is too small"),
    shell("ulimit -v 500000;", "judge --out", 5, "not drawn: "),
    shell("ulimit -d 200000;", "run", 5, "the memory is too small"),
    shell("ulimit -n 64;", "sweep"),
    shell("ulimit -s 512;", "run", 5, "ulimit -s is 512, too small"),
    shell("ulimit -s 1024;", "run"),
    shell("ulimit -s unlimited;", "run"),
    shell("ulimit -f 0;", "plan"),
    *(shell(f"ulimit -f {blocks};", command, 5, line) for blocks, command, line in (
        (0, "new", "grain.toml: cannot be written: file too large"),
        (0, "run", "out/.incipient: cannot be written: file too large"),
        (8, "run", "out/fields/000000.h5: cannot be written: file too large"),
        (8, "sweep", "s.sqlite: "),
    )),
    # libraries
    *(among("run", OMP_NUM_THREADS=number) for number in ("nonsense", "-3", "1000000", "")),
    among("run", OPENBLAS_NUM_THREADS="x", NUMBA_NUM_THREADS="1", MKL_NUM_THREADS="x"),
    among("run", PETSC_OPTIONS="-nonsense 3"),
    among("run", 2, "PETSc failed with", PETSC_OPTIONS="-options_file /absent"),
    among("run", 2, "PETSc failed with", PETSC_OPTIONS="-fluid_ksp_type nonsense"),
    among("run", PATH="/absent"),
    among("run", 6, "a form was not compiled", PATH="/absent", XDG_CACHE_HOME="cold"),
    among("judge --out", MPLBACKEND="nonsense", MPLCONFIGDIR="/proc/x"),
    among("draw", DISPLAY="nonsense", MPLBACKEND="TkAgg"),
    among("run", HDF5_USE_FILE_LOCKING="FALSE"),
    # terminals and clocks
    among("plan", TERM="dumb", COLUMNS="1", LINES="0", NO_COLOR="1"),
    among("run", TERM=None, FORCE_COLOR="1"),
    *(among("run", TZ=zone) for zone in ("nonsense", "Asia/Kathmandu", ":/absent")),
    # Python
    among("run", PYTHONPATH="/absent:file::", PYTHONSTARTUP="/absent"),
    *(among(command, PYTHONWARNINGS="error") for command in ("plan", "run", "judge --out", "sweep")),
    *(among(command, PYTHONOPTIMIZE="2") for command in ("plan", "run", "judge", "sweep")),
    among("run", PYTHONHASHSEED="random", PYTHONDEVMODE="1"),
    among("plan", PYTHONDONTWRITEBYTECODE="1", PYTHONPYCACHEPREFIX="/proc/x"),
    shell("echo 'raise SystemExit(3)' | tee types.py json.py logging.py >string.py;", "sweep"),
    shell("trap '' INT HUP TERM PIPE;", "run"),
]  # fmt: skip


def parameters(rows: list[Surroundings], *marks: Any) -> list[Any]:
    return [pytest.param(row, id=row.name, marks=marks) for row in rows]


def done_in(surroundings: Surroundings, directory: Path) -> Finished[str]:
    (directory / "file").touch()
    variables = environment() | {"PYTHON": sys.executable} | surroundings.variables
    command = f'{surroundings.before} "$PYTHON" -P -m incipient "$@" {surroundings.after}'
    return finished(
        ["/bin/bash", "-o", "pipefail", "-c", command, "bash", *COMMANDS[surroundings.command]],
        180,
        env={name: value for name, value in variables.items() if value is not None},
        cwd=directory,
        code=surroundings.code,
    )


def answer(command: str, done: Finished[str], directory: Path) -> Any:
    """What a command has found, but for times and versions."""
    if command in ("run", "draw"):
        result = result_of(directory / "out")
        pictures = sorted(path.name for path in (directory / "out").glob("*.png"))
        return [result[key] for key in ("status", "force", "centrelines", "verdict")], pictures
    if command == "sweep":
        return rows(directory / "s.sqlite", "result ->> 'certainty'", "status = 'done'")
    if command == "new":
        return (directory / "grain.toml").read_text()
    return done.stdout, sorted(path.name for path in directory.glob("out/*"))


@pytest.fixture(scope="module")
def usual(tmp_path_factory: Any) -> Callable[[str], Any]:
    """What a command answers in usual surroundings."""

    @cache
    def known(command: str) -> Any:
        directory = tmp_path_factory.mktemp("usual")
        return answer(command, done_in(Surroundings(command), directory), directory)

    return known


@pytest.mark.parametrize("surroundings", [*parameters(QUICK), *parameters(SLOW, pytest.mark.slow)])
def test_the_answer_is_the_usual_or_one_line(
    surroundings: Surroundings, usual: Callable[[str], Any], tmp_path: Path
) -> None:
    done = done_in(surroundings, tmp_path)
    assert "Traceback" not in done.stderr and "ORTE" not in done.stderr
    complaints = [line for line in done.stderr.splitlines() if line.startswith("incipient: ")]
    if surroundings.code in (0, 141):
        assert not complaints
    elif "2>" not in surroundings.after:
        (complaint,) = complaints
        assert complaint.removeprefix("incipient: ").startswith(surroundings.line)
    if surroundings.code == 0:
        computed, known = answer(surroundings.command, done, tmp_path), usual(surroundings.command)
        if surroundings.after and surroundings.command not in ("run", "draw"):
            computed, known = computed[1:], known[1:]  # what was said went nowhere
        assert computed == known


class Interrupted:
    """What a signal meets while Python runs a finalizer, as in its imports."""

    def __del__(self) -> None:
        raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("encoding", "written"), [("ascii", b"\\xb0\\udcff"), ("utf-8", b"\xc2\xb0\xff")]
)
def test_letters_that_an_encoding_lacks_are_escaped(
    encoding: str, written: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(file, encoding=encoding))
    open_streams()
    print("°\udcff", end="", flush=True)
    assert file.getvalue() == written


def test_an_interrupt_within_a_finalizer_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "unraisablehook", interrupt_again)
    with pytest.raises(KeyboardInterrupt):
        Interrupted()
        time.sleep(10.0)


@pytest.mark.parametrize(
    "command", ["run", *(pytest.param(name, marks=pytest.mark.slow) for name in ("plan", "sweep"))]
)
def test_an_interrupt_at_any_moment_is_one_line(command: str, started: Any, tmp_path: Path) -> None:
    """From the import of numpy on, through those of MPI, gmsh and dolfinx, to the end of the process."""
    for moment in np.linspace(0.0, 0.8, 9):
        order = [part if part not in ("out", "s.sqlite") else f"{tmp_path}/{moment:.1f}.sqlite"
                 for part in COMMANDS[command]]  # fmt: skip
        process = started(1, *order)
        while "_multiarray_umath" not in Path(f"/proc/{process.pid}/maps").read_text():
            time.sleep(0.002)
        time.sleep(moment)
        os.killpg(process.pid, signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        lines = [line for line in said.splitlines() if "interrupted" in line]
        # 0: it had ended. Where an `exec` was interrupted Python ends itself by the signal, for shells 130 as well.
        assert process.returncode in (130, -signal.SIGINT, 0), said
        assert len(lines) <= 1 and "Traceback" not in said and "ignored" not in said, said
