"""Terms of error bars: differences between runs that differ in one thing, times a factor from the order.

time step       longer steps                         order of the scheme
mesh            next-higher order, or coarser cells  order of the elements
gap             1/2 and 1/4 of the gap, or 2 and 4   observed order
domain          sides farther away                   decay with the distance
datum           another datum of the base flow
planar far bed  more of the bed meshed               decay with the distance
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError, IncipientError
from ..planning.discretisation import LEVEL, far_cell, order_of
from ..planning.meshing import is_resolved
from ..planning.sizes import coarsest, ratio_of_rows
from ..results.errorbars import Loads, Term
from ..scene import Contact, Scene
from ..scene.sections import WIDEST_GAP
from ..setup.setup import Setup
from .coarse_runs import (
    COARSER_MESH,
    FARTHER,
    MUCH_FARTHER,
    Solve,
    changed,
    coarse,
    comparisons,
    farther,
    moves_mesh,
    on_another_mesh,
    on_coarser_mesh,
    order_in_time,
    ratio_of_steps,
)

Estimator = Callable[[Loads, Solve], Term]
# By name: an estimate, a term, or why there is none, "" if that goes without saying.
Estimators = dict[str, Estimator | Term | str]

# Error over estimate outside the asymptotic range, the largest measured (docs/contribute/defaults.md): cells in 3-D,
# steps of waves and levels of flows (tests/convergence/test_waves.py).
SAFETY = 1.6
UPWINDED = 1.0  # order of upwinded turbulence in the cell size
# Larger cells do not resolve the walls of grains and bedforms in 3-D (tests/end_to_end/test_sand_in_space.py).
COARSEST_IN_SPACE = 3.2
# Powers of the distance with which the influence of sides falls: on a flat bed, over bedforms in laminar flow (1.6 to
# 1.8 measured) and in turbulent flow (docs/contribute/defaults.md).
DECAY, DECAY_OVER_FORMS, DECAY_OF_TURBULENCE = 2.0, 1.5, 1.0
WIDER, DECAY_OF_GROUND = 1.5, 1.0  # of the meshed part of the bed (docs/contribute/defaults.md)
ROUND_OFF = 1e-6  # of loads, and of the height of bedforms: smaller changes are ignored
GROUND, MODEL = "planar far bed", "turbulence model"


def richardson(ratio: float, order: float) -> float:
    """Error over the change by `ratio` times the step, cell size or distance (Richardson extrapolation)."""
    return 1.0 / abs(ratio**order - 1.0)


# -- discretisation -----------------------------------------------------------------------------------------


def by_coarser_mesh(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of a mean flow, of velocities on centrelines, or of laminar separation, from two coarser meshes.

    Loads on a grain in 3-D with resolved walls scatter from mesh to mesh: all nonzero components get the error of their
    vector, and both u* equal errors.

    Raises:
        ConvergenceError: the coarser mesh is not coarser, or does not resolve the walls in 3-D.
    """
    _require_coarser(scene)
    order = UPWINDED if scene.is_averaged else 2.0  # because of corners
    # The difference between coarser meshes falls at most at second order, and not at all where loads scatter.
    over_forms = scene.is_averaged and scene.body is None and scene.has_forms
    fastest = 0.0 if over_forms or scene.resolves_uneven_walls else 2.0
    coarser = on_coarser_mesh(scene)
    first, second = (ratio_of_rows(Setup(each), COARSER_MESH) for each in (scene, coarser))
    in_coarser, in_coarsest = solve(coarser), solve(on_coarser_mesh(coarser))
    how = f"runs on meshes x {COARSER_MESH:.3g} and {COARSER_MESH**2:.3g}, extrapolated at order {order:g}"
    near = Term.of_difference("discretisation", computed, in_coarser, richardson(first, order), how)
    of_coarser = richardson(second, order) / first**fastest
    where = in_coarser.where_separates(computed)
    far = Term.of_difference("discretisation", where, in_coarsest, of_coarser, how)
    term = near.at_least(far)
    scatters = scene.resolves_walls and scene.gdim == 3
    return term.with_components_alike() if scatters else term


