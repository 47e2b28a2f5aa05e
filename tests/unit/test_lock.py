"""One run at a time in a directory: who waits, who takes over, and that the lock always goes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from environment import environment
from mpi4py import MPI

from incipient.errors import OutputError
from incipient.output.lock import LOCK, Holder, locked

COMM = MPI.COMM_SELF
# Takes the lock of a directory, says so, and keeps it until its standard input ends.
KEEPER = """
import sys
from pathlib import Path
from mpi4py import MPI
from incipient.errors import OutputError
from incipient.output.lock import locked
try:
    with locked(Path(sys.argv[1]), MPI.COMM_SELF):
        print("taken", flush=True)
        sys.stdin.read()
except OutputError as error:
    print(error, flush=True)
"""
RANKS = """
import sys
from pathlib import Path
from mpi4py import MPI
from incipient.errors import OutputError
from incipient.output.lock import locked
try:
    with locked(Path(sys.argv[1]), MPI.COMM_WORLD):
        pass
except OutputError as error:
    print(f"{MPI.COMM_WORLD.rank}: {error}\\n", end="")
"""


def keeper(directory: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", KEEPER, str(directory)],
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def said(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def left_by(directory: Path, **changed: Any) -> None:
    """A lock as this process would leave it, but for what is changed."""
    (directory / LOCK).write_text(json.dumps(asdict(replace(Holder.here(), **changed))))


def test_the_second_is_told_who_is_at_work(tmp_path: Path) -> None:
    with locked(tmp_path, COMM):
        with pytest.raises(OutputError) as told, locked(tmp_path, COMM):
            raise AssertionError("two at once")
        assert (tmp_path / LOCK).exists()
    assert str(told.value).startswith(
        f"{tmp_path}: another run is using it (process {os.getpid()} on "
    )
    assert str(told.value).endswith("; wait for it or choose another directory")
    with locked(tmp_path, COMM):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [OutputError, ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_the_lock_goes_however_the_run_ends(tmp_path: Path, kind: type[BaseException]) -> None:
    with pytest.raises(kind), locked(tmp_path / "new", COMM, make=True):
        raise kind
    assert not list((tmp_path / "new").iterdir())


def test_the_lock_of_a_killed_process_is_taken_over(tmp_path: Path) -> None:
    process = keeper(tmp_path)
    assert said(process) == "taken"
    with (
        pytest.raises(OutputError, match=rf"process {process.pid} on .*; wait for it"),
        locked(tmp_path, COMM),
    ):
        pass
    process.kill()
    os.waitid(
        os.P_PID, process.pid, os.WEXITED | os.WNOWAIT
    )  # it stays a zombie, as under a careless parent
    with locked(tmp_path, COMM):
        assert Holder.read((tmp_path / LOCK).read_bytes()).process == os.getpid()  # type: ignore[union-attr]
    process.communicate()
    assert not list(tmp_path.iterdir())


def test_a_number_that_another_process_has_got_since_is_not_the_holder(tmp_path: Path) -> None:
    left_by(tmp_path)
    with pytest.raises(OutputError, match=f"process {os.getpid()} on "), locked(tmp_path, COMM):
        pass
    left_by(tmp_path, began="1")
    with locked(tmp_path, COMM):
        holder = Holder.read((tmp_path / LOCK).read_bytes())
        assert holder is not None and holder.began == Holder.here().began != "1"
    assert not list(tmp_path.iterdir())


def test_one_of_several_takes_an_old_lock_over(tmp_path: Path) -> None:
    left_by(tmp_path, began="1")
    processes = [keeper(tmp_path) for _ in range(4)]
    told = [said(process) for process in processes]
    for process in processes:
        process.communicate(timeout=60)
    assert told.count("taken") == 1
    assert sum("another run" in one for one in told) == 3


@pytest.mark.parametrize("holder", ["elsewhere", "nobody"])
def test_what_cannot_be_known_is_left_to_the_user(tmp_path: Path, holder: str) -> None:
    if holder == "elsewhere":
        left_by(tmp_path, host="cluster7 pid:[1]", process=1, began="1")
    else:
        (tmp_path / LOCK).touch()
    with (
        pytest.raises(OutputError, match=rf"or remove {tmp_path / LOCK} if "),
        locked(tmp_path, COMM),
    ):
        pass
    assert (tmp_path / LOCK).exists()


def test_a_lock_of_others_is_not_given_back(tmp_path: Path) -> None:
    with locked(tmp_path, COMM):
        left_by(tmp_path, process=1)
    assert (tmp_path / LOCK).exists()


def test_a_missing_directory_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match=r"absent: no such directory; give"),
        locked(tmp_path / "absent", COMM),
    ):
        pass


def test_all_ranks_are_refused(tmp_path: Path, mpirun: Any) -> None:
    with locked(tmp_path, COMM):
        done = mpirun(2, RANKS, tmp_path, timeout=60)
    assert done.returncode == 0, done.stderr
    lines = sorted(done.stdout.splitlines())
    assert [line[:2] for line in lines] == ["0:", "1:"]
    assert all(f"{tmp_path}: another run is using it" in line for line in lines)


@pytest.mark.parametrize(
    "content",
    [
        b"[" * 100_000,
        b"\xff\xfe",
        b"[1, 2]",
        json.dumps({"host": 5, "process": 1, "began": "1", "since": ""}).encode(),
        json.dumps({"host": " ", "process": "../x", "began": [], "since": None}).encode(),
    ],
    ids=["brackets", "no text", "list", "types", "others"],
)
def test_a_lock_that_names_nobody_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / LOCK).write_bytes(content)
    refused = pytest.raises(OutputError, match=r"another run is starting there; .* remove .*json")
    with refused, locked(tmp_path, COMM):
        pass
    assert (tmp_path / LOCK).read_bytes() == content


@pytest.mark.parametrize("kind", ["pipe", "link", "directory"])
def test_what_is_no_lock_is_refused_without_a_wait(tmp_path: Path, kind: str) -> None:
    """Nothing is ever read from the pipe, nothing written through the link, which leads nowhere."""
    path = tmp_path / LOCK
    make = {"pipe": os.mkfifo, "link": lambda path: path.symlink_to("x"), "directory": Path.mkdir}
    make[kind](path)
    with pytest.raises(OutputError, match=r"json: is no lock but"), locked(tmp_path, COMM):
        pass
    assert [one.name for one in tmp_path.iterdir()] == [LOCK]
