"""Two ranks give what one gives: forces, couples, norms; steady, unsteady, open and closed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import environment, finished, on_ranks

SCRIPT = Path(__file__).with_name("ranks_script.py")
# By what the iterations may leave: the direct solvers', and that of the solver by blocks.
CLOSE = {
    "open": 1e-9,
    "closed": 1e-9,
    "unsteady": 1e-9,
    "in_time": 1e-9,
    "cubic": 1e-9,
    "three_dimensions": 1e-9,
    "turned": 1e-9,
}
CLOSE["block"] = 1e-7


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What one rank and two find, by case: all cases in one start of the ranks, which takes longer than they do."""
    found = []
    for ranks in (1, 2):
        command = [*on_ranks(ranks), sys.executable, SCRIPT, *CLOSE]
        surroundings = environment() | {"PYTHONPATH": str(SCRIPT.parents[1])}
        done = finished(command, 240, env=surroundings, cwd=tmp_path_factory.mktemp("ranks"))
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    return found


@pytest.mark.parametrize("case", CLOSE)
def test_two_ranks_agree_with_one(readings: list[dict[str, Any]], case: str) -> None:
    alone, together = (dict(found[case]) for found in readings)
    assert (alone.pop("ranks"), together.pop("ranks")) == (1, 2)
    for name, value in alone.items():
        close = {"rel": CLOSE[case], "abs": CLOSE[case] * np.abs(value).max()}
        assert np.asarray(together[name]) == pytest.approx(np.asarray(value), **close), name
