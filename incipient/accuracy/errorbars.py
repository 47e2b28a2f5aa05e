"""Error bars on force, torque, safety factor and verdict, elevations, and u* at walls.

Terms (see `terms`) are added in absolute value: an error bar is not a standard deviation.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import IncipientError
from ..geometry.space.grains import Triangulated
from ..results.errorbars import ErrorBars, Loads, Term, sizes
from ..scene import Scene
from ..setup.setup import Setup
from ..simulation.loads import load_of
from ..simulation.steady import unit_of
from .coarse_runs import Solve, coarse, is_coarse, kept_runs, moves_mesh
from .terms import (
    MODEL,
    ROUND_OFF,
    Estimators,
    by_coarse_runs,
    is_corrected,
    terms_of_model,
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


def error_bars(run: Run, computed: Loads) -> ErrorBars:
    """Error bars of a finished run, including the safety factor; see `error_terms`. Collective."""
    return with_safety(error_terms(run, computed), run, computed.load)


def error_terms(run: Run, computed: Loads, speed: float = 1.0) -> ErrorBars:
    """Error bars without the safety factor, in a steady flow `speed` times the scene's. Collective.

    A term whose coarse runs fail is omitted with the reason. Estimates in `run.accounts` are reused.
    """
    scene, accounts = run.scene, run.accounts
    # Cells of a search for all errors may be larger than those of coarse runs.
    searches = scene.numerics.accuracy_includes == "all" and scene.numerics.accuracy != "verdict"
    computed = replace(computed, moved=searches)
    if scene.is_averaged and scene.time is None and is_coarse(scene):
        accounts.loads[coarse(scene).model_dump_json()] = computed
    of_elements = partial(_by_surplus if run.fluid.coarse else _dual, run, speed)
    estimates: Estimators = {"discretisation": by_coarse_runs(scene) or of_elements}
    estimates |= _of_flow(run, speed, computed) | terms_of_model(scene, speed)
    if scene.has_separation and not len(computed.others.get("separated", ())):
        estimates |= {"discretisation": "", "separation": "none along the bed"}
    solve = kept_runs(accounts.loads, accounts.spent, nearby(run, speed))
    return estimated(estimates, accounts.terms, computed, solve)


def estimated(
    estimates: Estimators, known: dict[str, Term], computed: Loads, solve: Solve
) -> ErrorBars:
    """Error bars of loads; new terms are added to the `known`."""
    failed: dict[str, str] = {}
    for name, estimate in estimates.items():
        try:
            if isinstance(estimate, Term):
                known[name] = estimate
            elif name not in known and callable(estimate):
                known[name] = estimate(computed, solve)
        except IncipientError as error:
            failed[name] = str(error)
    left_out = {name: why for name, why in estimates.items() if isinstance(why, str) and why}
    terms = tuple(known[name] for name in estimates if name in known)
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
    decisive = next((term.name for term in bars.terms if term.doubt), "")
    walls = run.wall_report()
    if walls is not None and not decisive:
        decisive = "turbulence model at grains, which no finer mesh reduces (docs/explanation/turbulence.md)"
        if walls.doubt:
            decisive = "cells along the walls, which do not resolve their friction"
        if not walls.converged:
            decisive = "flow, which has not converged"
    if decisive:
        bar = replace(bar, certain=False, decisive=decisive)
    unknown = (*bars.failed, *({MODEL} & bars.left_out.keys()))
    return replace(bars, safety=replace(bar, unknown=unknown))


def _of_flow(run: Run, speed: float, computed: Loads) -> Estimators:
    """Terms that need no further run."""
    terms: Estimators = {}
    scene = run.scene
    if computed.unsteady.any():
        terms["not steady"] = Term(
            "not steady", computed.unsteady, "by how much loads change in the last steps"
        )
    probe = run.probe
    if probe is not None and probe.enclosed is not None and len(run.contacts or ()) > 1:
        unknown = np.concatenate(probe.enclosed.unknown(probe.about))
        terms["pocket"] = Term(
            "pocket",
            speed**2 * unknown,
            "between contacts the pressure upstream or downstream of them, instead of the mean",
        )
    if isinstance(scene.grain, Triangulated):
        meshed = run.fluid.domain.enclosed_by("body", scene.domain.middle)
        halves = 2.0 if Setup(scene).symmetric else 1.0
        kept = halves * meshed / scene.grain.volume
        if abs(1.0 - kept) > ROUND_OFF:
            # Forces on similar grains in a shear grow as their area, torques as their volume.
            shares = np.abs(1.0 - kept ** np.repeat([2.0 / 3.0, 1.0], 3))
            terms["facets"] = Term(
                "facets",
                shares * sizes(computed.load) * (computed.load != 0.0),
                f"{1.0 - kept:.1e} of the volume of the scan, which the facets of the mesh cut off",
            )
    return terms


def _dual(run: Run, speed: float, computed: Loads, solve: Solve) -> Term:
    from .dual import (  # plans need no finite elements
        by_both,
        by_dual,
        errors_of_run,
        improved_loads,
    )

    with errors_of_run(run, speed) as goals:
        term = by_dual(goals)
    # An error of 0.1% is not worth another run.
    least = 1e-3 * goals.allowance * np.linalg.norm(goals.computed.force)
    as_it_is = np.linalg.norm(term.force) < least or term.doubt or run.accounts.spent()
    if as_it_is or not is_corrected(run.scene):
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


def _by_surplus(run: Run, speed: float, computed: Loads, solve: Solve) -> Term:
    """The discretisation term from the change of the loads from second-order elements.

    Components that do not vanish because of symmetry get equal errors: one may change little by chance.
    """
    from ..coupled.tractions import TractionProbe

    placement, rough = run.layout.placement, run.fluid.coarse
    assert placement is not None and rough is not None and run.probe is not None
    fine, other = run.probe.resultant(), TractionProbe(rough, "body", placement.centre).resultant()
    return Term(
        "discretisation",
        LEFT * unit_of(run, speed) * np.abs(fine.load - other.load),
        f"{LEFT:g} of the change from order 2 to order {run.plan.order} on the same mesh",
    ).with_components_alike()


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
    return Term(
        "interaction",
        INTERACTING * np.sum(products, axis=0),
        f"each correction changed by {INTERACTING:g} times as much as another one changes the load",
    )


def coarse_scenes(scene: Scene) -> list[Scene]:
    """Distinct scenes of the coarse runs for a scene's error bars."""
    wanted: dict[str, Scene] = {}
    nothing = Loads(np.zeros(6))

    def note(coarse: Scene) -> Loads:
        wanted[coarse.model_dump_json()] = coarse
        return nothing

    estimates = {"discretisation": by_coarse_runs(scene) or ""} | terms_of_model(scene)
    estimated(estimates, {}, nothing, note)
    return list(wanted.values())
