"""The steady flow and its turbulence, solved together by Newton's method in pseudo-time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from ... import compat
from ...arrays import Floats
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...mesh.domain import Domain
from .coupled_flow import LARGEST_CHANGE, MOST_AT_NODES, CoupledFlow, bound, largest_change
from .fields import TurbulenceFields
from .iteration import Round, relative_change

MOST_STEPS = {2: 300, 3: 100}  # in space a flow takes 15 to 40, or is not steady
# Courant numbers: the first, that near a steady state, the least, that from which on a step is one of Newton's
# method, and the largest.
FIRST, NEAR, LEAST, NEWTON, LARGEST = 2.0, 100.0, 1e-3, 1e4, 1e12
LARGEST_CORRECTION = 1.0  # of a logarithm at a node, in a step
PROJECTION = 1e-2  # Courant number of a step that does little but make the start free of divergence
# Corrections of logarithms, and of the flow relative to it, up to which the next step is longer by a factor; and those
# beyond which it is half as long; by dimension. In the plane, with 4, 0.1 and 20, 0.15 in the last places, a stone at
# u* d/nu = 430 takes 188 and 85 steps on two meshes, with these 75 and 77 (benchmarks/turbulent_models.py). In
# space logarithms are judged by their root mean square. Where steps double for logarithms up to 0.6 and the flow up to
# 0.05, not 0.3 and 0.03, a sphere on a level bed at u* d/nu = 86 takes 15 of them, not 19. With the bounds of the plane
# one among others at 30 had no steady flow in 20 steps (before peaks of ln k were bounded).
LONGER = {
    2: ((6.0, 0.1, 0.01), (2.0, 0.7, 0.04), (1.3, 1.5, 0.08)),
    3: ((1e3, 0.02, 2e-3), (6.0, 0.05, 3e-3), (2.0, 0.6, 0.05), (1.3, 0.7, 0.08)),
}
TOO_LARGE = {2: (6.0, 0.12), 3: (3.0, 0.1)}
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
BEGUN = (
    1.5,
    0.015,
)  # corrections of logarithms and flow with which a flow is a start for a faster one
# In space a wake may change for ever, at a few nodes. The flow is taken all the same when in so many steps with such a
# Courant number at least the loads on the grain have differed from the last ones by less than this part of them. What
# they then differ by is told: past a sphere in its pocket at u* d/nu = 138 0.9% (docs/contribute/defaults.md).
# Where all steps are long fewer tell as much of smaller changes.
LINGERING, SWEEPING, SWEEPING_FAST, NEARLY = 10, 16.0, 8.0, 0.03
BRIEFLY, CLOSELY = 4, 2e-3
# Steps in the plane, where most flows take less than 100, after which one that changes for ever is taken likewise:
# in the dead water at a contact k of single nodes may go around while the flow changes by 0.1%.
PATIENT = 200
# Correction of the flow beyond which steps in space are sweeps of sixteen cells at most where it grew, of eight where
# the flow is fast; and the factor by which it falls while it does. In a wake that changes for ever longer ones change
# it more and more. Past one grain of a random bed at u* d/nu = 300 it grew in steps of 16 to 83 cells, until there was
# no flow, and fell in each of eight; from 0.002 on in steps of 20 and 40, too. At 86 eight mean 19 steps, not 15.
LITTLE, FALLING = 3e-3, 0.5
# Steps of a fast flow in space after which velocities are bounded by less, and the change of one at a node, over the
# largest speed, with which such a step is repeated, shorter.
BEGINNING, BURST = 3, 0.3
NEARBY = 0.1  # first correction of the flow up to which, in space, another one is near enough for long steps from it
FAILED, FAILED_AT_FIRST, CUT = (
    0.3,
    1.5,
    0.3,
)  # corrections of the flow with which a step is repeated, shorter


@dataclass(frozen=True)
class Marching:
    """How a flow is to be marched to its steady state.

    Args:
        first: Courant number of the first step.
        nearly: whether it is to be a start for another flow only.
        gently: whether the start has divergence, and no velocity may change much in a step, since the flow has to
            separate from a smooth wall.
        fast: whether in space steps are sweeps of eight cells while the flow changes much, shorter where nodes do.
        onwards: whether a fast flow in space, or one that is to go gently, begins with another flow, not with a guess,
            whose first steps change nodes by much.
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

    `watch` is called with each step. `loads` are those on the grain, or on the bed, in units of a force: a flow that
    still changes is taken where these hardly do, and the last round has their spread.

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

    def __init__(
        self, system: CoupledFlow, fluid: Fluid, turbulence: TurbulenceFields, how: Marching
    ):
        self._system, self._fluid, self._turbulence, self._how = system, fluid, turbulence, how
        self._in_space = fluid.domain.gdim == 3
        self._sizes, self._left = (0.0, 0.0), (0.0, 0.0)
        self.rounds: list[Round] = []
        self.courant = PROJECTION if how.gently else how.first

    def step(self, number: int, loads: Callable[[], Floats] | None) -> bool:
        """Make a step if its corrections are not too large; else make the next one shorter, and return False."""
        fluid, turbulence, how = self._fluid, self._turbulence, self._how
        # All the way, one node at an outflow took turns between states whose ln k were 0.085 apart, for 240 steps.
        settling = not self._in_space and self.courant >= NEWTON
        of_flow, of_logarithms = self._system.correction(self.courant, half_way=settling)
        self._judge(of_flow, of_logarithms)
        if self._in_space and not self.rounds and self.courant > FIRST and self._sizes[1] > NEARBY:
            self.courant = FIRST
            return False
        finite = bool(np.isfinite(sum(self._sizes)))
        # Not from a flow on coarser cells: over a hump (benchmarks/turbulent_hump.py) it took 64 steps, not 40.
        if finite and (how.fast or not (self._in_space or (how.gently and how.onwards))):
            self._system.slow_down(of_flow, of_logarithms)
        calmly = how.fast and (how.onwards or len(self.rounds) >= BEGINNING)
        burst = calmly and largest_change(fluid, of_flow) > BURST
        if not finite or self._harmful() or burst:
            self.courant *= CUT
            return False
        largest = MOST_AT_NODES[0] if how.fast else LARGEST_CORRECTION
        if self._in_space:
            bound(fluid, of_flow, MOST_AT_NODES[1] if calmly else LARGEST_CHANGE)
        self._system.carry_out(of_flow, np.clip(of_logarithms, -largest, largest))
        if loads is not None:
            turbulence.look()
        found = () if loads is None else tuple(map(float, loads()))
        self.rounds.append(Round(number, self.courant, self._sizes[1], self._sizes[0], found))
        return True

    def _judge(self, of_flow: Floats, of_logarithms: Floats) -> None:
        """Note the sizes of corrections (owned unknowns,), of logarithms first: by which steps go, and to an end."""
        most = self._turbulence.of_most(of_logarithms)
        usual = _usual(self._fluid.domain, of_logarithms, most)
        of_whole = relative_change(self._fluid, of_flow)
        self._sizes = usual, largest_change(self._fluid, of_flow) if self._how.gently else of_whole
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
        if not self._in_space and len(self.rounds) < PATIENT:
            return False
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
