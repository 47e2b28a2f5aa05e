"""Error bars on force, couple, safety factor and verdict, elevations, and u* at walls, estimated by the run itself.

Each source of error is a term of its own:

- discretisation: steady flow by the dual-weighted residual (`dual`), or from two orders where both are at hand, with
  turbulence by the same run on two coarser meshes; flow in time, or a moving grain, by the same run in longer steps,
  and by one in elements of one order more, with turbulence on a coarser mesh, as well: what is the step's, and the
  mesh's; steady velocities in a lid-driven box, and separation of laminar flow along a bed, by the same run on two
  coarser meshes;
- gap: a grain at rest on a bed is computed with a gap. Coarse runs with one, two and four times the gap show
  how force and couple go with it, and what closing it would change. Where the space next to contacts is closed, a
  coarse run in which it is closed four times as widely shows what that changes;
- pocket: what is enclosed between two contacts may have the pressure on either side of them;
- domain: a coarse run with inflow, outflow and sides that move as the stream does farther away shows what they change;
- datum: over a bed with forms a coarse run whose stream starts where it may as well shows what the scene's changes;
- not steady: by how much the loads change in the last steps of a mean flow in space that changes for ever;
- level ground: a run of steady flow in space with a larger part of its bed meshed as it is shows what the rest changes.

For flow in time the coarse runs go to the same end, in longer steps. Terms are added in absolute value: an error bar
is not a standard deviation.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConvergenceError, IncipientError
from ..results.errorbars import ErrorBars, Loads, Term, centreline_velocities
from ..results.loads import Couples, Forces
from ..scene import Scene
from .coarse_runs import coarse, is_coarse
from .discretisation import (
    OF_MESH,
    by_both,
    by_coarser_mesh,
    by_coarser_runs,
    by_dual,
    without_grain,
)
from .kept_runs import KeptRuns, Solve
from .model_terms import (
    GROUND,
    MODEL,
    is_corrected,
    not_there,
    of_level_ground,
    of_the_model,
    on_more_bed,
)

if TYPE_CHECKING:
    from ..simulation.state import Run

# Error of loads over what their elements change in those of order two on the same mesh (docs/space.md).
LEFT = 0.35
SMALL = 1e-3  # of the force: an error of the discretisation that is not worth another run
POCKET, INTERACTION, UNSTEADY = "pocket", "interaction", "not steady"
OF_MODEL = "turbulence model at grains, which no finer mesh reduces (docs/large_grains.md)"


def error_bars(
    run: Run,
    force: Forces | None,
    couple: Couples | None,
    solve: Solve,
    improve: Solve | None = None,
) -> ErrorBars:
    """The error bars of a finished run with a grain or a free surface. Collective.

    Coarse runs of their own are made where needed; where one fails the term is left out, and the reason said. What
    `run.accounts.known` holds is not computed again, and what is found is added to it. `solve` runs the scene of a
    coarse run for its loads.
    """
    return with_safety(error_terms(run, force, couple, solve, improve=improve), run, force, couple)


def error_terms(
    run: Run,
    force: Forces | None,
    couple: Couples | None,
    solve: Solve,
    speed: float = 1.0,
    improve: Solve | None = None,
) -> ErrorBars:
    """Error bars but for what they mean for the verdict; a steady flow may be `speed` times the scene's. Collective.

    `improve` gives loads on coarser cells less their estimated errors; without it the discretisation is not corrected.
    """
    scene, found = run.scene, _Found(run, solve)
    if scene.is_averaged and scene.time is None:
        computed = _computed(run, force, couple)
        found.add("discretisation", partial(by_coarser_mesh, scene, computed))
        if is_coarse(scene):
            run.accounts.known.loads[coarse(scene).model_dump_json()] = computed
    elif scene.time is None and (scene.has_centrelines or scene.has_separation):
        computed = _computed(run, force, couple)
        if computed.separated is not None and not len(computed.separated):
            found.left_out["separation"] = "none along the bed"
        else:
            found.add("discretisation", partial(without_grain, scene, computed))
    elif scene.time is None:
        of_mesh = partial(_dual, improve=improve) if run.fluid.coarse is None else _by_surplus
        found.add("discretisation", lambda _: of_mesh(run, speed))
    else:
        computed = _computed(run, force, couple)
        known = run.accounts.known.terms.get(OF_MESH)
        found.add("discretisation", partial(by_coarser_runs, scene, computed, of_mesh=known))
    found.left_out |= not_there(scene)
    at_hand = None if force is None else _computed(run, force, couple)
    if at_hand is not None and at_hand.unsteady.any():
        errors = at_hand.unsteady[:3], at_hand.unsteady[3:]
        found.add(
            UNSTEADY,
            lambda _: Term(UNSTEADY, *errors, "by how much loads change in the last steps"),
        )
    for name, estimate in of_the_model(scene, speed, at_hand).items():
        found.add(name, estimate)
    if run.probe is not None and run.probe.enclosed is not None and len(run.contacts or ()) > 1:
        found.add(POCKET, lambda _: _of_pocket(run, speed))
    if (wider := on_more_bed(scene)) is not None:
        found.add(GROUND, partial(of_level_ground, wider, _computed(run, force, couple)))
    bars = found.bars()
    if at_hand is not None and (between := of_interaction(bars, at_hand)) is not None:
        bars = replace(bars, terms=(*bars.terms, between))
    return bars


def with_safety(
    bars: ErrorBars, run: Run, force: Forces | None, couple: Couples | None
) -> ErrorBars:
    """The bars with the safety factor's, where there is a verdict and at least one term. Collective.

    It is that of the corrected loads. Nothing is certain of a grain in turbulent flow: another program with the same
    model finds other loads.
    """
    if run.contacts is None or force is None or couple is None or not bars.terms:
        return bars
    force, couple = bars.corrected(force, couple)
    errors = {term.name: np.concatenate([term.force, term.couple]) for term in bars.terms}
    from .safetybar import bar_of_scene  # which loads linear programs, slowly

    bar = bar_of_scene(run.scene, run.contacts, force, couple, errors)
    unknown = (*bars.failed, *({MODEL} & bars.left_out.keys()))
    if bar is not None and (walls := run.wall_report()) is not None:
        bar = replace(bar, certain=False, decisive=OF_MODEL if walls.applicable else walls.unsuited)
    if bar is not None and bars.doubtful:
        bar = replace(bar, certain=False, decisive=bars.doubtful)
    return replace(bars, safety=bar and replace(bar, unknown=unknown))


def _computed(run: Run, force: Forces | None, couple: Couples | None) -> Loads:
    """What a run has come to."""
    place = None
    if run.grain is not None:
        state = run.grain.state
        place = np.concatenate([state.place, state.orientation])
    from ..mesh.sampling import centrelines

    grain = run.scene.grain
    found = centrelines(run.scene.domain, run.fluid) if run.scene.has_centrelines else None
    lines = centreline_velocities(found)
    size = 1.0 if grain is None else grain.size
    walls, upstream = run.wall_report(), run.separated()
    loads = Loads.at_the_end(force, couple, place, run.elevations, walls, size, upstream)
    return replace(loads, centreline=lines)


def _dual(run: Run, speed: float, improve: Solve | None) -> Term:
    """The discretisation's term by the dual-weighted residual, corrected where that is worth a run on other cells."""
    from .dual import (
        GoalErrors,
    )  # not above: a plan asks for the coarse runs, without finite elements

    placement = run.layout.placement
    assert placement is not None
    with GoalErrors(run.fluid, "body", placement.centre) as goals:
        # The fluid's unit of speed is its own; what is left of the way to `speed` is short, or in Stokes flow.
        unit = goals.allowance * speed * run.fluid.reynolds / run.plan.reynolds
        term = by_dual(goals, unit)
    small = np.linalg.norm(term.force) < SMALL * unit * np.linalg.norm(goals.computed.force)
    chosen = run.scene.numerics.accuracy is not None  # cells, for an error that has been reached
    as_it_is = small or chosen or bool(term.doubt)
    if improve is None or as_it_is or run.accounts.spent() or not is_corrected(run.scene):
        return term
    try:
        return by_both(term, goals, unit, improve(run.scene))
    except IncipientError as error:
        return replace(term, how=f"{term.how}; not corrected, larger cells: {error}")


