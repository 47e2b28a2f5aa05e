"""Processes that tests start leave nothing behind."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

# A rank that hangs and knows nothing of MPI, so that it does not notice that its `mpirun` is gone.
HANGING = """
import os, pathlib, sys, time
pathlib.Path(sys.argv[1], f"{os.getpid()}.rank").touch()
time.sleep(300)
"""


def lives(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_ranks_that_hang_are_ended_with_their_mpirun(mpirun: Any, tmp_path: Path) -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        mpirun(2, HANGING, tmp_path, timeout=3)
    ranks = [int(path.stem) for path in tmp_path.glob("*.rank")]
    time.sleep(0.2)
    assert len(ranks) == 2
    assert not any(lives(rank) for rank in ranks)
