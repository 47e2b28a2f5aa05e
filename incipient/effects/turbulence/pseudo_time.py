"""The steady flow and its turbulence, solved together by Newton's method in pseudo-time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ... import compat
from ...arrays import Floats
from ...compat import petsc
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.solvers.direct import Direct
from ...fluid.space import cell_size
from ...mesh.domain import Domain
from .fields import TurbulenceFields
from .iteration import Round, relative_change
from .linear import BlockByBlock

# In space, where assembly outweighs factors: with that of the residual, 7, as many steps take 1.4 times as long.
DEGREE_OF_DERIVATIVE = 4
MOST_STEPS = {2: 300, 3: 100}  # in space a flow takes 15 to 40, or is not steady
# Courant numbers: the first, that near a steady state, the least, that from which on a step is one of Newton's
# method, and the largest.
FIRST, NEAR, LEAST, NEWTON, LARGEST = 2.0, 100.0, 1e-3, 1e4, 1e12
LARGEST_CORRECTION = 1.0  # of a logarithm at a node, in a step
LARGEST_CHANGE = 0.3  # of a velocity at a node, in a step, over the largest speed
PROJECTION = 1e-2  # Courant number of a step that does little but make the start free of divergence
# Corrections of logarithms, and of the flow relative to it, up to which the next step is longer by a factor; and those
# beyond which it is half as long; by dimension. With half of these bounds a disc at u* d/nu = 102 takes more steps,
# with twice them its wake is lost (tests/end_to_end/test_resolved_channels.py, slow). In space logarithms are judged
# by their root mean square. Where steps double for logarithms up to 0.6 and the flow up to 0.05, not 0.3 and 0.03, a
# sphere on a level bed at u* d/nu = 86 takes 15 of them, not 19. With the bounds of the plane one among others at 30
# had no steady flow in 20 steps (before peaks of ln k were bounded).
LONGER = {
    2: ((6.0, 0.1, 0.01), (2.0, 1.0, 0.06), (1.3, 4.0, 0.1)),
    3: ((1e3, 0.02, 2e-3), (6.0, 0.05, 3e-3), (2.0, 0.6, 0.05), (1.3, 0.7, 0.08)),
}
TOO_LARGE = {2: (20.0, 0.15), 3: (3.0, 0.1)}
# Likewise where a flow separates from a smooth wall, for the largest change of a velocity. Where a logarithm at a node
# may change more, omega goes up and down from node to node in the wake, and stays so.
GENTLY = ((2.0, 1.0, 0.05), (1.5, 2.0, 0.1), (1.2, 3.0, 0.15))
TOO_LARGE_GENTLY = 5.0, 0.25
HARMFUL = 6.0, 0.04  # corrections of logarithms and flow in stretched cells, likewise
WARY = 2.0  # by which corrections of logarithms in stretched cells count more
# What corrections of logarithms and flow may be in the end, over the tolerance, by dimension: upwinding follows a
# step behind, which a few nodes feel, and in space systems are solved to 1e-2; past a sphere in its pocket at
# u* d/nu = 138 the flow changes by 2e-4 for ever, as limiters of the model switch, past one among others at 60 by 4e-4
# and its drag by 5e-4.
ENOUGH = {2: (1e4, 1.0), 3: (4e4, 600.0)}
OF_STRETCHED = 2e4, 100.0  # likewise in stretched cells, by nearly all nodes
BEGUN = 1.5, 0.015  # corrections of logarithms and flow with which a flow is a start for a faster one
# In space a wake may change for ever, at a few nodes. The flow is taken all the same when in so many steps with such a
# Courant number at least the loads on the grain have differed from the last ones by less than this part of them. What
# they then differ by is told: past a sphere in its pocket at u* d/nu = 138 0.9% (docs/turbulence.md).
# Where all steps are long fewer tell as much of smaller changes.
LINGERING, SWEEPING, SWEEPING_FAST, NEARLY = 10, 16.0, 8.0, 0.03
BRIEFLY, CLOSELY = 4, 2e-3
# Correction of the flow beyond which steps in space are sweeps of sixteen cells at most where it grew, of eight where
# the flow is fast; and the factor by which it falls while it does. In a wake that changes for ever longer ones change
# it more and more. Past one grain of a random bed at u* d/nu = 300 it grew in steps of 16 to 83 cells, until there was
# no flow, and fell in each of eight; from 0.002 on in steps of 20 and 40, too. At 86 eight mean 19 steps, not 15.
LITTLE, FALLING = 3e-3, 0.5
# Past grains of a random bed at u* d/nu = 300 k and velocity at single nodes in clefts, and next to spheres that are
# three cells across, went to and fro, velocities by four times V, and took the flow with them. In a
# fast flow in space no node therefore changes by more than this in a step: a logarithm, and, after so many steps, a
# velocity over the largest speed. Cells at nodes that would change by more take shorter steps than others, in
# proportion, by this factor at most, which then shrinks from step to step.
MOST_AT_NODES, BEGINNING, MOST_SLOWED, RELAXED = (0.5, 0.05), 3, 1000.0, 0.8
# Change of a velocity at a node, over the largest speed, with which such a step is repeated, shorter.
BURST = 0.3
NEARBY = 0.1  # first correction of the flow up to which, in space, another one is near enough for long steps from it
FAILED, FAILED_AT_FIRST, CUT = 0.3, 1.5, 0.3  # corrections of the flow with which a step is repeated, shorter


class CoupledFlow:
    """Flow and turbulence as one system of equations. Every method is collective.

    In pseudo-time each cell takes a step of its own, a Courant number times the time in which the flow passes it, by
    one correction of Newton's method, in space with a derivative by coarser quadrature than the residual. Holds PETSc
    objects: use it as a context manager, or call `destroy`.

    Args:
        in_time: whether all cells take the same step in time, to which the fluid's equations are set.
    """

    def __init__(self, fluid: Fluid, turbulence: TurbulenceFields, in_time: bool = False):
        self._fluid, self._turbulence, self._in_time = fluid, turbulence, in_time
        self._scale = 1.0
        self._held: list[Any] = []
        self._per_step = turbulence.constant(0.0)
        self._speed = turbulence.constant(turbulence.largest(fluid.state.x.array[fluid.space.velocity_map]))
        self._slowed: Any = 1.0
        if fluid.domain.gdim == 3:
            self._speed.value = 0.0
            cells = compat.space(fluid.domain.mesh, ("Discontinuous Lagrange", 0))
            self._slowed = dolfinx.fem.Function(cells)
            self._slowed.x.array[:] = 1.0
        forms = self._residual_forms()
        states = fluid.state, turbulence.state
        self._residuals = [compat.form(one) for one in forms]
        self._conditions = fluid.constraints.dirichlet, turbulence.conditions
        self._derivatives = [
            [compat.form(self._derivative(form, own, state)) for state in states]
            for form, own in zip(forms, states, strict=True)
        ]
        self._vectors = [self._holding(petsc.assemble_vector(one)) for one in self._residuals]
        self._blocks = [[self._holding(petsc.create_matrix(one)) for one in row] for row in self._derivatives]
        self._assemble_blocks()
        self._nest = self._holding(PETSc.Mat().createNest(self._blocks, comm=fluid.domain.comm))
        self._nest.assemble()
        self._matrix = self._holding(PETSc.Mat())
        self._solver = self._holding(
            self._factors() if fluid.domain.gdim == 2 else BlockByBlock(fluid, self._nest)
        )
        self._right, self._correction = (self._holding(one) for one in self._solver.matrix.createVecs())

    def _factors(self) -> Direct:
        """The solver by factors of both as one matrix."""
        self._nest.convert("aij", self._matrix)
        return Direct(self._matrix)

    def _residual_forms(self) -> list[Any]:
        """Both residuals in UFL, the eddy viscosity limited by the strain of the flow as it is."""
        fluid, turbulence = self._fluid, self._turbulence
        flow = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
        return [turbulence.watching(flow, ufl.split(fluid.state)[0]), turbulence.form]

    def _derivative(self, form: Any, own: Any, state: Any) -> Any:
        """The derivative of a residual in UFL, with the rate in pseudo-time in the state that is its `own`."""
        change = ufl.TrialFunction(state.function_space)
        found = ufl.derivative(form, state, change)
        if self._fluid.domain.gdim == 3:
            coarser = {"quadrature_degree": DEGREE_OF_DERIVATIVE}
            found = ufl.Form(
                [one.reconstruct(metadata=one.metadata() | coarser) for one in found.integrals()]
            )
        if state is not own or self._in_time:
            return found
        test, rate = ufl.TestFunction(state.function_space), self._per_step * self._slowed * self._passing()
        degree = {"quadrature_degree": 2 * self._fluid.space.order}
        measure = ufl.dx(domain=self._fluid.domain.mesh, metadata=degree)
        if own is self._fluid.state:
            return found + rate * ufl.inner(ufl.split(change)[0], ufl.split(test)[0]) * measure
        return found + rate * self._turbulence.inside * ufl.inner(change, test) * measure

    def _passing(self) -> Any:
        """One over the time in which the flow passes a cell, diffuses through it, or is sheared, in UFL.

        In space: where the strain is large what a change of the velocity carries would else outweigh the rate. In the
        plane all cells are passed as fast as the fastest flow at the start: else k dies out where the flow separates,
        before it has come there.
        """
        fluid = self._fluid
        velocity, _ = ufl.split(dolfinx.fem.Function(fluid.state.function_space, fluid.state.x))
        size = cell_size(fluid.domain.mesh)
        passing = ufl.sqrt(ufl.inner(velocity, velocity) + self._speed**2) / size
        passing += self._turbulence.of_molecules / size**2
        slope = ufl.grad(velocity)
        return passing + ufl.sqrt(ufl.inner(slope, slope)) if fluid.domain.gdim == 3 else passing

    def _assemble_blocks(self) -> None:
        conditions = [*self._conditions[0], *self._conditions[1]]
        for forms, matrices in zip(self._derivatives, self._blocks, strict=True):
            for form, matrix in zip(forms, matrices, strict=True):
                matrix.zeroEntries()
                petsc.assemble_matrix(matrix, form, conditions)
                matrix.assemble()

    def correction(self, courant: float) -> tuple[Floats, Floats]:
        """The changes (owned unknowns,) of the flow and of the logarithms in a step with a Courant number.

        Raises:
            ConvergenceError: the matrix has no factors.
        """
        self._per_step.value = 1.0 / courant
        self._turbulence.stop()
        return self.next_correction(fresh=True)

    def slow_down(self, of_flow: Floats, of_logarithms: Floats) -> None:
        """Let cells at nodes with large corrections (owned unknowns,) take shorter steps than the others, in space."""
        fluid, slowed = self._fluid, self._slowed.x.array
        states, changes = (fluid.state, self._turbulence.state), list[Floats]()
        for state, values in zip(states, (of_flow, of_logarithms), strict=True):
            change = dolfinx.fem.Function(state.function_space)
            change.x.array[: len(values)] = values
            change.x.scatter_forward()
            changes.append(change.x.array)
        nodes = fluid.space.velocity_map.reshape(-1, fluid.domain.gdim)
        logarithms, most = np.abs(changes[1]).reshape(-1, 2).max(axis=1), MOST_AT_NODES[1] * _fastest(fluid)
        asked = (
            (fluid.space.velocity, np.linalg.norm(changes[0][nodes], axis=1) / most),
            (self._turbulence.space, logarithms / MOST_AT_NODES[0]),
        )
        of_cells = [values[compat.cell_dofs(space)].max(axis=1) for space, values in asked]
        slowed[:] = np.clip(np.maximum(*of_cells), np.maximum(RELAXED * slowed, 1.0), MOST_SLOWED)

    @property
    def most_slowed(self) -> float:
        """The factor by which the step of a cell is shorter than asked for, at the most. Collective."""
        mine = 1.0 if self._fluid.domain.gdim == 2 else float(self._slowed.x.array.max(initial=1.0))
        return float(self._fluid.domain.comm.allreduce(mine, op=MPI.MAX))

    def next_correction(self, fresh: bool, **way: bool) -> tuple[Floats, Floats]:
        """The changes (owned unknowns,) of both by the residual as it is, and a `fresh` derivative or that before.

        `way` may name what the solver takes besides, see `BlockByBlock.approximate`.

        Raises:
            ConvergenceError: the matrix has no factors.
        """
        self._turbulence.prepare()
        for vector, form, conditions in zip(self._vectors, self._residuals, self._conditions, strict=True):
            with vector.localForm() as local:
                local.set(0.0)
            petsc.assemble_vector(vector, form)
            vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            compat.set_zero(vector, conditions)
        if fresh:
            self._renew()
        self._vectors[1].scale(self._scale)
        self._right.setArray(np.concatenate([one.array_r for one in self._vectors]))
        self._solver.approximate(self._right, self._correction, **way)
        number = self._vectors[0].getLocalSize()
        found = -self._correction.array_r
        return found[:number], found[number:]

    def renew_factors(self) -> None:
        """Request new factors with the next derivative, in space. Not collective, but to be called on every rank."""
        self._solver.renew_factors()

    def _renew(self) -> None:
        """Make the derivative that of the present state, and factors of it."""
        self._assemble_blocks()
        if self._solver.matrix is self._matrix:
            self._nest.convert("aij", self._matrix)
        else:
            self._scale = self._solver.balance(tuple(self._vectors))
        self._solver.prepare()

    def _holding(self, made: Any) -> Any:
        self._held.append(made)
        return made

    def __enter__(self) -> CoupledFlow:
        return self

    def __exit__(self, *exception: object) -> None:
        self.destroy()

    def destroy(self) -> None:
        """Free PETSc's memory."""
        while self._held:
            self._held.pop().destroy()


