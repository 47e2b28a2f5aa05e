"""The command `incipient` in processes of its own, alone or on several ranks, and several commands in one process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from environment import end, environment, finished, on_ranks
from processes import Finished, Outcome

COMMAND = "from incipient.cli import main\nraise SystemExit(main())\n"
# Runs commands one after the other on all ranks. The next begins when every rank's exit code is there, so a rank
# that stays behind makes the test run out of time. A limit on the size of files stands for a full disk.
SESSION = """\
import contextlib, io, json, resource, sys
from mpi4py import MPI
from incipient.cli import main

comm, (limit, commands) = MPI.COMM_WORLD, json.loads(sys.argv[1])
comm.barrier()
if limit is not None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
told = []
for command in commands:
    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(said):
        code = main(command)
    told.append((comm.gather(code), comm.gather(said.getvalue())))
if comm.rank == 0:
    print(json.dumps(told))
"""

Command = Callable[..., "Finished[str]"]
Started = Callable[..., "subprocess.Popen[str]"]
Session = Callable[..., list[Outcome]]


@pytest.fixture
def command(tmp_path: Path, mpirun: Any) -> Command:
    """`command("run", scene, ranks=2)`: what the command says in tmp_path; it must end with `code`, by default 0."""

    def run(
        *arguments: object,
        ranks: int = 1,
        timeout: float = 60,
        code: int | None = 0,
        **variables: str,
    ) -> Finished[str]:
        if ranks > 1:
            return mpirun(ranks, COMMAND, *arguments, timeout=timeout, code=code)
        command = [sys.executable, "-m", "incipient", *arguments]
        return finished(command, timeout, code, env=environment() | variables, cwd=tmp_path)

    return run


@pytest.fixture
def session(mpirun: Any) -> Session:
    """`session(ranks, commands)`: commands one after the other in tmp_path, none of which may hang."""

    def run(
        ranks: int,
        commands: Sequence[Sequence[object]],
        limit: int | None = None,
        timeout: float = 120,
    ) -> list[Outcome]:
        plain = [[str(argument) for argument in command] for command in commands]
        done = mpirun(ranks, SESSION, json.dumps([limit, plain]), timeout=timeout)
        told = json.loads(done.stdout.splitlines()[-1])
        return [Outcome(codes, "".join(said).splitlines()) for codes, said in told]

    return run


@pytest.fixture
def started() -> Iterator[Started]:
    """`started(ranks, *arguments)`: the command running in a session of its own, as in a terminal."""
    running = []

    def start(ranks: int, *arguments: object, **variables: str) -> subprocess.Popen[str]:
        run = subprocess.Popen(
            [
                *(on_ranks(ranks) if ranks > 1 else ()),
                sys.executable,
                "-m",
                "incipient",
                *map(str, arguments),
            ],
            env=environment() | variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        running.append(run)
        return run

    yield start
    for run in running:
        end(run)
