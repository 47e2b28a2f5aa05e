"""Error bars on force, couple, safety factor and verdict, elevations, and u* at walls, estimated by the run itself.

Each source of error is a term of its own:

- discretisation: steady flow by the dual-weighted residual (`dual`), or from two orders where both are at hand, with
  turbulence by the same run on two coarser meshes; flow in time, or a moving grain, by the same run in longer steps,
  and by one in elements of one order more, with turbulence on a coarser mesh, as well: what is the step's, and the
  mesh's; steady velocities in a lid-driven box by the same run on two coarser meshes;
- gap: a grain at rest on a bed is computed with a gap. Coarse runs with one, two and four times the gap show
  how force and couple go with it, and what closing it would change. Where the space next to contacts is closed, a
  coarse run in which it is closed four times as widely shows what that changes;
- pocket: what is enclosed between two contacts may have the pressure on either side of them;
- domain: a coarse run with inflow, outflow and sides that move as the stream does farther away shows what they change;
- datum: over a bed with forms a coarse run whose stream starts where it may as well shows what the scene's changes;
- scan: how coarser copies of a grain or a bed from a file hold the load (`scans`);
- level ground: a run of steady flow in space with a larger part of its bed meshed as it is shows what the rest changes.

For flow in time the coarse runs go to the same end, in longer steps. Terms are added in absolute value: an error bar
is not a standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConvergenceError, IncipientError
from ..planning.flow_setup import Setup
from ..planning.meshed_bed import resolved_bed
from ..planning.wall_cells import coarsest
from ..results.errorbars import ErrorBars, Loads, Term, centreline_velocities
from ..results.loads import Couples, Forces
from ..scene import Contact, Scene
from ..scene.datum import effective_height, height_of_datum, starts_at_effective_height
from ..scene.model import WIDEST_GAP
from .coarse_runs import (
    COARSER_MESH,
    FARTHER,
    changed,
    coarse,
    comparisons,
    farther,
    is_coarse,
    on_another_mesh,
    on_coarser_mesh,
    order_in_time,
    ratio_of_steps,
)
from .far_sides import has_no_far_sides
from .kept_runs import KeptRuns, Solve
from .scans import SCAN, is_scanned, of_scans
from .waves import (
    LONGER_STEP,
    OF_FEW_STEPS,
    doubt_of_stream,
    enlarged,
    error_over_change,
    least_share,
    of_large_errors,
)

if TYPE_CHECKING:
    from ..simulation.state import Run
    from .dual import GoalErrors

# Error of loads over what their elements change in those of order two on the same mesh (docs/space.md).
LEFT = 0.35
DECAY = 2.0  # the influence of sides is taken to fall off like their distance to this power
DECAY_OVER_FORMS = 1.5  # there, by a stream that suits them: measured are 1.6 to 1.8 (docs/accuracy.md)
# How much larger the bed's part meshed as it is becomes, and the decay of what the rest changes (docs/space.md).
WIDER, DECAY_OF_GROUND = 1.5, 1.0
LARGER, SMALLER = (1.0, 2.0, 4.0), (0.25, 0.5, 1.0)  # gaps of three runs, relative to the scene's
# Part of both corrections against upwinding that the second one may be: were the next ones to fall as slowly, all of
# them together would be twice the first one.
SETTLED = 0.5
CLOSED_WIDER = 4.0  # how much wider the space next to contacts is that is closed in a coarse run
ORDERS = (0.3, 2.0)  # between which the order in the gap is believed
# Of runs with turbulence on coarser meshes: the order at which their errors are taken to fall at least, and at most.
# Those of u* over forms of a bed scatter rather than fall (docs/turbulence.md).
SLOWEST, FASTEST, SCATTERING = 1.0, 2.0, 0.0
OF_DRIVEN_BOXES = 2.0  # the order of velocities in a driven box (docs/space.md)
NOT_COARSER = (
    "coarser meshes have as few rows or columns of cells: use numerics.mesh_size = {finer:g} or less"
)
TOO_LITTLE = 1e-6  # of the largest of three loads: changes that tell no order
SAME_DATUM = 1e-6  # of the height of the forms
GROUND, MODEL, POCKET = "level ground", "turbulence model", "pocket"
LAW = "law of the wall, which is not applicable here"
OF_MODEL = "turbulence model at grains, which no finer mesh reduces (docs/large_grains.md)"
OF_MESH = "mesh"  # name of the part of the discretisation's term that outlasts a change of steps
NO_CONTACT = "does not apply: no grain rests on a bed"
MOVES = "does not apply: the grain moves, and contact.gap says where it stops"
REPELLED = "not estimated: the grain moves, and what keeps it away from walls is a model of its own"


def error_bars(run: Run, force: Forces | None, couple: Couples | None, solve: Solve) -> ErrorBars:
    """The error bars of a finished run with a grain or a free surface. Collective.

    Coarse runs of their own are made where needed; where one fails the term is left out, and the reason said. What
    `run.accounts.known` holds is not computed again, and what is found is added to it. `solve` runs the scene of a
    coarse run for its loads.
    """
    return with_safety(error_terms(run, force, couple, solve), run, force, couple)


def error_terms(
    run: Run, force: Forces | None, couple: Couples | None, solve: Solve, speed: float = 1.0
) -> ErrorBars:
    """Error bars but for what they mean for the verdict; a steady flow may be `speed` times the scene's. Collective."""
    scene, found = run.scene, _Found(run, solve)
    if scene.is_turbulent and scene.time is None:
        computed = _computed(run, force, couple)
        found.add("discretisation", partial(by_coarser_mesh, scene, computed))
        if is_coarse(scene):
            run.accounts.known.loads[coarse(scene).model_dump_json()] = computed
    elif scene.time is None and scene.has_centrelines:
        found.add("discretisation", partial(on_centrelines, scene, _computed(run, force, couple)))
    elif scene.time is None:
        of_mesh = _dual if run.fluid.coarse is None else _by_surplus
        found.add("discretisation", lambda _: of_mesh(run, speed))
    else:
        computed = _computed(run, force, couple)
        known = run.accounts.known.terms.get(OF_MESH)
        found.add("discretisation", partial(by_coarser_runs, scene, computed, of_mesh=known))
    for name, reason in not_there(scene).items():
        found.leave_out(name, reason)
    for name, estimate in of_the_model(scene, speed).items():
        found.add(name, estimate)
    if run.probe is not None and run.probe.enclosed is not None and len(run.contacts or ()) > 1:
        found.add(POCKET, lambda _: _of_pocket(run, speed))
    if (wider := on_more_bed(scene)) is not None:
        found.add(GROUND, partial(of_level_ground, wider, _computed(run, force, couple)))
    if run.contacts is not None and force is not None and couple is not None and is_scanned(scene):
        found.add(SCAN, lambda _: of_scans(scene, force, couple))
    return found.bars()


