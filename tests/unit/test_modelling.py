"""Gap and domain beside an accuracy: what is advised would do."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import incipient
from incipient.accuracy.coarse_runs import KeptRuns, changed, coarse
from incipient.accuracy.goal import Goal
from incipient.accuracy.modelling import remedies
from incipient.accuracy.terms import of_domain, of_gap
from incipient.errors import SceneError
from incipient.results.errorbars import ErrorBars, Loads, Term
from incipient.results.loads import Couples, Forces
from incipient.scene import Scene, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.simulate import loads_of

NARROW = {"length": 8.0, "height": 4.0}


def narrow(**numerics: Any) -> Scene:
    """A disc on a bed whose domain is much too small."""
    chosen = {"mesh_size": 2.0, "correction": False, **numerics}
    return changed(grain_on_bed(), domain=NARROW, body={"x": 3.0}, numerics=chosen)


def solved(scene: Scene) -> Loads:
    return loads_of(scene, MPI.COMM_SELF)


def test_what_is_reached_is_of_discretisation_and_what_is_advised_would_do() -> None:
    """The line says what the number is of; gap and domain as advised have errors below the accuracy."""
    asked = 0.02
    scene = narrow(accuracy=asked)
    result = incipient.run(scene, comm=MPI.COMM_SELF)
    found = result.adaptation
    assert found is not None and found.met
    assert "(of discretisation), asked for 0.02: reached" in found.lines()[0]
    gap, domain = found.beside
    assert gap.startswith("beside it the error of the gap, ")
    assert domain.startswith("beside it the error of the domain, ") and domain.endswith(" would do")
    overrides = (
        domain.split("; ")[1]
        .removesuffix(" would do")
        .replace("], ", "]; ")
        .replace(", domain", "; domain")
    )
    advised = loads(commented(scene), overrides=tuple(overrides.split("; ")))
    assert advised.domain.height > 2.0 * scene.domain.height
    solve = KeptRuns({}, lambda: "", solved)
    whole = solve(changed(advised, numerics={"error_bars": False, "accuracy": None}))
    assert np.linalg.norm(of_domain(advised, whole, solve).force) < asked * np.linalg.norm(
        whole.force
    )


def advice(asked: float, scene: Scene, term: Term) -> tuple[str, ...]:
    """What is said of one term beside a force of size one."""
    unit, none = np.array([1.0, 0.0, 0.0]), np.zeros(3)
    force, couple = Forces(unit, unit, none, none), Couples(none, none, none)
    found = SimpleNamespace(force=force, couple=couple, elevations=None)
    return remedies(scene, asked, Goal.of(scene), found, ErrorBars((term,)))


def test_a_gap_is_advised_by_the_power_with_which_its_error_falls() -> None:
    scene = narrow(accuracy=0.01)
    twice = Term("gap", np.array([0.02, 0.0, 0.0]), np.zeros(3), "", power=1.0)
    assert (
        advice(0.01, scene, twice)[0]
        == "beside it the error of the gap, 2.0e-02; contact.gap = 0.003 would do"
    )
    assert advice(0.03, scene, twice) == ()
    assert advice(1e-4, scene, twice)[0].endswith("it cannot be made small enough")


def test_the_power_of_the_gap_is_measured() -> None:
    """On a flat bed at Re = 20 the force goes with the gap to the power one."""
    term = of_gap(narrow(), solved(coarse(narrow())), KeptRuns({}, lambda: "", solved))
    assert term.power == pytest.approx(1.0, abs=0.05)


def test_that_a_run_chooses_gap_and_domain_is_refused_with_what_to_do() -> None:
    with pytest.raises(
        SceneError, match=r"accuracy_includes: is retired; leave it out: .*contact\.gap and"
    ):
        loads(commented(narrow()), overrides=('numerics.accuracy_includes="all"',))
