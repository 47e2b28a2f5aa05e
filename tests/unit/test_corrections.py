"""Loads corrected by their estimated errors: against laws whose limit is known, and what follows from them."""

from __future__ import annotations

import json
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import CARRIED

import incipient
from incipient.accuracy.coarse_runs import changed
from incipient.accuracy.errorbars import of_interaction
from incipient.accuracy.kept_runs import Solve
from incipient.accuracy.model_terms import is_corrected, of_domain, of_gap
from incipient.errors import ConvergenceError
from incipient.results.errorbars import Correction, ErrorBars, Loads, Term
from incipient.scene import Scene, load, loads
from incipient.scene.example import grain_in_pocket, grain_on_bed
from incipient.threshold.critical import find_threshold

NONE = np.zeros(3)
SCENES = Path(__file__).parents[2] / "demos" / "scenes"
POCKET = """
[domain]
length = 16.0
height = 10.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 1.0
x = 7.6
settle = true
density = 2.65
[gravity]
acceleration = 10.0
[contact]
friction = 0.5
[bed]
kind = "half-discs"
radius = 0.5
spacing = 1.2
offset = 1.0
[output]
fields = false
"""


def term(force: Any, couple: Any = NONE) -> Term:
    return Term("gap", np.asarray(force, dtype=float), np.asarray(couple, dtype=float), "")


# -- one term -----------------------------------------------------------------------------------------


def test_the_force_is_corrected_and_a_couple_that_is_not_known_better_is_not() -> None:
    """Two ways agree to a tenth of the force's change, and hardly on that of the couple."""
    change, left = np.array([0.3, 0.4, 0, 0, 0, 0.1]), np.array([0.03, 0.04, 0, 0, 0, 0.2])
    found = term([0.3, 0.4, 0.0], [0.0, 0.0, 0.1]).corrected(change, left)
    assert found.correction is not None
    assert found.correction.force.tolist() == [0.3, 0.4, 0.0] and not found.correction.couple.any()
    assert found.force == pytest.approx([0.03, 0.04, 0.0]) and found.couple == pytest.approx(
        [0, 0, 0.2]
    )


def test_a_component_on_which_two_ways_agree_by_chance_is_not_taken_to_be_certain() -> None:
    change, left = np.array([0.3, 0.4, 0, 0, 0, 0]), np.array([0.1, 0.0, 0, 0, 0, 0])
    found = term([0.3, 0.4, 0.0]).corrected(change, left)
    assert found.force == pytest.approx([0.1, 0.08, 0.0])  # a fifth of the change, as of the vector


def test_what_two_ways_do_not_agree_on_makes_the_bar_larger() -> None:
    found = term([0.3, 0.0, 0.0]).corrected(
        np.array([0.3, 0, 0, 0, 0, 0]), np.array([0.5, 0, 0, 0, 0, 0])
    )
    assert found.correction is None and found.force[0] == 0.5


def test_without_its_correction_a_term_is_as_estimated() -> None:
    found = term([0.3, 0.0, 0.0]).corrected(
        np.array([-0.3, 0, 0, 0, 0, 0]), np.array([0.1, 0, 0, 0, 0, 0])
    )
    assert found.uncorrected.force[0] == 0.3 and found.uncorrected.correction is None


# -- gap and domain -----------------------------------------------------------------------------------


def by_gap(*coefficients: float) -> Solve:
    def solve(scene: Scene) -> Loads:
        assert scene.contact is not None
        value = np.polynomial.polynomial.polyval(scene.contact.gap, coefficients)
        return Loads(np.array([value, 0.0, 0.0]), NONE, moved=True)

    return solve


@pytest.mark.parametrize("gap", [0.01, 0.05])
def test_a_load_that_is_a_parabola_of_the_gap_is_corrected_to_that_without(gap: float) -> None:
    scene, solve = changed(grain_on_bed(), contact={"gap": gap}), by_gap(1.0, 2.0, 10.0)
    found = of_gap(scene, solve, solve(scene))
    assert found.correction is not None
    assert solve(scene).force[0] + found.correction.force[0] == pytest.approx(1.0, abs=1e-12)
    assert 0.0 < found.force[0] < abs(found.correction.force[0])