@dataclass(frozen=True)
class Marching:
    """How a flow is to be marched to its steady state.

    Args:
        first: Courant number of the first step.
        nearly: whether it is to be a start for another flow only.
        gently: whether the start has divergence, and no velocity may change much in a step, since the flow has to
            separate from a smooth wall.
        fast: whether in space steps are sweeps of eight cells while the flow changes much, shorter where nodes do.
        onwards: whether it begins with another flow, not with a guess, whose first steps change nodes by much.
    """

    first: float = FIRST
    nearly: bool = False
    gently: bool = False
    fast: bool = False
    onwards: bool = False


def solve_together(
    fluid: Fluid,
    turbulence: TurbulenceFields,
    tolerance: float,
    how: Marching = Marching(),
    watch: Callable[[Round], None] = lambda found: None,
    loads: Callable[[], Floats] | None = None,
) -> tuple[Round, ...]:
    """Find the steady flow with its turbulence from their present states, by steps of pseudo-time. Collective.

    `watch` is called with each step. `loads` are those on the grain, all in units of a force: a flow that still changes
    is taken where these hardly do, and the last round has their spread.

    Raises:
        ConvergenceError: there is none that could be found.
    """
    fluid.constraints.update(fluid.time)
    compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
    turbulence.impose()
    with CoupledFlow(fluid, turbulence) as system:
        march = _March(system, fluid, turbulence, how)
        for number in range(1, MOST_STEPS[fluid.domain.gdim] + 1):
            if not march.step(number, loads):
                if march.courant < LEAST:
                    break
                continue
            watch(march.rounds[-1])
            if march.arrived(tolerance):
                turbulence.look()
                return tuple(march.rounds)
            march.set_next_step()
    raise ConvergenceError(
        f"{turbulence.names} are not steady after {len(march.rounds)} steps of pseudo-time: use a smaller "
        "numerics.mesh_size or a longer domain, or add [time]"
    )


