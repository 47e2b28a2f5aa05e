"""The steady flow and its turbulence by pseudo-transient continuation of both as one system of equations.

An iteration is an implicit Euler step of pseudo-time with one Newton update. Past grains in 3-D every second one has
the Jacobian of that before, if it changes less: on a bed of spheres at u* d/nu = 80 as many iterations take 0.74 of
the time. In 2-D a backward-facing step, which converges in 42 iterations, then does not.

Local Courant numbers follow from switched evolution relaxation (Mulder & van Leer 1985, J. Comput. Phys. 59, 232;
Kelley & Keyes 1998, SIAM J. Numer. Anal. 35, 508): the wanted change over the residual, which is the change in the last
step over its Courant number. None is larger than one that falls as the change of the whole flow grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import compat
from ..arrays import Floats
from ..errors import ConvergenceError
from ..fluid import Fluid
from .coupled_flow import CoupledFlow, bounded
from .fields import TurbulenceFields

# Courant numbers of the first step, the smallest and the largest. They are bounded by change^-2 and, below a change of
# `SLIGHT` of the flow, by SLIGHT^-0.5 change^-1.5. A sphere on a level bed at u* d/nu = 3200 then takes 94 iterations;
# with change^-2 alone it does not converge in 140. With change^-1.5 alone it takes 49, but the flow past a box on the
# bed is given up after 50, before the inflow has crossed the domain.
FIRST, SMALLEST, LARGEST, SLIGHT = 5.0, 1e-2, 1e8, 1e-2
# Factors from step to step at most.
SHRINKS, GROWS = 0.1, 4.0
RECENT = 4  # steps; the change in none is larger than `GROWS` times that in one of these before
# Largest Courant number from which on a small change shows a steady flow instead of a short step.
STEADY = 1e3
# Iterations at the most; and those without a smaller change than before, after which there is no steady flow. As many
# last ones give the mean of the loads and its spread.
MOST_ITERATIONS, STAGNANT = 150, 40
MOST_FAILURES = 10
# Residual of a correction over the right-hand side: the change in the last step, within these bounds.
SMALLEST_ROUGH, LARGEST_ROUGH = 1e-2, 1e-1


@dataclass(frozen=True)
class Continued:
    """Outcome of a continuation.

    changes: (n, 2) of flow and logarithms in each iteration, the former relative to the flow
    loads:   (m,) averaged over the last iterations of a flow that is not converged
    spread:  largest difference of these loads from their mean, over its size; 0: converged
    """

    converged: bool
    changes: tuple[tuple[float, float], ...]
    loads: Floats | None = None
    spread: float = 0.0


def continued(
    fluid: Fluid,
    turbulence: TurbulenceFields,
    tolerances: tuple[float, float],
    loads: Callable[[], Floats] | None = None,
    watch: Callable[[int, float], None] = lambda number, change: None,
) -> Continued:
    """Compute the steady flow with its turbulence from their present states. Collective.

    Converged when flow and logarithms change by less than their `tolerances` with a new Jacobian in a long step.
    `loads` returns those on the grain, or on the bed (m,), in units of a force. Raises ConvergenceError if the
    iteration diverges.
    """
    fluid.constraints.update(fluid.time)
    compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
    turbulence.impose()
    changes, seen = list[tuple[float, float]](), list[Floats]()
    with CoupledFlow(fluid, turbulence) as system:
        system.courant[:] = FIRST
        change, fresh, small = (LARGEST_ROUGH, LARGEST_ROUGH), False, False
        twice = turbulence.weighted
        while not _has_ended(changes):
            # The last step has its own Jacobian.
            again = twice and fresh and not small and system.relaxation == 1.0
            most = max(change) if again else 0.0
            rough = min(max(*change), LARGEST_ROUGH) if twice else 0.0
            rough = max(rough, SMALLEST_ROUGH)
            largest = GROWS * np.max(changes[-RECENT:] or [(np.inf, np.inf)], axis=0)
            change, fresh = _step(system, fluid, turbulence, most, largest, rough)
            changes.append(change)
            watch(len(changes), max(change))
            turbulence.look()
            small = system.largest_courant() >= STEADY and all(
                a <= b for a, b in zip(change, tolerances, strict=True)
            )
            if small and fresh:
                return Continued(True, tuple(changes))
            if loads is not None:
                seen.append(loads())
    last = np.array(seen[-STAGNANT:])
    if not len(last):
        return Continued(False, tuple(changes))
    mean = last.mean(axis=0)
    away = np.linalg.norm(last - mean, axis=1).max()
    return Continued(False, tuple(changes), mean, float(away / np.linalg.norm(mean)))


def _step(
    system: CoupledFlow,
    fluid: Fluid,
    turbulence: TurbulenceFields,
    most: float,
    largest: Floats,
    rough: float,
) -> tuple[tuple[float, float], bool]:
    """Change in a step, and whether its Jacobian was new: it is if that at hand would change `most` or more.

    A step whose change is beyond the `largest` is taken anew with smaller Courant numbers: past a stone at u* d/nu =
    430 the flow converges in 39 iterations, where one such step, taken, undid 30. `rough`: relative residual of the
    linear system.
    """
    fresh = not most
    for _ in range(MOST_FAILURES):
        try:
            of_flow, of_logarithms = system.correction(fresh, rough)
        except ConvergenceError:  # a matrix without factors
            change = np.inf, np.inf
        else:
            change = fluid.relative(of_flow), turbulence.usual_change(of_logarithms)
        if np.isfinite(sum(change)) and (fresh or max(change) < most) and (change <= largest).all():
            at_nodes = system.changes_of_cells(of_flow, of_logarithms, turbulence.wanted)
            steps = system.relaxed(of_flow, of_logarithms)
            system.carry_out(*bounded(fluid, turbulence, *steps))
            factor = np.clip(1.0 / np.maximum(at_nodes, 1.0 / GROWS), SHRINKS, GROWS)
            system.courant[:] = np.clip(factor * system.courant, SMALLEST, _bound(change[0]))
            return change, fresh
        if fresh:
            system.courant[:] *= SHRINKS
        fresh = True
    raise ConvergenceError(
        f"the flow with {turbulence.names} diverges: use a smaller numerics.mesh_size or a longer domain"
    )


def _bound(change: float) -> float:
    """Largest Courant number after a change of the flow."""
    change = max(change, 1.0 / LARGEST)
    return float(np.clip(min(change**-2.0, SLIGHT**-0.5 * change**-1.5), FIRST, LARGEST))


def _has_ended(changes: list[tuple[float, float]]) -> bool:
    """Whether none of the last iterations changed less than all before."""
    if len(changes) <= STAGNANT:
        return False
    sizes = [max(change) for change in changes]
    return len(sizes) >= MOST_ITERATIONS or min(sizes[-STAGNANT:]) >= min(sizes[:-STAGNANT])
