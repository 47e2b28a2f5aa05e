"""Fixtures for all tests."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from environment import environment, finished, on_ranks
from hypothesis import settings

# The same examples in every run, so that a failure is the change's; HYPOTHESIS_PROFILE=explore looks further.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

TESTS = Path(__file__).parent

Launch = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def mpirun(tmp_path: Path) -> Launch:
    """`mpirun(n, script, *args, timeout=120, code=0)`: run Python code, or a script by its path, on n ranks.

    Returns the completed process with its text output; another exit code fails the test, unless it is None. A run that
    hangs fails the test when the time is up, and is ended with all its ranks. Scripts can import the modules beside
    this file.
    """

    def launch(
        n: int, script: str | Path, *args: object, timeout: float = 120, code: int | None = 0
    ) -> subprocess.CompletedProcess[str]:
        path = script if isinstance(script, Path) else _written(script, tmp_path)
        command = [*on_ranks(n), sys.executable, str(path), *map(str, args)]
        surroundings = environment() | {"PYTHONPATH": str(TESTS)}
        return finished(command, timeout, code, env=surroundings, cwd=tmp_path)

    return launch


@pytest.fixture
def said_by(capsys: Any) -> Callable[..., str]:
    """`said_by("judge", case, code=0)`: what the command prints, or complains of if its code is not 0."""

    def run(*words: object, code: int = 0) -> str:
        from incipient.cli import main

        capsys.readouterr()
        assert main([str(word) for word in words]) == code
        printed, complaint = capsys.readouterr()
        return complaint if code else printed

    return run


def _written(code: str, directory: Path) -> Path:
    path = directory / "script.py"
    path.write_text(code)
    return path


# What solves a flow, or starts ranks or processes, is not quick.
NOT_QUICK = (
    *(
        "mpi4py",
        "dolfinx",
        "petsc4py",
        "gmsh",
        "subprocess",
        "environment",  # of processes that tests start
        "incipient.fluid",
        "incipient.coupled",
        "incipient.mesh",
    ),
    *(
        "incipient.accuracy",
        "incipient.thresholds",
        "incipient.simulation",
        "incipient.restart",
    ),
    *("incipient.cost", "incipient.pictures", "incipient.meshes"),
)


@cache
def is_quick(path: Path) -> bool:
    """Whether the tests of a file need neither flow nor ranks, by what it imports, or because it says so."""
    text, solving = path.read_text(), "|".join(map(re.escape, NOT_QUICK))
    solves = re.search(rf"^(?:from|import) (?:{solving})\b", text, re.M)
    return path.parent.name == "unit" and (not solves or "pytestmark = pytest.mark.quick" in text)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Read no other files where only quick tests are asked for: to import all takes as long as a sixth of those."""
    asked = str(config.option.markexpr).split(" and ")
    is_left_out = collection_path.name.startswith("test_") and not is_quick(collection_path)
    return True if "quick" in asked and is_left_out else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the unit tests that need neither flow nor ranks as quick: `pytest -m quick` takes less than a minute.

    They come last: where files are shared out among processes, the last long one would keep the others waiting.
    """
    items.sort(key=lambda item: is_quick(item.path))
    for item in items:
        if is_quick(item.path) and "mpirun" not in getattr(item, "fixturenames", ()):
            item.add_marker("quick")