class _March:
    """The steps of pseudo-time made so far, and how long the next one is. Every method is collective."""

    def __init__(self, system: CoupledFlow, fluid: Fluid, turbulence: TurbulenceFields, how: Marching):
        self._system, self._fluid, self._turbulence, self._how = system, fluid, turbulence, how
        self._in_space = fluid.domain.gdim == 3
        self._sizes, self._left = (0.0, 0.0), (0.0, 0.0)
        self.rounds: list[Round] = []
        self.courant = PROJECTION if how.gently else how.first

    def step(self, number: int, loads: Callable[[], Floats] | None) -> bool:
        """Make a step if its corrections are not too large; else make the next one shorter, and return False."""
        fluid, turbulence, how = self._fluid, self._turbulence, self._how
        of_flow, of_logarithms = self._system.correction(self.courant)
        self._judge(of_flow, of_logarithms)
        if self._in_space and not self.rounds and self.courant > FIRST and self._sizes[1] > NEARBY:
            self.courant = FIRST
            return False
        finite = bool(np.isfinite(sum(self._sizes)))
        if how.fast and finite:
            self._system.slow_down(of_flow, of_logarithms)
        calmly = how.fast and (how.onwards or len(self.rounds) >= BEGINNING)
        burst = calmly and _largest_change(fluid, of_flow) > BURST
        if not finite or self._harmful() or burst:
            self.courant *= CUT
            return False
        largest = MOST_AT_NODES[0] if how.fast else LARGEST_CORRECTION
        _carry_out(fluid, turbulence, of_flow, np.clip(of_logarithms, -largest, largest), calmly)
        if loads is not None:
            turbulence.look()
        found = () if loads is None else tuple(map(float, loads()))
        self.rounds.append(Round(number, self.courant, self._sizes[1], self._sizes[0], found))
        return True

    def _judge(self, of_flow: Floats, of_logarithms: Floats) -> None:
        """Note the sizes of corrections (owned unknowns,), of logarithms first: by which steps go, and to an end."""
        most = self._turbulence.of_most(of_logarithms)
        usual = _usual(self._fluid.domain, of_logarithms, most)
        of_whole = _relative(self._fluid, of_flow)
        self._sizes = usual, _largest_change(self._fluid, of_flow) if self._how.gently else of_whole
        self._left = most if self._turbulence.stretched else usual, of_whole

    def _harmful(self) -> bool:
        """Whether corrections are so large that the step is to be repeated."""
        gently = self._how.gently
        if self._sizes[1] > (FAILED if self.rounds else FAILED_AT_FIRST):
            return True
        harmed = HARMFUL[0], LARGEST_CHANGE if gently else HARMFUL[1]
        wary = self._turbulence.stretched and (bool(self.rounds) or not gently)
        return wary and any(a > b for a, b in zip(self._sizes, harmed, strict=True))

    def arrived(self, tolerance: float) -> bool:
        """Whether the flow may be taken as it is; where it still changes the last round is then given the spread."""
        enough = OF_STRETCHED if self._turbulence.stretched else ENOUGH[self._fluid.domain.gdim]
        found = all(a <= b * tolerance for a, b in zip(self._left, enough, strict=True))
        begun = self._how.nearly and all(a <= b for a, b in zip(self._sizes, BEGUN, strict=True))
        if begun or (found and self.courant >= NEWTON * self._system.most_slowed):
            return True
        spread = spread_if_it_lingers(self.rounds, self._how.fast)
        if spread < math.inf:
            self.rounds[-1] = replace(self.rounds[-1], spread=spread)
        return spread < math.inf

    def set_next_step(self) -> None:
        """Choose the Courant number after a step."""
        gently = self._how.gently
        if gently and len(self.rounds) == 1:
            self.courant = self._how.first
        else:
            self.courant = _next(self.courant, *self._sizes, self._turbulence, gently)
        if self._in_space:
            self.courant = swept_where_it_changes_more(self.courant, self.rounds, self._how.fast)