def with_safety(bars: ErrorBars, run: Run, force: Forces | None, couple: Couples | None) -> ErrorBars:
    """The bars with the safety factor's, where there is a verdict and at least one term. Collective.

    Nothing is certain of a grain in turbulent flow: another program with the same model finds other loads.
    """
    if run.contacts is None or force is None or couple is None or not bars.terms:
        return bars
    errors = {term.name: np.concatenate([term.force, term.couple]) for term in bars.terms}
    from .safetybar import bar_of_scene  # which loads linear programs, slowly

    terms = (term for term in bars.terms if term.modes)
    bar = bar_of_scene(run.scene, run.contacts, force, couple, errors, *terms)
    unknown = (*bars.failed, *({MODEL} & bars.left_out.keys()))
    if bar is not None and run.turbulence is not None:
        holds = run.turbulence.report().applicable
        bar = replace(bar, certain=False, decisive=OF_MODEL if holds else LAW)
    if bar is not None and (doubtful := bars.doubtful or (SCAN if SCAN in bars.failed else "")):
        bar = replace(bar, certain=False, decisive=doubtful)
    return replace(bars, safety=bar and replace(bar, unknown=unknown))


def _computed(run: Run, force: Forces | None, couple: Couples | None) -> Loads:
    """What a run has come to."""
    place = None
    if run.grain is not None:
        state = run.grain.state
        place = np.concatenate([state.place, state.orientation])
    from ..mesh.sampling import centrelines

    walls = None if run.turbulence is None or force is not None else run.turbulence.report()
    lines = centreline_velocities(centrelines(run.scene, run.fluid))
    return replace(Loads.at_the_end(force, couple, place, run.elevations, walls), centreline=lines)


