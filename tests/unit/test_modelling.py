"""Gap and domain beside an accuracy: what is advised does, and what the run chooses gives the force that it says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import SETTLED, on_bed

import incipient
from incipient.accuracy.coarse_runs import KeptRuns, Solve, changed, coarse, farther
from incipient.accuracy.goal import Goal
from incipient.accuracy.modelling import SMALLEST_GAP, Suited, _is_noise, remedies, suited
from incipient.accuracy.search import Search
from incipient.accuracy.searches import DualWeighted
from incipient.accuracy.terms import of_domain, of_gap
from incipient.errors import ConvergenceError, SceneError
from incipient.progress import Silent
from incipient.results.errorbars import ErrorBars, Loads, Term
from incipient.scene import Scene, Time, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.recorder import Recorder
from incipient.simulation.simulate import loads_of
from incipient.thresholds.meshes import to_accuracy

ALL = 'numerics.accuracy_includes="all"'
NARROW = {"length": 8.0, "height": 4.0}


def narrow(**numerics: Any) -> Scene:
    """A disc on a bed whose domain is much too small."""
    chosen = {"mesh_size": 2.0, "correction": False, **numerics}
    return changed(grain_on_bed(), domain=NARROW, body={"x": 3.0}, numerics=chosen)


def seeking(scene: Scene) -> Search:
    return DualWeighted(scene, MPI.COMM_SELF, Recorder(), Silent())


def solved(scene: Scene) -> Loads:
    return loads_of(scene, MPI.COMM_SELF)


def relative(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


@pytest.mark.slow
def test_all_errors_are_brought_below_the_accuracy() -> None:
    """The force is that of a domain far larger and a gap far smaller, to the accuracy that was asked for."""
    asked = 0.03
    result = incipient.run(narrow(accuracy=asked, accuracy_includes="all"), comm=MPI.COMM_SELF)
    found, chosen = result.adaptation, result.scene
    assert found is not None and found.met and found.reason == "reached" and found.reached < asked
    assert found.includes == ("discretisation", "gap", "domain")
    assert chosen["domain"]["height"] > 8.0 and chosen["contact"]["gap"] < 0.01
    assert [line.split()[0] for line in found.changes] == [
        *("contact.gap", "domain.origin", "domain.length", "domain.height")
    ]
    assert "(of discretisation, gap and domain), asked for 0.03: reached" in result.text()
    much_larger = {"origin": [-60.0, 0.0], "length": 120.0, "height": 60.0}
    large = changed(
        narrow(), domain=much_larger, contact={"gap": 2e-4}, numerics={"mesh_size": 1.0}
    )
    true = loads_of(changed(large, numerics={"error_bars": False}), MPI.COMM_SELF)
    assert result.force is not None
    assert relative(result.force.flow, true.force) < asked
    assert (
        relative(
            loads_of(changed(narrow(), numerics={"error_bars": False}), MPI.COMM_SELF).force,
            true.force,
        )
        > 0.2
    )
    # The error bars are those of the scene that was computed.
    assert result.error_bars is not None and not result.error_bars.failed
    assert relative(true.force + result.error_bars.force, true.force) < 1.5 * asked


def test_what_is_reached_is_of_discretisation_and_what_is_advised_would_do() -> None:
    """The line says what the number is of; gap and domain as advised have errors below the accuracy."""
    asked = 0.02
    scene = narrow(accuracy=asked)
    result = incipient.run(scene, comm=MPI.COMM_SELF)
    found = result.adaptation
    assert found is not None and found.met and found.includes == ("discretisation",)
    assert "(of discretisation), asked for 0.02: reached" in found.lines()[0]
    gap, domain, last = found.beside
    assert gap.startswith("not included: the error of the gap, ")
    assert domain.startswith("not included: the error of the domain, ") and domain.endswith(
        " would be sufficient"
    )
    assert "numerics.accuracy_includes" in last
    overrides = (
        domain.split("; ")[1]
        .removesuffix(" would be sufficient")
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
    loads_ = Loads(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    return remedies(scene, asked, Goal.of(scene), loads_, ErrorBars((term,)))


def test_a_gap_is_advised_by_the_power_with_which_its_error_falls() -> None:
    scene = narrow(accuracy=0.01)
    twice = Term("gap", np.array([0.02, 0.0, 0.0]), np.zeros(3), "", power=1.0)
    assert (
        advice(0.01, scene, twice)[0]
        == "not included: the error of the gap, 2.0e-02; contact.gap = 0.003 would be sufficient"
    )
    assert advice(0.03, scene, twice) == ()
    assert advice(1e-4, scene, twice)[0].endswith("it cannot be reduced enough")


def test_the_power_of_the_gap_is_measured() -> None:
    """On a flat bed at Re = 20 the force goes with the gap to the power one."""
    term = of_gap(narrow(), solved(coarse(narrow())), KeptRuns({}, lambda: "", solved))
    assert term.power == pytest.approx(1.0, abs=0.05)


def test_the_smallest_gap_is_said() -> None:
    """A disc on a bed cannot have a smaller one; the domain is large enough."""
    scene = changed(
        grain_on_bed(),
        contact={"gap": SMALLEST_GAP},
        numerics={"accuracy": 1e-4, "correction": False},
    )

    def solve(one: Scene) -> Loads:
        assert one.contact is not None
        force = np.array([1.0 + 10.0 * one.contact.gap, 0.0, 0.0])
        return Loads(force, np.zeros(3))

    found = suited(scene, 1e-4, Goal.of(scene), solve, lambda line: None)
    assert found.unmet == "the error of the gap, 1.0e-03, cannot be reduced"
    assert found.scene is scene and found.error == pytest.approx(1e-3, rel=1e-2)


def test_a_coarse_run_that_fails_leaves_what_was_found() -> None:
    """The first scene's errors are known; those of the next, with a smaller gap, are not."""
    scene = changed(grain_on_bed(), numerics={"accuracy": 0.01})

    def solve(one: Scene) -> Loads:
        if one.domain != scene.domain and one.domain.height > 1.6 * scene.domain.height:
            raise ConvergenceError("no steady flow found")
        return Loads(np.array([1.0 + 1.0 / one.domain.height, 0.0, 0.0]), np.zeros(3))

    found = suited(scene, 0.01, Goal.of(scene), solve, lambda line: None)
    assert found.scene is scene and {term.name for term in found.terms} == {"gap", "domain"}
    assert found.unmet == "further errors of gap and domain are unknown: no steady flow found"


