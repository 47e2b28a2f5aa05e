"""Terms of the error bars against what really changes, and what they mean for the verdict."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from mpi4py import MPI

import incipient
from incipient.accuracy import errorbars
from incipient.accuracy.errorbars import (
    Loads,
    Term,
    bar_of_safety,
    by_coarser_run,
    changed,
    farther,
    loads_of,
)
from incipient.contact import Contacts, Load
from incipient.errors import ConvergenceError
from incipient.scene import Scene, loads
from incipient.scene.example import commented, grain_on_bed

IN_STREAM = """
[domain]
length = 8.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "uniform"
[body]
shape = "disc"
diameter = 1.0
centre = [3.0, 2.0]
"""
COARSE = {"order": 2, "mesh_size": 2.0, "error_bars": False}
WITHIN = 3.0


def solve(scene: Scene) -> Loads:
    return loads_of(scene, MPI.COMM_SELF)


def difference(one: Loads, other: Loads) -> Iterator[float]:
    yield float(np.linalg.norm(one.force - other.force))
    yield float(np.linalg.norm(one.couple - other.couple))


def estimated(term: Term) -> Iterator[float]:
    yield float(np.linalg.norm(term.force))
    yield float(np.linalg.norm(term.couple))


def agree(term: Term, one: Loads, other: Loads) -> None:
    for estimate, true in zip(estimated(term), difference(one, other), strict=True):
        assert true / WITHIN < estimate < WITHIN * true


@pytest.mark.parametrize("inertia", [True, False])
def test_gap_term_against_a_gap_closed(inertia: bool) -> None:
    """The gap is closed to a sixteenth; the rest changes force and couple by another few per cent of that."""
    scene = changed(grain_on_bed(), numerics=COARSE, fluid={"inertia": inertia})
    closed = changed(scene, contact={"gap": scene.contact.gap / 16.0})
    agree(errorbars.of_gap(scene, solve), solve(scene), solve(closed))


def test_domain_term_against_a_far_larger_domain() -> None:
    """Sides three to four times as far, for shear over a bed; the term extrapolates from 1.5 times."""
    scene = changed(grain_on_bed(), numerics=COARSE)
    large = farther(farther(farther(scene)))
    assert large.domain.height == pytest.approx(1.5**3 * scene.domain.height)
    assert large.viscosity == pytest.approx(scene.viscosity)
    agree(errorbars.of_domain(scene, solve), solve(scene), solve(large))


def test_domain_term_of_a_stream() -> None:
    """The drag in a stream between sides that move with it falls as they go away."""
    scene = changed(loads(IN_STREAM), numerics=COARSE)
    large = farther(farther(farther(scene)))
    term, drags = errorbars.of_domain(scene, solve), [solve(one).force[0] for one in (scene, large)]
    assert abs(np.diff(drags)[0]) / WITHIN < term.force[0] < WITHIN * abs(np.diff(drags)[0])


def test_viscosity_stays_when_the_domain_grows() -> None:
    scene = changed(loads(IN_STREAM), fluid={"scale": "flow", "reynolds": 80.0})
    assert farther(scene).viscosity == pytest.approx(scene.viscosity)


@pytest.mark.parametrize(("scheme", "order"), [("bdf1", 1), ("bdf2", 2)])
def test_coarser_run_extrapolates_at_the_order_of_the_scheme(scheme: str, order: int) -> None:
    """With errors that are exactly of that order the estimate is the error."""
    scene = loads(IN_STREAM, overrides=(f"time={{end=1.0, step=0.1, scheme='{scheme}', tolerance=1e-3}}",))

    def exact(one: Scene) -> Loads:
        assert one.time is not None
        return Loads(
            np.array([1.0 + 0.3 * one.time.step**order, 0, 0]), np.array([0, 0, -(one.time.step**order)])
        )

    term = by_coarser_run(scene, exact(scene), exact)
    assert term.force[0] == pytest.approx(0.3 * 0.1**order)
    assert term.couple[2] == pytest.approx(0.1**order)
    coarse = errorbars.coarser(scene).time
    assert coarse is not None and coarse.tolerance == pytest.approx(2.0 ** (order + 1) * 1e-3)


def test_coarser_run_against_a_much_finer_one() -> None:
    """A disc in a stream that starts at once."""
    scene = loads(
        IN_STREAM,
        overrides=(
            "time={end=0.8, step=0.1, start='stokes'}",
            "numerics.mesh_size=2",
            "numerics.error_bars=false",
        ),
    )
    fine = changed(scene, time={"step": 0.0125}, numerics={"mesh_size": 1.0, "order": 3})
    computed = solve(scene)
    error = float(np.linalg.norm(computed.force - solve(fine).force))
    assert error / WITHIN < np.linalg.norm(by_coarser_run(scene, computed, solve).force) < WITHIN * error


def test_failed_coarse_runs_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(scene: Scene, comm: MPI.Comm) -> Loads:
        raise ConvergenceError("no steady flow found")

    monkeypatch.setattr(errorbars, "loads_of", fail)
    scene = loads(commented(grain_on_bed()), overrides=("numerics.mesh_size=2", "output.fields=false"))
    bars = incipient.run(scene, comm=MPI.COMM_SELF).error_bars
    assert bars is not None
    assert [term.name for term in bars.terms] == ["discretisation"]
    assert bars.left_out == {"gap": "no steady flow found", "domain": "no steady flow found"}


# -- the verdict: a disc of weight one between two contacts at 45 degrees without friction is tipped over one of them
# by a horizontal force equal to its weight -----------------------------------------------------------------------


def pocket() -> Contacts:
    s = np.sqrt(0.5)
    normals = np.array([[-s, -s, 0.0], [s, -s, 0.0]])
    return Contacts(0.5 * normals, normals, None)


def bar(force: float, **errors: float) -> errorbars.SafetyBar:
    load = Load(np.array([force, 0, 0]), np.zeros(3), np.array([0, -1.0, 0]), np.zeros(3))
    terms = tuple(Term(name, np.array([error, 0, 0]), np.zeros(3), "") for name, error in errors.items())
    return bar_of_safety(load, pocket(), 0.0, (1.0, 0.125 * np.eye(3)), terms)


def test_safety_factor_and_its_bar() -> None:
    found = bar(0.98, discretisation=0.01)
    assert found.value == pytest.approx(1.0 / 0.98)
    assert (found.low, found.high) == pytest.approx((1.0 / 0.99, 1.0 / 0.97))
    assert found.certain
    assert len(found.modes) == 1
    assert "certain within the error bars" in found.sentence()


def test_not_certain_and_what_decides() -> None:
    found = bar(0.98, discretisation=0.005, gap=0.03, domain=0.01)
    assert not found.certain
    assert found.low < 1.0 < found.high
    assert len(found.modes) == 2
    assert found.decisive == "gap"
    assert "reduce the error of the gap" in found.sentence()


def test_moving_for_certain() -> None:
    found = bar(1.05, gap=0.02)
    assert found.certain
    assert found.high < 1.0


def test_no_terms_no_bar() -> None:
    found = bar(0.5)
    assert (found.low, found.high, found.decisive) == (found.value, found.value, "")