def _carry_out(
    fluid: Fluid, turbulence: TurbulenceFields, of_flow: Floats, of_logarithms: Floats, calmly: bool
) -> None:
    """Add corrections (owned unknowns,) to both states, in space velocities bounded, `calmly` by less. Collective."""
    if fluid.domain.gdim == 3:
        bound(fluid, of_flow, MOST_AT_NODES[1] if calmly else LARGEST_CHANGE)
    for state, values in ((fluid.state, of_flow), (turbulence.state, of_logarithms)):
        state.x.array[: len(values)] += values
        state.x.scatter_forward()


def _relative(fluid: Fluid, of_flow: Floats) -> float:
    """The size of a correction (owned unknowns,) of the flow, relative to the flow's. Collective."""
    change = np.zeros_like(fluid.state.x.array)
    change[: len(of_flow)] = of_flow
    return relative_change(fluid, change)


def swept_where_it_changes_more(courant: float, rounds: Sequence[Round], fast: bool) -> float:
    """The Courant number wanted; that of a sweep where a `fast` flow changed much, others by more than before."""
    before, last = _changes(rounds)
    if last <= LITTLE or not (fast or last > before):
        return courant
    return min(SWEEPING_FAST if fast else SWEEPING, courant)


def spread_if_it_lingers(rounds: Sequence[Round], fast: bool = False) -> float:
    """The spread of the loads of a flow that may be taken though it still changes; infinite: it may not.

    Not while its changes fall, or where the last one was large.
    """
    before, last = _changes(rounds)
    if last < FALLING * before or last > TOO_LARGE[3][1]:
        return math.inf
    spread = spread_of(rounds, LINGERING, SWEEPING_FAST if fast else SWEEPING)
    if spread <= NEARLY and last >= FALLING * rounds[-LINGERING].of_flow:
        return spread
    closely = spread_of(rounds, BRIEFLY, NEAR)
    return closely if closely <= CLOSELY else math.inf