def _dual(run: Run, speed: float) -> Term:
    from .dual import GoalErrors  # not above: a plan asks for the coarse runs, without finite elements

    placement = run.layout.placement
    assert placement is not None
    with GoalErrors(run.fluid, "body", placement.centre) as goals:
        # The fluid's unit of speed is its own; what is left of the way to `speed` is short, or in Stokes flow.
        return by_dual(goals, goals.allowance * speed * run.fluid.reynolds / run.plan.reynolds)


def _by_surplus(run: Run, speed: float) -> Term:
    """From what the flow's elements have changed of the loads in those of order two, on which it stands.

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
        self._left_out: dict[str, str] = {}
        self._failed: dict[str, str] = {}

    def add(self, name: str, estimate: Callable[[Solve], Term]) -> None:
        """Estimate a term, unless it is known; a failure is noted in its place. Collective."""
        try:
            if name not in self._known:
                self._known[name] = estimate(self._solve)
            self._terms.append(self._known[name])
        except IncipientError as error:
            self._failed[name] = str(error)

    def leave_out(self, name: str, reason: str) -> None:
        """Note why there is no such term. Not collective."""
        self._left_out[name] = reason

    def bars(self) -> ErrorBars:
        """All that has been found. Not collective."""
        return ErrorBars(tuple(self._terms), self._left_out, self._failed)


def coarse_scenes(scene: Scene) -> list[Scene]:
    """The scenes of the coarse runs that the error bars of a scene need, each once. Not collective."""
    wanted: dict[str, Scene] = {}

    def note(coarse: Scene) -> Loads:
        """Keep what would be run, without running it."""
        wanted[coarse.model_dump_json()] = coarse
        return Loads(np.zeros(3), np.zeros(3))

    nothing = Loads(np.zeros(3), np.zeros(3))
    with suppress(ConvergenceError):  # a term that is not computed needs no runs
        if scene.time is not None:
            by_coarser_runs(scene, nothing, note)
        elif scene.is_turbulent:
            by_coarser_mesh(scene, nothing, note)
        elif scene.has_centrelines:
            on_centrelines(scene, nothing, note)
    for estimate in of_the_model(scene).values():
        estimate(note)
    if (wider := on_more_bed(scene)) is not None:
        note(wider)
    return list(wanted.values())


# -- the terms --------------------------------------------------------------------------------------


def by_dual(goals: GoalErrors, unit: float) -> Term:
    """The term of the discretisation from estimated errors, in a unit that has their allowance. Collective.

    Where the flow is upwinded a second correction is made, which leaves the estimates those of both.
    """
    left = goals.correct_again() if goals.is_upwinded else 0.0
    doubt = ""
    if left > SETTLED:
        doubt = (
            f"upwinding changes much, and of two corrections against it the second still made {left:.0%}; "
            "use a smaller numerics.mesh_size"
        )
    force, couple = unit * np.abs(goals.force), unit * np.abs(goals.couple)
    return Term("discretisation", force, couple, "dual-weighted residual, one order more", doubt=doubt)


def by_coarser_mesh(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of a steady flow with turbulence: by runs on two coarser meshes.

    A dual solution would be needed of flow, k and epsilon together. No order is supposed above one: k and epsilon are
    upwinded, and away from walls the cells are coarse for them. Two meshes may agree by chance: what the coarser two
    differ by is not believed to fall at an order above two.

    Raises:
        ConvergenceError: a coarser mesh has as few rows or columns of cells.
    """
    how = f"runs on meshes x {COARSER_MESH:.3g} and {COARSER_MESH**2:.3g}, extrapolated at order 1"
    _require_coarser(scene)
    share, coarser = 1.0 / (COARSER_MESH**SLOWEST - 1.0), on_coarser_mesh(scene)
    in_coarser, in_coarsest = solve(coarser), solve(on_coarser_mesh(coarser))
    scatters = scene.body is None and scene.bed is not None and scene.bed.kind != "flat"
    fastest = SCATTERING if scatters else FASTEST
    near = Term.of_difference("discretisation", computed, in_coarser, share, how)
    far = Term.of_difference("discretisation", in_coarser, in_coarsest, share / COARSER_MESH**fastest, how)
    return near.at_least(far)


