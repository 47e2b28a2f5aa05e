"""Error bars on force, torque, safety factor and verdict, elevations, and u* at walls.

Terms (see `terms`) are added in absolute value: an error bar is not a standard deviation.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError, IncipientError
from ..results.errorbars import ErrorBars, Loads, Term, sizes
from ..scene import Scene
from ..simulation.loads import load_of
from ..simulation.steady import unit_of
from .coarse_runs import Solve, coarse, is_coarse, kept_runs, moves_mesh
from .terms import (
    MODEL,
    Estimator,
    by_both,
    by_coarse_runs,
    by_dual,
    is_corrected,
    not_there,
    of_the_model,
)

if TYPE_CHECKING:
    from ..simulation.moved_mesh import MovedMesh
    from ..simulation.state import Run

# Error of loads in elements of order 3 or 4 over their difference from order 2 on the same mesh: if at most a third of
# the second-order error is left, at most half of the difference is (0.34 at most measured).
LEFT = 0.5
# Change of a correction in an otherwise corrected scene, over its product with the other relative correction (2.9 for
# gap and domain of an ellipse in Stokes flow, make calibration).
INTERACTING = 3.0


def error_bars(run: Run, computed: Loads, on_coarse_cells: bool = False) -> ErrorBars:
    """Error bars of a finished run, including the safety factor; see `error_terms`. Collective."""
    terms = error_terms(run, computed, on_coarse_cells=on_coarse_cells)
    return with_safety(terms, run, computed.load)


def error_terms(
    run: Run, computed: Loads, speed: float = 1.0, on_coarse_cells: bool = False
) -> ErrorBars:
    """Error bars without the safety factor. Collective.

    A term whose coarse runs fail is omitted with the reason. Estimates in `run.accounts` are reused.

    Args:
        speed: of the steady flow over the scene's.
        on_coarse_cells: whether the cells of the run may be larger than those of the coarse runs.
    """
    scene, accounts, failed = run.scene, run.accounts, dict[str, str]()
    computed, left_out = replace(computed, moved=on_coarse_cells), not_there(scene)
    if scene.is_averaged and scene.time is None and is_coarse(scene):
        accounts.loads[coarse(scene).model_dump_json()] = computed
    estimates = _of_run(run, speed, computed) | of_the_model(scene, speed)
    if "discretisation" not in estimates:
        left_out["separation"] = "none along the bed"
    kept = kept_runs(accounts.loads, accounts.spent, nearby(run, speed))
    for name, estimate in estimates.items():
        try:
            if name not in accounts.terms:
                accounts.terms[name] = estimate(computed, kept)
        except IncipientError as error:
            failed[name] = str(error)
    terms = tuple(accounts.terms[name] for name in estimates if name not in failed)
    between = of_interaction(terms, computed)
    return ErrorBars(terms if between is None else (*terms, between), left_out, failed)


def with_safety(bars: ErrorBars, run: Run, load: Floats) -> ErrorBars:
    """The bars with the range of the safety factor under a load (6,) after its correction. Collective.

    In turbulent flow nothing is conclusive: implementations of one model differ in their loads.
    """
    contact = run.scene.contact
    if run.contacts is None or contact is None or run.scene.mass is None or not bars.terms:
        return bars
    errors = {term.name: term.load for term in bars.terms}
    from .goal import bar_of_safety  # which loads linear programs, slowly

    change = 0.0 if bars.correction is None else bars.correction
    bar = bar_of_safety(load_of(run.scene, load + change), run.contacts, contact.law, errors)
    if (walls := run.wall_report()) is not None:
        decisive = "turbulence model at grains, which no finer mesh reduces (docs/explanation/turbulence.md)"
        if walls.doubt:
            decisive = "cells along the walls, which do not resolve their friction"
        if not walls.converged:
            decisive = "flow, which has not converged"
        bar = replace(bar, certain=False, decisive=decisive)
    if bars.doubtful:
        bar = replace(bar, certain=False, decisive=bars.doubtful)
    unknown = (*bars.failed, *({MODEL} & bars.left_out.keys()))
    return replace(bars, safety=replace(bar, unknown=unknown))


def _of_run(run: Run, speed: float, computed: Loads) -> dict[str, Estimator]:
    def discretisation(computed: Loads, solve: Solve) -> Term:
        return _by_surplus(run, speed) if run.fluid.coarse else _dual(run, speed)

    def not_steady(computed: Loads, solve: Solve) -> Term:
        how = "by how much loads change in the last steps"
        return Term("not steady", computed.unsteady, how)

    def pocket(computed: Loads, solve: Solve) -> Term:
        assert run.probe is not None and run.probe.enclosed is not None
        unknown = np.concatenate(run.probe.enclosed.unknown(run.probe.about))
        how = "between contacts the pressure upstream or downstream of them, instead of the mean"
        return Term("pocket", speed**2 * unknown, how)

    estimators: dict[str, Estimator] = {}
    separates = len(computed.others.get("separated", ())) > 0
    if separates or not run.scene.has_separation:
        estimators["discretisation"] = by_coarse_runs(run.scene) or discretisation
    if computed.unsteady.any():
        estimators["not steady"] = not_steady
    encloses = run.probe is not None and run.probe.enclosed is not None
    if encloses and len(run.contacts or ()) > 1:
        estimators["pocket"] = pocket
    return estimators


def _dual(run: Run, speed: float) -> Term:
    from .dual import errors_of_run, improved_loads  # plans need no finite elements

    with errors_of_run(run, speed) as goals:
        term = by_dual(goals)
    # An error of 0.1% is not worth another run.
    least = 1e-3 * goals.allowance * np.linalg.norm(goals.computed.force)
    small = np.linalg.norm(term.force) < least
    chosen = run.scene.numerics.accuracy is not None  # cells chosen for an error
    as_it_is = small or chosen or bool(term.doubt)
    if as_it_is or run.accounts.spent() or not is_corrected(run.scene):
        return term
    try:
        return by_both(term, goals, improved_loads(run.scene, run.comm, speed))
    except IncipientError as error:
        return replace(term, how=f"{term.how}; not corrected, larger cells: {error}")


def nearby(run: Run, speed: float) -> Solve:
    """Loads at a speed in scenes with other gaps and domains, on the run's moved mesh or on their own."""
    from ..simulation.simulate import loads_of

    @cache
    def moved() -> dict[str, MovedMesh]:
        if not moves_mesh(run.scene):
            return {}
        from ..simulation.moved_mesh import moved_meshes

        return moved_meshes(run, coarse_scenes(run.scene))

    def solve(other: Scene) -> Loads:
        mesh = moved().get(other.model_dump_json())
        if mesh is not None:
            return mesh.loads(speed)
        return loads_of(other, run.comm, speed, near=run if other.time is None else None)

    return solve


