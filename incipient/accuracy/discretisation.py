"""Errors of time step and mesh in loads, as a term of error bars: from the dual solution, or from coarser runs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConvergenceError
from ..planning.boundary_layer import is_resolved
from ..planning.flow_setup import Setup, order_of
from ..planning.wall_cells import coarsest
from ..results.errorbars import Loads, Term
from ..scene import Scene
from .coarse_runs import (
    COARSER_MESH,
    comparisons,
    on_another_mesh,
    on_coarser_mesh,
    order_in_time,
    ratio_of_steps,
)
from .kept_runs import Solve
from .waves import (
    OF_FEW_STEPS,
    doubt_of_stream,
    enlarged,
    error_over_change,
    least_share,
    of_large_errors,
)

if TYPE_CHECKING:
    from .dual import GoalErrors

# Part of both corrections against upwinding that the second one may be: were the next ones to fall as slowly, all of
# them together would be twice the first one.
SETTLED = 0.5
# Order at which errors of runs with wall layers on coarser meshes are taken to fall, at least and at most.
# Those of u* over forms of a bed scatter rather than fall, the docs have a wavy one; so do loads in space where walls
# are resolved: on cells of 1.6 a sphere's was off by as much as an order of two made of its error.
SLOWEST, FASTEST, SCATTERING = 1.0, 2.0, 0.0
# Likewise where walls are resolved, measured in channels (tests/end_to_end/test_resolved_channels.py).
TO_THE_WALL = 1.5
# Past grains and forms in space larger cells than these hardly have a steady flow, and tell nothing of finer ones: they
# are far from resolving the walls (measured on a sphere by tests/end_to_end/test_sand_in_space.py).
COARSEST_IN_SPACE = 3.2
AT_CORNERS = 2.0  # the order of velocities in a driven box (docs/space.md)
UNSETTLED = (
    "upwinding changes the load much: the second of two corrections for it made {left:.0%} of both; "
    "use a smaller numerics.mesh_size"
)
NOT_COARSER = (
    "coarser meshes have as few rows or columns of cells: use numerics.mesh_size = {:g} or less"
)
NOT_RESOLVED = (
    "cells twice as large do not tell of these in space: use numerics.mesh_size = {:.2g} or less"
)
OF_MESH = "mesh"  # name of the part of the discretisation's term that outlasts a change of steps


def by_dual(goals: GoalErrors, unit: float) -> Term:
    """The term of the discretisation from estimated errors, in a unit that has their allowance. Collective.

    Where the flow is upwinded a second correction is made, which leaves the estimates those of both.
    """
    left = goals.correct_again() if goals.is_upwinded else 0.0
    doubt = UNSETTLED.format(left=left) if left > SETTLED else ""
    force, couple = unit * np.abs(goals.force), unit * np.abs(goals.couple)
    return Term(
        "discretisation", force, couple, "dual-weighted residual, one order more", doubt=doubt
    )


def by_both(term: Term, goals: GoalErrors, unit: float, beside: Loads) -> Term:
    """The term with loads corrected by its estimates, as far as those improved on other cells agree. Not collective.

    Where these are farther from each other than the load may be off by an estimate with an allowance nothing is
    corrected.
    """
    here = goals.loads(unit / goals.allowance)
    apart = np.concatenate([here.force - beside.force, here.couple - beside.couple])
    change = -unit / goals.allowance * np.concatenate([goals.force, goals.couple])
    found = term.corrected(change, goals.allowance * np.abs(apart))
    if goals.allowance > 1.0 and np.linalg.norm(found.force) > np.linalg.norm(term.force):
        return term
    return replace(found, how=f"{term.how}, on larger cells as well")


def by_coarser_mesh(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of a steady flow with wall layers: by runs on two coarser meshes.

    Past a grain in space that is resolved to the walls loads scatter from mesh to mesh, and one component may change
    little by chance: each is taken to err by as much as force or couple do, unless it vanishes by symmetry. So is u* at
    the outflow and in the mean, each by as much as the other one.

    A dual solution would be needed of flow and turbulence together. No order is supposed above one: turbulence is
    upwinded, and away from walls the cells are coarse for them. Two meshes may agree by chance: what the coarser two
    differ by is not believed to fall at an order above two.

    Raises:
        ConvergenceError: a coarser mesh has as few rows or columns of cells, or does not resolve the walls in space.
    """
    _require_coarser(scene)
    over_forms = scene.body is None and scene.bed is not None and scene.bed.kind != "flat"
    fastest = SCATTERING if over_forms or scene.resolves_uneven_walls else FASTEST
    found = _by_two_meshes(
        on_coarser_mesh(scene), computed, solve, _slowest(scene.resolves_walls), fastest
    )
    scatters = scene.resolves_walls and scene.gdim == 3
    return found.with_components_alike() if scatters else found


