"""The calibration of corrected forces notices corrections with a wrong sign or a wrong factor."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import incipient
from incipient.arrays import Floats
from incipient.results.errorbars import Term
from incipient.results.result import Result
from incipient.scene import Scene, loads


@pytest.fixture(scope="module")
def calibration() -> ModuleType:
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    try:
        import calibration
    finally:
        sys.path.pop(0)
    return calibration


IN_BOX = """
[domain]
kind = "box"
length = 4.0
height = 4.0
[fluid]
reynolds = 40.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "disc"
diameter = 1.0
centre = [1.5, 2.5]
[numerics]
order = 2
mesh_size = 6.0
[output]
fields = false
"""


@pytest.fixture(scope="module")
def cases(calibration: ModuleType) -> Callable[[str], tuple[Scene, Result]]:
    """A scene in which the correction of a term is most of all, and the nearly true result of it."""

    @cache
    def case(name: str) -> tuple[Scene, Result]:
        known = {"gap": "disc in a channel", "domain": "disc, domain 12 x 6"}
        scene = calibration.scene_of(known[name]) if name in known else loads(IN_BOX)
        return scene, incipient.run(calibration.nearly_true(scene), comm=MPI.COMM_SELF)

    return case


TERMS = ["discretisation", "gap", "domain"]


@pytest.mark.parametrize(
    "name", [*TERMS[:1], *(pytest.param(one, marks=pytest.mark.slow) for one in TERMS[1:])]
)
def test_corrected_forces_are_within_their_bars(
    name: str, calibration: ModuleType, cases: Any
) -> None:
    scene, true = cases(name)
    found = incipient.run(scene, comm=MPI.COMM_SELF)
    assert name in [term.name for term in found.error_bars.terms if term.correction is not None]
    row = calibration.compared("", found, true)
    assert row.within and row.corrected_bar < 0.4 * row.computed_bar


@pytest.mark.parametrize("factor", [-1.0, 1.5])
@pytest.mark.parametrize(
    "name", [*TERMS[:1], *(pytest.param(one, marks=pytest.mark.slow) for one in TERMS[1:])]
)
def test_a_wrong_estimate_is_noticed(
    name: str, factor: float, calibration: ModuleType, cases: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    right, (scene, true) = Term.corrected, cases(name)

    def planted(self: Term, change: Floats, left: Floats) -> Term:
        return right(self, np.asarray(change) * (factor if self.name == name else 1.0), left)

    monkeypatch.setattr(Term, "corrected", planted)
    assert not calibration.compared("", incipient.run(scene, comm=MPI.COMM_SELF), true).within