def _by_surplus(run: Run, speed: float) -> Term:
    """The discretisation term from the change of the loads from second-order elements.

    Components that do not vanish because of symmetry get equal errors: one may change little by chance.
    """
    from ..coupled.tractions import TractionProbe

    placement, rough = run.layout.placement, run.fluid.coarse
    assert placement is not None and rough is not None and run.probe is not None
    fine, other = run.probe.resultant(), TractionProbe(rough, "body", placement.centre).resultant()
    load = LEFT * unit_of(run, speed) * np.abs(fine.load - other.load)
    how = f"{LEFT:g} of the change from order 2 to order {run.plan.order} on the same mesh"
    return Term("discretisation", load, how).with_components_alike()


def of_interaction(terms: tuple[Term, ...], computed: Loads) -> Term | None:
    """Interaction of corrections, from the products of their relative values; None for fewer than two."""
    changes = [term.correction for term in terms if term.correction is not None]
    if len(changes) < 2:
        return None
    size = sizes(computed.load)
    size[size == 0.0] = np.inf
    relative = [np.minimum(sizes(change) / size, 1.0) for change in changes]
    pairs = combinations(zip(np.abs(changes), relative, strict=True), 2)
    products = [np.maximum(a * of_b, b * of_a) for (a, of_a), (b, of_b) in pairs]
    how = (
        f"each correction changed by {INTERACTING:g} times as much as another one changes the load"
    )
    return Term("interaction", INTERACTING * np.sum(products, axis=0), how)


def coarse_scenes(scene: Scene) -> list[Scene]:
    """Distinct scenes of the coarse runs for a scene's error bars."""
    wanted: dict[str, Scene] = {}
    nothing = Loads(np.zeros(6))

    def note(coarse: Scene) -> Loads:
        wanted[coarse.model_dump_json()] = coarse
        return nothing

    for estimate in (by_coarse_runs(scene), *of_the_model(scene).values()):
        with suppress(ConvergenceError):  # a failed term needs no runs
            if estimate is not None:
                estimate(nothing, note)
    return list(wanted.values())