def _changes(rounds: Sequence[Round]) -> tuple[float, float]:
    """By how much the flow changed in the last but one and in the last round; infinite where there was none."""
    before, last = (math.inf, *(one.of_flow for one in rounds))[-2:]
    return before, last


def spread_of(rounds: Sequence[Round], count: int = LINGERING, courant: float = SWEEPING) -> float:
    """By how much the loads of the last `count` rounds differ from the last ones, over their size.

    It is infinite where there are too few rounds with loads and Courant numbers of `courant` or more.
    """
    last = rounds[-count:]
    if len(last) < count or not last[0].loads or min(one.step for one in last) < courant:
        return float("inf")
    values = np.array([one.loads for one in last])
    return float(np.linalg.norm(values - values[-1], axis=1).max() / np.linalg.norm(values[-1]))


def _usual(domain: Domain, of_logarithms: Floats, most: float) -> float:
    """The size of a correction that decides on steps: the largest; in space that of `most` nodes. Collective.

    In space a few nodes in cells of bad shape are slow, where the others are not, and so is ln k in the crevices of a
    bed, where it has no weight. Corrections are bounded.
    """
    if domain.gdim == 3:
        return most
    sizes = np.where(np.isfinite(of_logarithms), np.abs(of_logarithms), np.inf)
    return float(domain.comm.allreduce(sizes.max(initial=0.0), op=MPI.MAX))