def by_a_power(power: float, sizes: list[float]) -> Solve:
    """Forces that differ from one by a power of the domain's length, whatever the gap; notes the lengths."""

    def solve(one: Scene) -> Loads:
        sizes.append(one.domain.length)
        return Loads(
            np.array([1.0 - 0.2 * (one.domain.length / 8.0) ** -power, 0.0, 0.0]), np.zeros(3)
        )

    return solve


def test_an_error_of_the_domain_that_hardly_falls_ends_the_search() -> None:
    """One enlargement shows it; the error is then that of a decay to the power 1/3, here exactly."""
    sizes: list[float] = []
    scene = changed(narrow(), numerics={"accuracy": 0.01})
    found = suited(scene, 0.01, Goal.of(scene), by_a_power(1 / 3, sizes), lambda line: None)
    length = found.scene.domain.length
    assert length == 24.0 and max(sizes) == 36.0
    true = 0.2 * 3.0 ** (-1 / 3)
    assert found.error == pytest.approx(true / (1.0 - true), rel=1e-6)
    assert found.unmet == "the error of the domain, 1.6e-01, hardly decreases as the domain grows"


@pytest.mark.parametrize("power", [1.5, 2.0])
def test_an_error_of_the_domain_that_falls_is_brought_below_the_accuracy(power: float) -> None:
    sizes: list[float] = []
    scene = changed(narrow(), numerics={"accuracy": 0.003})
    found = suited(scene, 0.003, Goal.of(scene), by_a_power(power, sizes), lambda line: None)
    assert not found.unmet and found.error < 0.0015 and found.scene.domain.length > 24.0


@pytest.mark.slow
def test_over_half_discs_the_search_ends() -> None:
    """A stream from the crests takes a very long way to adapt to the bed, which the datum's error knows of."""
    scene = on_bed(*SETTLED, "numerics.accuracy=0.01", ALL)
    solve = KeptRuns({}, lambda: "", solved)

    def sought(one: Scene) -> tuple[Suited, np.ndarray]:
        found = suited(one, 0.01, Goal.of(one), solve, lambda line: None)
        return found, solve(coarse(found.scene)).force

    crest = changed(scene, flow={"datum": "crest"})
    (slow, short), (fast, limit) = sought(crest), sought(scene)
    assert (
        slow.unmet.startswith("the error of the datum, ")
        and 'flow.datum = "auto" reduces' in slow.unmet
    )
    assert not fast.unmet and fast.error < 0.005
    of_datum_alone = float(np.linalg.norm(slow.terms[-1].force) / np.linalg.norm(short))
    assert relative(short, limit) / 3.0 < of_datum_alone < 3.0 * relative(short, limit)


