"""Agreement on failure."""

from __future__ import annotations

from typing import Any

import pytest
from mpi4py import MPI

from incipient.errors import IncipientError, MeshError, OutputError
from incipient.parallel import collectively

COMM = MPI.COMM_WORLD


def test_nothing_happens_when_nothing_fails() -> None:
    with collectively(COMM):
        value = 1
    assert value == 1


@pytest.mark.parametrize("kind", [MeshError, OutputError, IncipientError])
def test_own_errors_keep_type_and_message(kind: type[IncipientError]) -> None:
    with pytest.raises(kind, match=r"^the disk is full$"), collectively(COMM):
        raise kind("the disk is full")


def test_defects_of_the_program_keep_their_type() -> None:
    """They are reported with a traceback where they happened."""
    with pytest.raises(ZeroDivisionError), collectively(COMM):
        1 / 0  # noqa: B018


def test_interrupts_pass() -> None:
    """Ctrl-C reaches every rank by itself: nothing must be waited for."""
    with pytest.raises(KeyboardInterrupt), collectively(COMM):
        raise KeyboardInterrupt


RANKS = """
import sys
from mpi4py import MPI
from incipient.errors import IncipientError, OutputError
from incipient.parallel import collectively

comm, failing, kind = MPI.COMM_WORLD, int(sys.argv[1]), {"own": OutputError, "other": ValueError}[sys.argv[2]]
try:
    with collectively(comm):
        if comm.rank >= failing:
            raise kind(f"rank {comm.rank} failed")
except Exception as error:
    print(f"{comm.rank}: {type(error).__name__}: {error}\\n", end="")
comm.Barrier()
"""


@pytest.mark.parametrize("failing", [0, 1, 2])
def test_all_ranks_raise_the_first_error(mpirun: Any, failing: int) -> None:
    done = mpirun(3, RANKS, failing, "own", timeout=60)
    assert done.returncode == 0, done.stderr
    expected = [f"{rank}: OutputError: rank {failing} failed" for rank in range(3)]
    assert sorted(done.stdout.split("\n"))[1:] == expected


def test_a_defect_on_one_rank_is_told_to_the_others(mpirun: Any) -> None:
    done = mpirun(2, RANKS, 1, "other", timeout=60)
    assert done.returncode == 0, done.stderr
    expected = ["0: IncipientError: rank 1 failed", "1: ValueError: rank 1 failed"]
    assert sorted(done.stdout.split("\n"))[1:] == expected