def _slowest(resolved: bool) -> float:
    """The order at which errors of a mean flow are taken to fall at least, where walls are resolved or not."""
    return TO_THE_WALL if resolved else SLOWEST


def _by_two_meshes(
    coarser: Scene, computed: Loads, solve: Solve, order: float, fastest: float
) -> Term:
    """The term by runs on two coarser meshes: errors fall at `order`, what the two differ by at most at `fastest`."""
    how = f"runs on meshes x {COARSER_MESH:.3g} and {COARSER_MESH**2:.3g}, extrapolated at order {order:g}"
    share = 1.0 / (COARSER_MESH**order - 1.0)
    in_coarser, in_coarsest = solve(coarser), solve(on_coarser_mesh(coarser))
    near = Term.of_difference("discretisation", computed, in_coarser, share, how)
    where = in_coarser.where_separates(computed)
    far = Term.of_difference(
        "discretisation", where, in_coarsest, share / COARSER_MESH**fastest, how
    )
    return near.at_least(far)


def without_grain(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of velocities on centrelines, or of laminar separation along a bed: by runs on two coarser meshes.

    Whatever the velocity's order they are taken to converge at order 2: at the ends of the lid, and at corners of the
    bed, the flow is singular.
    Two meshes may agree by chance: what the coarser two differ by, fallen at that order, is not gone below.

    Raises:
        ConvergenceError: the coarser meshes have as few rows or columns of cells.
    """
    most = Setup(scene).far_cells.coarsest_grid / COARSER_MESH**2 * (1.0 + 1e-9)
    if scene.numerics.mesh_size > most:
        raise ConvergenceError(NOT_COARSER.format(math.floor(100.0 * most) / 100.0))
    return _by_two_meshes(on_coarser_mesh(scene), computed, solve, AT_CORNERS, AT_CORNERS)


def _require_coarser(scene: Scene) -> None:
    """Raise ConvergenceError where the mesh for comparison, which is to be coarser, would not be. Not collective."""
    if scene.is_averaged and COARSER_MESH * scene.numerics.mesh_size > (
        most := coarsest(Setup(scene))
    ):
        raise ConvergenceError(NOT_COARSER.format(math.floor(100.0 * most / COARSER_MESH) / 100.0))
    most = COARSEST_IN_SPACE / COARSER_MESH**2 * (1.0 + 1e-9)
    if scene.resolves_uneven_walls and scene.numerics.mesh_size > most:
        raise ConvergenceError(NOT_RESOLVED.format(most))


def by_coarser_runs(
    scene: Scene, computed: Loads, solve: Solve, of_mesh: Term | None = None
) -> Term:
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
        order = _order_of_mesh(scene)
        how = f"these on a mesh for elements of order {order_of(beside).number}"
        if on_another_mesh(scene):
            how = f"these on a mesh x {COARSER_MESH:.3g}, extrapolated at order {order:g}"
        found = Term.of_difference(OF_MESH, in_longer, solve(beside), to_mesh, how)
        of_mesh = enlarged(found, error_over_change(scene))
    together = Term.of_parts("discretisation", (of_step, of_mesh), "time step and mesh together")
    return replace(
        enlarged(together, of_large_errors(together, computed)), doubt=doubt_of_stream(scene)
    )


def shares(scene: Scene) -> tuple[float, float]:
    """The error of the time step over what longer ones change, and that of the mesh over what another one changes.

    The mesh for elements of one order more leaves so much less of an error that all it changes is one. Not collective.
    """
    in_time, in_space = ratio_of_steps(scene) ** order_in_time(scene), _order_of_mesh(scene)
    return 1.0 / abs(in_time - 1.0), 1.0 / (COARSER_MESH**in_space - 1.0) if on_another_mesh(
        scene
    ) else 1.0


def _order_of_mesh(scene: Scene) -> float:
    """The order at which errors of a flow in time fall on finer meshes: one less in unresolved boundary layers."""
    if scene.is_averaged:
        return _slowest(scene.resolves_walls)
    order = order_of(scene).number
    return order_in_space(order) if is_resolved(Setup(scene)) else order


def order_in_space(velocity: int) -> int:
    """The order in `numerics.mesh_size` with which loads are taken to converge, from that of the velocity's elements.

    Between that of the energy norm and its double, which a load read off the residual has on cells that all shrink
    alike: how fast they grow with the distance from the grain does not change with their size. Not collective.
    """
    return velocity + 1