# -- what the search makes of it ----------------------------------------------------------------------


def test_not_reached_where_gap_and_domain_take_all_of_it() -> None:
    search = seeking(narrow(accuracy=0.01, accuracy_includes="all"))
    assert search.allowed == 0.01
    search.suited = Suited(search.scene, (), 0.004)
    assert search.allowed == pytest.approx(0.006)
    search.conclude(0.005)
    assert (search.reason, search.met) == ("reached", True)
    search.suited = Suited(
        search.scene, (), 0.02, "the error of the gap, 2.0e-02, cannot be reduced"
    )
    assert search.allowed == pytest.approx(0.005)
    search.conclude(0.005)
    assert search.reason == "not reached: the error of the gap, 2.0e-02, cannot be reduced"
    assert not search.met


def test_an_error_that_is_not_estimated_is_not_reached() -> None:
    """A bed of points is known only as far as they reach."""
    polyline = 'bed={kind="polyline", points=[[-1, 0], [30, 0]]}'
    scene = on_bed(polyline, "numerics.accuracy=0.01", ALL)
    search = seeking(scene)
    search.suited = Suited(scene, (), 0.001)
    search.conclude(0.001)
    assert search.reason.startswith("not known to be reached: that of the domain is not estimated")
    assert not search.met


def test_a_budget_is_kept() -> None:
    """No coarse run is begun; the first mesh is solved on, and the result says that the rest is not known."""
    scene = narrow(accuracy=0.01, accuracy_includes="all", budget_seconds=1e-9)
    result = incipient.run(scene, comm=MPI.COMM_SELF)
    found = result.adaptation
    assert found is not None and not found.met and found.reached is None
    assert "numerics.budget_seconds" in found.reason
    assert result.scene["domain"] == scene.model_dump(mode="json")["domain"]


def test_what_it_includes_needs_an_accuracy() -> None:
    with pytest.raises(SceneError, match=r"numerics\.accuracy_includes: .*add numerics\.accuracy"):
        on_bed(ALL)


def test_a_threshold_does_not_choose_gap_and_domain() -> None:
    scene = narrow(accuracy=0.01, accuracy_includes="all")
    with pytest.raises(SceneError, match=r"numerics\.accuracy_includes: .*leave it out"):
        to_accuracy(scene, MPI.COMM_SELF, Silent(), lambda *found: None)


@pytest.mark.slow
def test_all_errors_of_flow_in_time() -> None:
    """A disc in a stream that starts from Stokes flow: the domain is chosen, then mesh and steps."""
    stream = (
        '[domain]\nlength=8\nheight=4\n[fluid]\nreynolds=20\nscale="grain"\n[flow]\nkind="uniform"\n'
        '[body]\nshape="disc"\ndiameter=1\ncentre=[3.0, 2.0]\n[numerics]\nmesh_size=2.0\n'
    )
    still = loads(stream)
    timed = Scene(**{**still.model_dump(), "time": Time(end=0.8, step=0.1, start="steady")})
    scene = changed(timed, numerics={"accuracy": 0.05, "accuracy_includes": "all"})
    result = incipient.run(scene, comm=MPI.COMM_SELF)
    found = result.adaptation
    assert found is not None and found.met and found.includes == ("discretisation", "domain")
    assert result.scene["domain"]["height"] > 6.0
    middle = {"origin": [-57.0, -58.0], "length": 120.0, "height": 120.0}
    true = loads_of(
        changed(still, domain=middle, numerics={"error_bars": False, "mesh_size": 1.0}),
        MPI.COMM_SELF,
    )
    assert result.force is not None and relative(result.force.flow, true.force) < 0.05


def test_a_gap_is_not_closed_where_its_error_is_that_of_coarse_meshes() -> None:
    """A smaller gap whose error is no smaller is given up for the one before, and the search says so."""
    wide = on_bed(*SETTLED, "numerics.accuracy=0.01", ALL)
    narrow = changed(wide, contact={"gap": 0.001})
    before, found = (
        Suited(scene, errors={"gap": error, "domain": 1e-4})
        for scene, error in ((wide, 2e-3), (narrow, 2.5e-3))
    )
    assert _is_noise(before, found)
    assert not _is_noise(before, replace(found, errors={"gap": 1e-3}))
    assert not _is_noise(before, replace(found, scene=farther(narrow)))
    assert not _is_noise(Suited(wide), found)