def by_distance(power: float) -> Solve:
    def solve(scene: Scene) -> Loads:
        return Loads(
            np.array([1.0 + 0.01 * (scene.domain.length / 24.0) ** -power, 0, 0]), NONE, moved=True
        )

    return solve


@pytest.mark.parametrize("power", [1.5, 1.75, 2.0])
def test_a_load_that_falls_off_with_the_sides_is_corrected_to_that_without(power: float) -> None:
    """The power, between three quarters of the expected one and that, is seen in the loads."""
    scene, solve = grain_on_bed(), by_distance(power)
    found = of_domain(scene, solve, computed=solve(scene))
    assert found.correction is not None
    assert found.correction.force[0] == pytest.approx(-0.01, rel=1e-9)
    assert 1e-5 < found.force[0] < 0.005


def test_slower_decay_is_seen_by_the_bar() -> None:
    """The rest of an influence that falls off as one over the distance is within the bar."""
    scene, solve = grain_on_bed(), by_distance(1.0)
    found = of_domain(scene, solve, computed=solve(scene))
    assert found.correction is not None
    assert 0.0 < 0.01 + found.correction.force[0] <= found.force[0]


def test_a_load_that_does_not_settle_as_sides_move_away_has_no_bar() -> None:
    scene = grain_on_bed()
    with pytest.raises(ConvergenceError, match=r"^the sides 1\.5 times as far change the force by"):
        of_domain(scene, by_distance(-1.0), computed=by_distance(-1.0)(scene))


def test_without_sides_farther_away_still_nothing_is_corrected() -> None:
    def solve(scene: Scene) -> Loads:
        if scene.domain.length > 40.0:
            raise ConvergenceError("no steady flow found")
        return by_distance(2.0)(scene)

    found = of_domain(grain_on_bed(), solve)
    assert found.correction is None and found.how.endswith(
        "not corrected, sides 2.25 times as far: no steady flow found"
    )
    assert found.force[0] == pytest.approx(0.01, rel=1e-9)


def test_coarse_runs_on_meshes_of_their_own_are_off_by_what_they_differ_by() -> None:
    scene, solve = grain_on_bed(), by_gap(1.0, 2.0)
    computed = replace(solve(scene), force=np.add(solve(scene).force, [1e-3, 0.0, 0.0]))
    plain, noisy = (
        of_gap(scene, lambda one, m=m: replace(solve(one), moved=m), computed)
        for m in (True, False)
    )
    assert noisy.force[0] - plain.force[0] == pytest.approx(1e-3)


def test_corrections_interact() -> None:
    """Each changes the other by as much as it changes the load."""
    one, other = (Correction(np.array(x), NONE) for x in ([0.1, 0.0, 0.0], [0.0, 0.02, 0.0]))
    terms = tuple(
        Term(name, NONE, NONE, "", correction=c) for name, c in (("gap", one), ("domain", other))
    )
    found = of_interaction(ErrorBars(terms), Loads(np.array([1.0, 0.0, 0.0]), NONE))
    assert found is not None and found.force == pytest.approx([0.002, 0.002, 0.0])
    assert of_interaction(ErrorBars(terms[:1]), Loads(np.ones(3), NONE)) is None


def test_what_has_not_shown_what_it_is_worth_is_not_corrected() -> None:
    assert is_corrected(grain_on_bed()) and is_corrected(grain_in_pocket())
    assert not is_corrected(changed(grain_on_bed(), numerics={"correction": False}))
    assert not is_corrected(loads(CARRIED))


# -- a run, and a threshold ----------------------------------------------------------------------------