def _by_surplus(run: Run, speed: float) -> Term:
    """The discretisation's term from the change of the loads by elements of a higher order than two.

    Components may change little by chance: each is taken to err by the same, unless it vanishes by symmetry.
    """
    from ..coupled.tractions import TractionProbe

    placement, coarse = run.layout.placement, run.fluid.coarse
    assert placement is not None and coarse is not None and run.probe is not None
    unit = LEFT * speed * run.fluid.reynolds / run.plan.reynolds
    fine, rough = run.probe.resultant(), TractionProbe(coarse, "body", placement.centre).resultant()
    force, couple = (
        unit * float(np.linalg.norm(one - other)) * (one != 0.0)
        for one, other in ((fine.force, rough.force), (fine.couple, rough.couple))
    )
    how = f"{LEFT:g} of what order {run.plan.order} changes in order 2 on the same mesh"
    return Term("discretisation", force, couple, how)


def _of_pocket(run: Run, speed: float) -> Term:
    assert run.probe is not None and run.probe.enclosed is not None
    force, couple = run.probe.enclosed.unknown(run.probe.about)
    how = "between contacts the pressure upstream or downstream of them, in place of the mean"
    return Term(POCKET, speed**2 * force, speed**2 * couple, how)


class _Found:
    """Terms as they are found."""

    def __init__(self, run: Run, solve: Solve):
        self._known = run.accounts.known.terms
        self._solve = KeptRuns(run.accounts.known.loads, run.accounts.spent, solve)
        self._terms: list[Term] = []
        self.left_out: dict[str, str] = {}  # why there is no such term, by name
        self._failed: dict[str, str] = {}

    def add(self, name: str, estimate: Callable[[Solve], Term]) -> None:
        """Estimate a term, unless it is known; a failure is noted in its place. Collective."""
        try:
            if name not in self._known:
                self._known[name] = estimate(self._solve)
            self._terms.append(self._known[name])
        except IncipientError as error:
            self._failed[name] = str(error)

    def bars(self) -> ErrorBars:
        """All that has been found. Not collective."""
        return ErrorBars(tuple(self._terms), self.left_out, self._failed)