def bound(fluid: Fluid, of_flow: Floats, part: float = LARGEST_CHANGE) -> None:
    """Let no velocity change by more than a part of the largest speed: at a few nodes it may overshoot. Collective."""
    most = part * _fastest(fluid)
    nodes = fluid.space.velocity_map.reshape(-1, fluid.domain.gdim)
    own = nodes[nodes[:, -1] < len(of_flow)]
    sizes = np.linalg.norm(of_flow[own], axis=1)
    of_flow[own] *= np.minimum(1.0, most / np.maximum(sizes, most))[:, None]


def _fastest(fluid: Fluid) -> float:
    """The largest speed at a node. Collective."""
    nodes = fluid.space.velocity_map.reshape(-1, fluid.domain.gdim)
    speeds = np.linalg.norm(fluid.state.x.array[nodes], axis=1)
    return float(fluid.domain.comm.allreduce(float(speeds.max(initial=0.0)), op=MPI.MAX))


def _largest_change(fluid: Fluid, of_flow: Floats) -> float:
    """The largest change of a velocity at a node, over the largest speed. Collective."""
    nodes = fluid.space.velocity_map.reshape(-1, fluid.domain.gdim)
    own = nodes[nodes[:, -1] < len(of_flow)]
    most = float(np.linalg.norm(of_flow[own], axis=1).max(initial=0.0))
    changed = fluid.domain.comm.allreduce(most, op=MPI.MAX)
    return changed / _fastest(fluid) if np.isfinite(changed) else np.inf


def _next(
    courant: float, of_logarithms: float, of_flow: float, turbulence: TurbulenceFields, gently: bool
) -> float:
    """The Courant number after a step with corrections of these sizes."""
    gdim = turbulence.domain.gdim
    of_logarithms *= WARY if turbulence.stretched and not gently else 1.0
    too_large = TOO_LARGE_GENTLY if gently else TOO_LARGE[gdim]
    for factor, *bounds in GENTLY if gently else LONGER[gdim]:
        if of_logarithms < bounds[0] and of_flow < bounds[1]:
            return min(factor * courant, LARGEST)
    return 0.5 * courant if of_logarithms > too_large[0] or of_flow > too_large[1] else courant