def test_all_of_a_result_is_of_the_corrected_load(tmp_path: Path) -> None:
    """The verdict and the coefficients are those of the corrected load; without corrections all is as computed."""
    scene = loads(POCKET, overrides=("numerics.mesh_size=2",))
    found = incipient.run(scene, tmp_path, MPI.COMM_SELF, overwrite=True)
    plain = incipient.run(changed(scene, numerics={"correction": False}), comm=MPI.COMM_SELF)
    assert found.force is not None and plain.force is not None and found.couple is not None
    assert (
        found.error_bars is not None
        and plain.error_bars is not None
        and plain.error_bars.correction is None
    )
    np.testing.assert_allclose(found.force.plain, plain.force.flow, rtol=1e-8)
    change = found.error_bars.correction
    assert change is not None
    np.testing.assert_array_equal(found.force.flow, found.force.plain + change.force)
    assert np.linalg.norm(found.error_bars.force) < 1 / 3 * np.linalg.norm(plain.error_bars.force)
    assert found.coefficients is not None and plain.coefficients is not None
    ratio = found.coefficients.drag / plain.coefficients.drag
    assert ratio == pytest.approx(found.force.flow[0] / plain.force.flow[0], rel=1e-8)
    assert found.verdict is not None and plain.verdict is not None
    low, high = (getattr(plain.error_bars.safety, end) for end in ("low", "high"))
    assert low < found.verdict["safety_factor"] < high
    assert found.verdict["safety_factor"] != pytest.approx(plain.verdict["safety_factor"], rel=1e-3)
    bar = found.error_bars.safety
    assert (
        bar is not None
        and bar.value == found.verdict["safety_factor"]
        and bar.high - bar.low < 0.4 * (high - low)
    )
    assert "corrected for gap" in found.text() and "corrected for" not in plain.text()
    stored = json.loads((tmp_path / "result.json").read_text())
    assert stored["force"]["computed"] == found.force.plain.tolist()
    by_name = {one["name"]: one for one in stored["error_bars"]["terms"]}
    assert (
        by_name["gap"]["correction"]["force"][0] < 0.0
        and by_name["interaction"]["correction"] is None
    )


@pytest.mark.slow
def test_the_threshold_is_of_the_corrected_load() -> None:
    """The tutorial's pocket, 2.953 without gap in a large domain (`CONVERGED` of end_to_end/test_critical_flow.py)."""
    found = find_threshold(loads(POCKET), MPI.COMM_SELF)
    assert found.bars is not None and found.computed is not None
    assert found.bars.error < 0.04 and found.computed < 2.88
    assert abs(found.factor - 2.953) < found.bars.error
    assert f"(computed {found.computed:.4g})" in found.text()


@pytest.mark.slow
def test_the_search_for_an_accuracy_stops_on_the_bar_of_the_corrected_load() -> None:
    """The load is right to what is told, corrected where improved loads on the last two meshes agree well enough."""
    scene = changed(grain_on_bed(), numerics={"accuracy": 3e-5}, output={"fields": False})
    found = incipient.run(scene, comm=MPI.COMM_SELF)
    assert found.adaptation is not None and found.adaptation.met and found.error_bars is not None
    (term,) = (one for one in found.error_bars.terms if one.name == "discretisation")
    assert found.force is not None
    on_mesh = np.array(
        [1.3548632, 0.7185489]
    )  # order 4, mesh_size 0.5, improved by its own estimate
    change = 0.0 if term.correction is None else term.correction.force[:2]
    assert (
        np.linalg.norm(found.force.plain[:2] + change - on_mesh) < np.linalg.norm(term.force) + 2e-6
    )


@pytest.mark.slow
def test_a_sphere_that_touches_a_plane() -> None:
    """Corrected for gap and domain the loads are those of contact.

    1.7009 times 6 pi mu a G h and 0.944 times 4 pi mu a^3 G (O'Neill 1968, Chem. Eng. Sci. 23, 1293).
    """
    scene = load(SCENES / "sphere_on_plane.toml", ["output.fields=false"])
    found = incipient.run(scene, comm=MPI.COMM_SELF)
    assert found.force is not None and found.couple is not None and found.error_bars is not None
    force, couple = 6.0 * pi * scene.viscosity * 0.5 * 0.5, 4.0 * pi * scene.viscosity * 0.5**3
    assert abs(found.force.flow[0] - 1.7009 * force) < min(
        found.error_bars.force[0], 0.001 * found.force.flow[0]
    )
    assert abs(found.couple.flow[1] - 0.944 * couple) < min(
        found.error_bars.couple[1], 0.001 * couple
    )
    assert found.force.plain[0] > 1.01 * found.force.flow[0]  # with the gap of 1%