def of_interaction(bars: ErrorBars, computed: Loads) -> Term | None:
    """What corrections may change in each other, which are made one by one: each as much as the other does the load.

    None where fewer than two are made.
    """
    changes = [term.correction for term in bars.terms if term.correction is not None]
    if len(changes) < 2:
        return None
    errors = []
    for name in ("force", "couple"):
        found = [getattr(one, name) for one in changes]
        size = float(np.linalg.norm(getattr(computed, name))) or np.inf
        shares = [min(float(np.linalg.norm(one)) / size, 1.0) for one in found]
        pairs = combinations(zip(found, shares, strict=True), 2)
        errors.append(
            sum(np.maximum(np.abs(a) * of_b, np.abs(b) * of_a) for (a, of_a), (b, of_b) in pairs)
        )
    how = "each correction changed by as much as another one changes the load"
    return Term(INTERACTION, errors[0], errors[1], how)


def coarse_scenes(scene: Scene) -> list[Scene]:
    """The scenes of the coarse runs that the error bars of a scene need, each once. Not collective."""
    wanted: dict[str, Scene] = {}

    def note(coarse: Scene) -> Loads:
        """Keep what would be run, without running it."""
        wanted[coarse.model_dump_json()] = coarse
        return nothing

    nothing = Loads(np.zeros(3), np.zeros(3))
    with suppress(ConvergenceError):  # a term that is not computed needs no runs
        if scene.time is not None:
            by_coarser_runs(scene, nothing, note)
        elif scene.is_averaged:
            by_coarser_mesh(scene, nothing, note)
        elif scene.has_centrelines or scene.has_separation:
            without_grain(scene, nothing, note)
    for estimate in of_the_model(scene).values():
        estimate(note)
    if (wider := on_more_bed(scene)) is not None:
        note(wider)
    return list(wanted.values())