def _require_coarser(scene: Scene) -> None:
    if scene.is_averaged or scene.time is None:
        times = COARSER_MESH if scene.is_averaged else COARSER_MESH**2 * (1.0 - 1e-9)
        most = coarsest(Setup(scene)) / times
        if scene.numerics.mesh_size > most:
            raise ConvergenceError(
                "coarser meshes have no fewer rows or columns of cells: use numerics.mesh_size = "
                f"{math.floor(100.0 * most) / 100.0:g} or less"
            )
    most = COARSEST_IN_SPACE / COARSER_MESH**2 * (1.0 + 1e-9)
    if scene.resolves_uneven_walls and scene.numerics.mesh_size > most:
        raise ConvergenceError(
            f"cells twice as large are too coarse for an error estimate: use numerics.mesh_size = {most:.2g} or less"
        )


def by_coarser_runs(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of time step and mesh, from longer steps, and from the next-higher order with these steps."""
    _require_coarser(scene)
    longer, beside = comparisons(scene)
    in_longer, in_beside = solve(longer), solve(beside)
    ratio, order = ratio_of_steps(scene), order_in_time(scene)
    of_step = richardson(ratio, order)
    if not _resolve_waves(computed, in_longer):
        of_step = max(of_step, 1.0)  # their order is not observable
    of_mesh, mesh = 1.0, f"a mesh for elements of order {order_of(beside)}"
    if on_another_mesh(scene):
        of_mesh = richardson(COARSER_MESH, _order_of_mesh(scene))
        mesh = f"a mesh x {COARSER_MESH:.3g}, extrapolated at order {_order_of_mesh(scene):g}"
    how = f"a run with steps x {ratio:.3g}, extrapolated at order {order}"
    differences = (
        Term.of_difference("time step", computed, in_longer, of_step, how),
        Term.of_difference("mesh", in_longer, in_beside, of_mesh, f"these on {mesh}"),
    )
    parts = tuple(part.with_elevations_times(SAFETY) for part in differences)
    both = Term.of_parts("discretisation", parts, "time step and mesh together")
    both = both.with_elevations_times(_of_large(both, computed))
    return replace(both, doubt=doubt_of_stream(scene))


def _order_of_mesh(scene: Scene) -> float:
    if scene.is_averaged:
        return UPWINDED
    return order_in_space(order_of(scene)) if is_resolved(Setup(scene)) else order_of(scene)


def order_in_space(velocity: int) -> int:
    """Order of loads in `numerics.mesh_size`, from that of the velocity's elements.

    It is between the order of the energy norm and twice that order, that of residual loads under uniform refinement:
    the growth of cells with the distance from the grain is independent of their size.
    """
    return velocity + 1


def _resolve_waves(computed: Loads, in_longer: Loads) -> bool:
    here, there = (loads.others.get("elevation") for loads in (computed, in_longer))
    if here is None or there is None:
        return True
    # Longer steps damp unresolved waves: second differences are those of the run.
    ratio = there.step / here.step if here.step > 0.0 else 1.0
    sharpness = max(there.sharpness, ratio**2 * here.sharpness)
    apart = float(here.apart(there).max(initial=0.0))
    # As with six steps a period, and where two runs are in phase.
    return sharpness <= 1.0 and apart <= 0.7 * here.largest


def _of_large(term: Term, computed: Loads) -> float:
    error, elevations = term.others.get("elevation"), computed.others.get("elevation")
    if error is None or elevations is None or not elevations.largest:
        return 1.0
    relative = float(error.max(initial=0.0)) / elevations.largest
    return 1.0 / (1.0 - min(relative, 0.5))


def is_stream(scene: Scene) -> bool:
    """Whether the scene has an inflow below a free surface."""
    return scene.has_surface and scene.domain.kind == "channel" and not scene.flow.at_rest


def doubt_of_stream(scene: Scene) -> str:
    """Why the estimated errors of a channel's level may be too small, or "".

    Comparisons of meshes do not show the inflow zone, at least a cell long.
    """
    if not is_stream(scene):
        return ""
    most = LEVEL * scene.domain.height / far_cell(scene, order_of(scene))
    if scene.numerics.mesh_size <= most:
        return ""
    return (
        "the inflow zone that levels the surface is only one cell long with cells larger than "
        f"{LEVEL:g} of the depth; use numerics.mesh_size = {math.floor(100.0 * most) / 100.0:g} or less"
    )


# -- model: gap, domain, datum, far bed ---------------------------------------------------------------------


def of_gap(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The error of the gap between grain and bed, from coarse runs with a half and a quarter of the gap.

    The correction follows from a parabola through three gaps; a power law is the second estimate. All nonzero
    components get the error of their vector: some do not change monotonically where a pocket is closed.

    Runs in time and of mean flows scatter from mesh to mesh, by more than small gaps change: they have two and four
    times the gap. Closed interstices are closed four times as widely: the pressure in a wedge is that at its mouth.
    """
    contact = scene.contact or Contact(friction=0.0)  # friction does not affect the flow
    widened = 4.0 * contact.gap <= WIDEST_GAP and (scene.is_averaged or scene.time is not None)

    def at(times: float) -> Loads:
        return solve(coarse(scene, contact={**contact.model_dump(), "gap": times * contact.gap}))

    if scene.closes_contacts:
        how = f"a coarse run with the contacts closed {'4' if widened else '1/4'} times as widely"
        return Term.of_difference("gap", at(1.0), at(4.0 if widened else 0.25), 1.0, how)
    loads = [at(times) for times in ((1.0, 2.0, 4.0) if widened else (0.25, 0.5, 1.0))]
    here, values = 0 if widened else 2, np.array([each.load for each in loads])
    near, far = values[1] - values[0], values[2] - values[1]
    way = values[0] - values[here]
    falls = np.abs(near) > ROUND_OFF * np.max(np.abs(values), axis=0)
    by_power = -near / np.where(falls, 2.0 ** _order_in_gap(near, far) - 1.0, 1.0)
    how = f"coarse runs with {'1, 2 and 4' if widened else '1/4, 1/2 and 1'} times the gap, extrapolated to none"
    order = float(_order_in_gap(*np.linalg.norm([near[:3], far[:3]], axis=1)))
    errors = np.abs(by_power) + np.abs(way)
    # Unconverged changes of the runs are extrapolated with them.
    errors += (loads[0].unsteady + loads[1].unsteady) * richardson(2.0, order)
    errors += (loads[0].unsteady + loads[here].unsteady) * (not widened)
    term = Term("gap", errors, how, power=order)
    if not is_corrected(scene):
        return term
    # Weights of values at 1, 2 and 4 times the smallest gap in that at zero gap.
    by_parabola = np.array([8 / 3, -2.0, 1 / 3]) @ values - values[0]
    left = np.abs(by_parabola - by_power) + _noise(loads[here], computed)
    return term.corrected(by_parabola + way, left).with_components_alike()


def _noise(coarse: Loads, computed: Loads) -> Floats:
    if coarse.moved or computed.moved:
        return np.zeros(6)
    return np.abs(coarse.load - computed.load)


def _order_in_gap(near: Floats, far: Floats) -> Floats:
    ratio = np.divide(far, near, out=np.zeros(np.shape(near)), where=np.not_equal(near, 0.0))
    return np.clip(np.log2(np.maximum(ratio, 1e-3)), 0.3, 2.0)  # plausible orders


def of_domain(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The error of sides that represent unbounded flow, from a coarse run with a larger domain.

    Loads on a fixed grain are corrected; a still larger domain gives the second estimate.
    """
    decay, factor = DECAY, FARTHER
    if Setup(scene).base_flow.over_forms:
        decay = DECAY_OF_TURBULENCE if scene.is_averaged else DECAY_OVER_FORMS
        factor = MUCH_FARTHER if scene.is_averaged else FARTHER
    elif scene.gdim == 2 and moves_mesh(scene):
        factor = MUCH_FARTHER
    how = f"a coarse run with sides {factor:g} times as far, decay with distance to the power {decay:.2g}"
    here, far = solve(coarse(scene)), solve(coarse(farther(scene, factor)))
    term = Term.of_difference("domain", far, here, richardson(factor, -decay), how)
    if not (is_corrected(scene) and len(here.load)):
        return term
    try:
        farthest = solve(coarse(farther(scene, factor**2)))
    except IncipientError as error:
        return replace(
            term, how=f"{how}; not corrected, sides {factor**2:.3g} times as far: {error}"
        )
    values = [each.load for each in (here, far, farthest)]
    noise = _noise(here, computed)
    change, left = _to_unbounded(values, factor, decay, float(np.linalg.norm(noise[:3])))
    times = f"{factor:g} and {factor**2:.3g} times as far"
    how = f"coarse runs with sides {times}, decay with distance to the power {decay:.2g} or slower"
    return replace(term, how=how).corrected(change, left + noise)


def _to_unbounded(
    values: list[Floats], factor: float, decay: float, noise: float
) -> tuple[Floats, Floats]:
    """The change of loads (6,) to unbounded flow, from three distances at a factor, and its uncertainty.

    The power is observed in the forces, within bounds. The uncertainty is the largest deviation of the estimates with
    other powers or fewer distances, plus the relative influence of the sides on their own effect.
    """
    near, far = (float(np.linalg.norm((after - before)[:3])) for before, after in pairwise(values))
    if far > max(near, noise):
        raise ConvergenceError(
            f"sides {factor:g} times as far away change the force by {near:.2g}, sides {factor**2:g} times as far away "
            f"by another {far:.2g}: it does not converge; use a larger domain, or a flow that does not depend on its "
            "size"
        )
    seen = math.log(near / far) / math.log(factor) if near and far else decay
    # At least three quarters of the expected power: error of a disc's force 0.15%, with 1/3 0.22% (make calibration).
    # The least plausible power is that of a developing boundary layer, 1/3 (Leveque 1928).
    slowest = 0.75 * decay, decay, 1.0 / 3.0
    by_seen, by_decay, by_slower = (
        richardson(factor, -min(max(seen, least), decay)) for least in slowest
    )

    def beyond(share: float) -> Floats:
        return values[1] + share * (values[2] - values[1]) - values[0]

    change = beyond(by_seen)
    others = beyond(by_decay), beyond(by_slower), by_seen * (values[1] - values[0])
    share = np.linalg.norm(change[:3]) / max(float(np.linalg.norm(values[0][:3])), 1e-300)
    left = np.max([np.abs(other - change) for other in others], axis=0)
    return change, left + share * np.abs(change)


def of_datum(scene: Scene, other: Scene, computed: Loads, solve: Solve) -> Term:
    """The error of the datum, from a coarse run with another datum of the base flow."""
    height = Setup(other).base_flow.datum - other.domain.bottom
    how = f"a coarse run with flow.datum = {height:.4g}, which may suit the bed as well"
    return Term.of_difference("datum", solve(coarse(other)), solve(coarse(scene)), 1.0, how)


def of_level_ground(wider: Scene, computed: Loads, solve: Solve) -> Term:
    """The error of the planar far bed, from a run with more or all of the bedforms meshed."""
    how = f"a run with the bed meshed {WIDER:g} times as far, decay with distance to the power {DECAY_OF_GROUND:g}"
    share = richardson(WIDER, -DECAY_OF_GROUND)
    if not _has_level_ground(Setup(wider)):
        how, share = "a run with the bed meshed as it is everywhere", 1.0
    return Term.of_difference(GROUND, solve(wider), computed, share, how)


# -- which scene has which ----------------------------------------------------------------------------------


def by_coarse_runs(scene: Scene) -> Estimator | None:
    """The discretisation error from coarse runs; None: from the dual solution."""
    if scene.time is not None:
        return partial(by_coarser_runs, scene)
    if scene.is_averaged or scene.has_centrelines or scene.has_separation:
        return partial(by_coarser_mesh, scene)
    return None


def terms_of_model(scene: Scene, speed: float = 1.0) -> Estimators:
    """Estimates of errors independent of the mesh, at a speed of the flow."""
    other, wider, ground, model = with_other_datum(scene, speed), on_more_bed(scene), "", ""
    # Otherwise far sides show the slow adaptation of a flow out of equilibrium with its bed.
    suits = getattr(scene.flow, "datum", "auto") in ("auto", "effective")
    if scene.is_averaged:
        why = "vary constants and wall_distance of [turbulence] to see it"
        if scene.resolves_walls:
            why = "no other model is integrated to the walls"
        model = f"not estimated: {why}"
    if scene.numerics.accuracy is not None and _has_level_ground(Setup(scene)):
        ground = "not estimated with numerics.accuracy; a larger numerics.meshed_bed reduces it"
    return {
        "gap": no_gap(scene) or partial(of_gap, scene),
        "domain": has_no_far_sides(scene) or partial(of_domain, scene if suits else other or scene),
        "datum": "" if other is None else partial(of_datum, scene, other),
        MODEL: model,
        GROUND: ground if wider is None else partial(of_level_ground, wider),
    }


def is_corrected(scene: Scene) -> bool:
    """Whether loads are corrected: on a fixed grain, in laminar flow without a free surface."""
    held = scene.body is not None and not scene.body.moves
    return scene.numerics.correction and held and not (scene.is_averaged or scene.has_surface)


def no_gap(scene: Scene) -> str:
    """Why there is no term of the gap, or ""."""
    if scene.body is not None and scene.body.moves:
        return "does not apply: the grain moves, and contact.gap determines where it stops"
    return "" if scene.rests else "does not apply: no grain rests on a bed"


def has_no_far_sides(scene: Scene) -> str:
    """Why there is no term of the domain, or ""."""
    bed, surface = scene.bed, scene.surface
    reasons = (
        (
            (scene.is_averaged and scene.body is None) or scene.has_separation,
            "does not apply: the length of the channel and its inflow belong to the scene",
        ),
        (scene.domain.kind == "box", "does not apply: the domain is closed by walls"),
        (
            bed is not None and bed.kind in ("polyline", "height-map", "mesh"),
            "not estimated: the bed is known only as far as its points reach",
        ),
        (
            scene.has_surface and surface is not None and surface.outflow == "wall",
            "does not apply: the channel is closed by a wall",
        ),
    )
    return next((reason for applies, reason in reasons if applies), "")


def with_other_datum(scene: Scene, speed: float = 1.0) -> Scene | None:
    """The scene with a datum beyond the bed's effective height by the uncertainty of that height.

    None without such uncertainty, and for a turbulent inflow at the bed's own height. `speed`: factor on the flow.
    """
    base_flow = Setup(scene).base_flow_at(speed)
    if scene.is_averaged or has_no_far_sides(scene) or not base_flow.over_forms:
        return None
    (height, uncertainty), datum = base_flow.effective_height, base_flow.datum
    bottom, crest = scene.domain.bottom, scene.bed_shape.crest
    off = bottom + height - datum
    other = min(datum + off + math.copysign(uncertainty, off), crest)
    if abs(other - datum) < ROUND_OFF * (crest - bottom):
        return None
    return changed(scene, flow={"datum": other - bottom})


def on_more_bed(scene: Scene) -> Scene | None:
    """The scene with more bedforms meshed; None without more, or with a mesh chosen for an accuracy."""
    if scene.numerics.accuracy is not None or not _has_level_ground(Setup(scene)):
        return None
    return changed(
        scene, numerics={"meshed_bed": WIDER * scene.numerics.meshed_bed, "error_bars": False}
    )


def _has_level_ground(setup: Setup) -> bool:
    if setup.scene.gdim != 3 or setup.scene.time is not None:
        return False
    return setup.resolved_bed(setup.scene.placement) is not None