def on_centrelines(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of the velocities on the centrelines of a lid-driven box: by runs on two coarser meshes.

    Whatever the velocity's order they are taken to converge at order 2: at the ends of the lid the flow is singular.
    Two meshes may agree by chance: what the coarser two differ by, fallen at that order, is not gone below.

    Raises:
        ConvergenceError: the coarser meshes have as few rows or columns of cells.
    """
    if scene.numerics.mesh_size > (
        most := Setup(scene).far_cells.coarsest_grid / COARSER_MESH**2 * (1.0 + 1e-9)
    ):
        raise ConvergenceError(NOT_COARSER.format(finer=math.floor(100.0 * most) / 100.0))
    fall = COARSER_MESH**OF_DRIVEN_BOXES
    how = f"runs on meshes x {COARSER_MESH:.3g} and {COARSER_MESH**2:.3g}, extrapolated at order {OF_DRIVEN_BOXES:g}"
    coarser = on_coarser_mesh(scene)
    in_coarser, in_coarsest = solve(coarser), solve(on_coarser_mesh(coarser))
    near = Term.of_difference("discretisation", computed, in_coarser, 1.0 / (fall - 1.0), how)
    far = Term.of_difference("discretisation", in_coarser, in_coarsest, 1.0 / (fall - 1.0) / fall, how)
    return near.at_least(far)


def _require_coarser(scene: Scene) -> None:
    """Raise ConvergenceError where the mesh for comparison, which is to be coarser, would not be. Not collective."""
    if scene.is_turbulent and COARSER_MESH * scene.numerics.mesh_size > (most := coarsest(Setup(scene))):
        raise ConvergenceError(NOT_COARSER.format(finer=math.floor(100.0 * most / COARSER_MESH) / 100.0))


def by_coarser_runs(scene: Scene, computed: Loads, solve: Solve, of_mesh: Term | None = None) -> Term:
    """The term of time step and mesh, a part of each: by a run in longer steps, and one of one order more in these.

    What the mesh errs by hardly depends on the steps, so that it is seen in the longer ones, too, and where it is
    known from others (`of_mesh`) that run is spared.
    """
    _require_coarser(scene)
    longer, beside = comparisons(scene)
    in_longer, (to_step, to_mesh) = solve(longer), shares(scene)
    to_step = max(to_step, least_share(computed, in_longer, order_in_time(scene)))
    how = f"a run with steps x {ratio_of_steps(scene):.3g}, extrapolated at order {order_in_time(scene)}"
    of_step = Term.of_difference("time step", computed, in_longer, to_step, how)
    of_step = enlarged(of_step, OF_FEW_STEPS)
    if of_mesh is None:
        order = SLOWEST if scene.is_turbulent else order_in_space(scene.order)
        how = f"these on a mesh x {COARSER_MESH:.3g}, extrapolated at order {order:g}"
        how = how if on_another_mesh(scene) else f"these on a mesh for elements of order {beside.order}"
        found = Term.of_difference(OF_MESH, in_longer, solve(beside), to_mesh, how)
        of_mesh = enlarged(found, error_over_change(scene))
    together = Term.of_parts("discretisation", (of_step, of_mesh), "time step and mesh together")
    return replace(enlarged(together, of_large_errors(together, computed)), doubt=doubt_of_stream(scene))


def shares(scene: Scene) -> tuple[float, float]:
    """The error of the time step over what longer ones change, and that of the mesh over what another one changes.

    The mesh for elements of one order more leaves so much less of an error that all it changes is one. Not collective.
    """
    ratio, order = ratio_of_steps(scene), scene.order
    in_time = (ratio if ratio > 1.0 else LONGER_STEP) ** order_in_time(scene)
    in_space = SLOWEST if scene.is_turbulent else order_in_space(order)
    return 1.0 / (in_time - 1.0), 1.0 / (COARSER_MESH**in_space - 1.0) if on_another_mesh(scene) else 1.0


def order_in_space(velocity: int) -> int:
    """The order in `numerics.mesh_size` with which loads are taken to converge, from that of the velocity's elements.

    Between that of the energy norm and its double, which a load read off the residual has on cells that all shrink
    alike: how fast they grow with the distance from the grain does not change with their size. Not collective.
    """
    return velocity + 1


def of_gap(scene: Scene, solve: Solve) -> Term:
    """What closing the gap between grain and bed would change, from coarse runs with larger gaps.

    Of a wide gap the runs have smaller ones: larger than the widest allowed are none.
    """
    contact = scene.contact or Contact(friction=0.0)  # friction plays no part in the flow
    if scene.closes_contacts:
        return _of_closing(scene, contact, solve)
    wide = 4.0 * contact.gap > WIDEST_GAP
    sections = [{**contact.model_dump(), "gap": k * contact.gap} for k in (SMALLER if wide else LARGER)]
    loads = [solve(coarse(scene, contact=section)) for section in sections]
    values = [np.concatenate([one.force, one.couple]) for one in loads]
    errors = np.array([_to_zero(*three) for three in zip(*values, strict=True)])
    if wide:  # found is the error with the smallest gap, to which the way there from the scene's is added
        errors += np.abs(values[2] - values[0])
    told = "1/4, 1/2 and 1" if wide else "1, 2 and 4"
    how = f"coarse runs with {told} times the gap, extrapolated to none"
    near, far = (float(np.linalg.norm(loads[i + 1].force - loads[i].force)) for i in (0, 1))
    return Term("gap", errors[:3], errors[3:], how, power=_order_in_gap(near, far))


def _of_closing(scene: Scene, contact: Contact, solve: Solve) -> Term:
    """What closing less of the space next to contacts would change, from a coarse run in which more of it is closed.

    The fluid in a wedge hardly moves, and its pressure is that of the wedge's mouth: what closing a space of some width
    changes falls faster than the width, and less of it cannot change as much.
    """
    wide = CLOSED_WIDER * contact.gap > WIDEST_GAP
    factor = 1.0 / CLOSED_WIDER if wide else CLOSED_WIDER
    other = {**contact.model_dump(), "gap": factor * contact.gap}
    how = f"a coarse run with the contacts closed {'1/' if wide else ''}{CLOSED_WIDER:g} times as widely"
    at = [solve(coarse(scene, contact=section)) for section in (contact.model_dump(), other)]
    return Term.of_difference("gap", at[0], at[1], 1.0, how)


def _to_zero(at_one: float, at_two: float, at_four: float) -> float:
    """|value without gap - value at the gap|, for a value that goes as a power of the gap."""
    near, far = at_two - at_one, at_four - at_two
    if abs(near) <= TOO_LITTLE * max(abs(at_one), abs(at_two), abs(at_four)):
        return abs(near)
    return abs(near) / (2.0 ** _order_in_gap(near, far) - 1.0)


def _order_in_gap(near: float, far: float) -> float:
    """The power of the gap from what two doublings of it change."""
    return float(np.clip(np.log2(max(far / near, 1e-3)), *ORDERS)) if near else ORDERS[0]


def no_gap(scene: Scene) -> str:
    """Why there is no term of the gap, or nothing."""
    if scene.body is not None and scene.body.moves:
        return REPELLED if scene.body.on_contact == "repel" else MOVES
    return "" if scene.rests else NO_CONTACT


def of_domain(scene: Scene, solve: Solve, decay: float | None = None) -> Term:
    """What sides that stand for an endless flow change, from a coarse run with all of them farther away.

    Their influence falls off like their distance to the power `decay`; None: as `decay_of` the scene says.
    """
    decay = decay_of(scene) if decay is None else decay
    how = f"a coarse run with sides {FARTHER:g} times as far, decay with distance to the power {decay:.2g}"
    share = 1.0 / (1.0 - FARTHER**-decay)
    return Term.of_difference("domain", solve(coarse(farther(scene))), solve(coarse(scene)), share, how)


def decay_of(scene: Scene) -> float:
    """The power of their distance with which the influence of far sides falls off. Not collective."""
    return DECAY_OVER_FORMS if starts_at_effective_height(scene) else DECAY


def of_datum(scene: Scene, other: Scene, solve: Solve) -> Term:
    """What a stream that starts where it does changes, from a coarse run of a scene in which it starts elsewhere."""
    how = f"a coarse run with flow.datum = {other.datum - other.domain.bottom:.4g}, which may suit the bed as well"
    return Term.of_difference("datum", solve(coarse(other)), solve(coarse(scene)), 1.0, how)


def with_other_datum(scene: Scene, speed: float = 1.0) -> Scene | None:
    """The scene with its stream from as far beyond the bed's effective height as that may be off, seen from its own.

    None where there is no such height, or the scene's is that for certain, or the stream with its turbulence enters at
    the bed's own height. At `speed` the flow is faster by a factor.
    """
    if scene.is_turbulent or has_no_far_sides(scene) or not starts_at_effective_height(scene):
        return None
    found, datum = effective_height(scene, speed), height_of_datum(scene, speed)
    bottom, crest = scene.domain.bottom, scene.bed_shape.crest
    off = bottom + found.height - datum
    other = min(datum + off + math.copysign(found.uncertainty, off), crest)
    if abs(other - datum) < SAME_DATUM * (crest - bottom):
        return None
    return changed(scene, flow={"datum": other - bottom})


def _adapted(scene: Scene, speed: float) -> Scene:
    """The scene with a stream that suits its bed: far sides otherwise tell of how slowly one that does not adapts."""
    if getattr(scene.flow, "datum", "auto") in ("auto", "effective"):
        return scene
    return with_other_datum(scene, speed) or scene


def of_level_ground(wider: Scene, computed: Loads, solve: Solve) -> Term:
    """What a bed that is meshed as it is everywhere would change, from a run with more of it meshed so."""
    how = f"a run with the bed meshed {WIDER:g} times as far, decay with distance to the power {DECAY_OF_GROUND:g}"
    share = 1.0 / (1.0 - WIDER**-DECAY_OF_GROUND)
    return Term.of_difference(GROUND, solve(wider), computed, share, how)


def on_more_bed(scene: Scene) -> Scene | None:
    """The scene with more of its bed meshed as it is; None where there is no more, or its influence is not asked for.

    A steady flow in space on a mesh of default sizes has such a bed: away from the grain it goes over to level ground.
    """
    if scene.gdim != 3 or scene.time is not None or scene.numerics.accuracy is not None:
        return None

    if resolved_bed(Setup(scene).geometry, scene.placement, scene.datum) is None:
        return None
    return changed(scene, numerics={"meshed_bed": WIDER * scene.numerics.meshed_bed, "error_bars": False})


def of_the_model(scene: Scene, speed: float = 1.0) -> dict[str, Callable[[Solve], Term]]:
    """How the terms of the model are estimated that a scene has, by name; its flow may be faster. Not collective."""
    found: dict[str, Callable[[Solve], Term]] = {}
    if not no_gap(scene):
        found["gap"] = partial(of_gap, scene)
    if not has_no_far_sides(scene):
        found["domain"] = partial(of_domain, _adapted(scene, speed))
    if (other := with_other_datum(scene, speed)) is not None:
        found["datum"] = partial(of_datum, scene, other)
    return found


def not_there(scene: Scene) -> dict[str, str]:
    """Why a scene has no term of gap, domain or model of turbulence, by name. Not collective."""
    reasons = {"gap": no_gap(scene), "domain": has_no_far_sides(scene)}
    if scene.is_turbulent:
        reasons[MODEL] = "not estimated: other constants or walls of [turbulence] tell of it"
    return {name: reason for name, reason in reasons.items() if reason}
