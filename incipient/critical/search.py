"""The search for the critical flow: the slowest one, as the flow grows from rest, in which the grain is not held.

It begins with Stokes flow, which always can be solved and has a load proportional to its strength. From there the
flow is made faster, in steps; after each the load is interpolated (`loadpath`), which says where the grain is lost,
where a flow in between has to be solved to be sure that it is not, or how far up to go. Where no steady flow is found
the search goes on below, or beyond, if that is where the load extrapolated loses the grain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..contact import Load
from ..contact.safety import SafetyStatus, safety_factor
from ..effects.effect import SlowestFlow
from ..effects.known import EFFECTS
from ..errors import ConvergenceError, SceneError
from ..evaluation.contact_verdict import followed, load_of
from ..parallel import from_first
from ..planning.effects import EffectName
from ..results.loads import Couples, Forces
from ..simulation.state import Run
from ..simulation.steady import loads_at, make_as_fast
from .loadpath import LoadPath, flow_of

if TYPE_CHECKING:
    from ..contact.rocking import Rocking

Solve = Callable[[Run, float, float], tuple[Forces, Couples]]

CREEPING = 1e-6  # grain Reynolds number of the flow that stands for Stokes flow
FIRST = 30.0  # grain Reynolds number of the first flow with inertia, at most
GROWTH, LEAST_GROWTH = (
    4.0,
    1.1,
)  # from a flow to the next faster one, at most, and from the slowest at least
# Over the flow in which a load that goes with its square moves the grain: loads grow less.
BEYOND_SQUARE = 1.05
LARGEST = 1000.0  # grain Reynolds number up to which a threshold is looked for, or
MOST_FASTER = 10.0  # so many times the flow of the scene, if that is more
NEAR = 3e-3  # relative: a flow solved so near the critical one is taken for it, with the load interpolated
# Likewise in space where walls are resolved: wakes may change for ever, and loads with them.
NEAR_IN_SPACE = 0.01
WEAK = 0.1  # force of the flow over the weight, where any flow moves the grain
RESOLVED = 1.1  # an interval whose ends differ by no more than this factor is not divided further
MOST_FLOWS, MOST_FAILURES = 40, 6
APART = 1.03  # a flow is tried only so far from one that could not be solved
ROCKS_IN_ALL = "the grain rocks from rest to rest in all computed flows"
ROCKS_BELOW = "the grain rocks from rest to rest, and beyond no steady flow was found"
NOT_WITHIN = f"the search did not converge within {MOST_FLOWS} flows"


@dataclass(frozen=True)
class SolvedFlow:
    """A flow that was solved: its factor, and the safety factor of the grain in it."""

    factor: float
    safety_factor: float


@dataclass(frozen=True, eq=False)
class OwnMesh:
    """The critical flow on a mesh made for that flow itself.

    change:        (6,) of force and couple there, without sign
    safety_factor: there; one if the meshes agree
    """

    change: np.ndarray
    safety_factor: float


@dataclass(frozen=True, eq=False)
class Found:
    """What a search has found.

    factor:   factor of the critical flow; 0: any flow, or none at all, moves the grain; inf: none that was seen
    between:  factors of flows that it is between, where no steady flow was found nearer to it
    rocking:  the rests in that flow as its load grows, of a grain that any flow moves and that rests again
    held_to:  factor up to which the grain is held, inf if it always is
    path:     the load as the flow grows
    trials:   flows solved, in that order; unsolved: factors at which no steady flow was found
    reason:   why the search ended without a critical flow
    own_mesh: in a mean flow what a mesh made for the critical flow itself says of it
    """

    factor: float
    held_to: float
    path: LoadPath
    trials: tuple[SolvedFlow, ...]
    unsolved: tuple[float, ...] = ()
    reason: str = ""
    between: tuple[float, float] | None = None
    rocking: Rocking | None = None
    own_mesh: OwnMesh | None = None

    @property
    def is_critical(self) -> bool:
        """Whether there is a flow at which the grain begins to move."""
        return 0.0 < self.factor < np.inf

    @property
    def load(self) -> Load:
        """The critical load; where any flow moves the grain that of a slow one, else that of the fastest one seen."""
        if self.factor == 0.0:
            drag = float(np.linalg.norm(self.path.loads[0, :3])) or 1.0
            return self.path.load(WEAK * float(np.linalg.norm(self.path.rest.weight)) / drag)
        return self.path.load(self.factor if self.is_critical else float(self.path.factors[-1]))


class CriticalSearch:
    """The search on one mesh, in a run that is prepared. Public methods are collective unless stated otherwise.

    Args:
        solve: solves for the loads in a flow faster by a factor, going on from another (see `simulation.steady`).
    """

    def __init__(self, run: Run, solve: Solve = loads_at):
        scene, self._loads_at = run.scene, solve
        assert run.contacts is not None and scene.contact is not None
        self.run, self.trials, self.unsolved = run, list[SolvedFlow](), list[float]()
        self._contacts, self._friction = run.contacts, scene.contact.friction
        self._solved: dict[float, tuple[Forces, Couples]] = {}
        self._states: dict[float, list[np.ndarray]] = {}
        numbers = run.plan.numbers
        self._reynolds = (numbers and numbers.grain_reynolds) or scene.fluid.reynolds
        self._sure = 0.0  # factor up to which the grain is surely held
        self._held: set[tuple[float, float]] = set()  # intervals in which it is

    def from_rest(self) -> Found:
        """Search from rest upwards."""
        bounds = (effect.slowest_flow(self.run.setup) for effect in EFFECTS)
        if bound := max(filter(None, bounds), key=lambda one: one.factor, default=None):
            return self._from_slowest(bound)
        inertia = self.run.plan.has(EffectName.INERTIA)
        slow = CREEPING / self._reynolds if inertia else 1.0
        self._solve(slow)
        if found := self._at_once(slow):
            return found
        if not inertia:
            value = self.trials[0].safety_factor
            return self._ended(slow * value, slow * value, "the load grows in proportion")
        return self._upwards(slow)

    def _at_once(self, slow: float) -> Found | None:
        """The outcome where contacts hold the grain against no load, or not its weight; None if they do hold it."""
        value, load = self.trials[-1].safety_factor, self._load(slow)
        status = safety_factor(load, self._contacts, self._friction).status
        if status is SafetyStatus.NO_RESERVE and (found := self._of_rocking(slow)):
            return found
        if value > 0.0:
            return None
        held = status is SafetyStatus.NO_RESERVE
        return self._ended(
            0.0, 0.0, "any flow moves the grain" if held else "its weight alone moves it"
        )

    def _of_rocking(self, slow: float) -> Found | None:
        """The flow in which a grain leaves its pocket that rocks in slower ones; None if it does not rock.

        Every flow solved says by the load of what shape, growing from nothing, the grain leaves. How that goes with
        the flow is taken from the last two.
        """
        rocking, factor, power, held_to = self.rocks(slow), slow, 1.0, 0.0
        if rocking is None or rocking.critical == 0.0:
            return None
        largest, reason = max(LARGEST / self._reynolds, MOST_FASTER), ROCKS_IN_ALL
        while True:
            held_to = max(held_to, factor) if rocking.critical >= 1.0 else held_to
            if np.isinf(rocking.critical):
                break
            goal = factor * rocking.critical ** (1.0 / power)
            if not self.run.plan.has(EffectName.INERTIA) or self._is_near(goal):
                return replace(self._ended(goal, goal, ""), rocking=rocking)
            following = min(goal, self._after(slow) if factor == slow else GROWTH * factor)
            if following > largest:
                break
            if len(self.trials) >= MOST_FLOWS:
                reason = NOT_WITHIN
                break
            beyond_all = min((one for one in self.unsolved if one > factor), default=np.inf)
            if following > beyond_all / APART or not self._try(following):
                following = max(self._states)  # that on the way to the one that was not found
                if following <= factor:
                    reason = ROCKS_BELOW
                    break
            beyond = self.rocks(following)
            if beyond is None or beyond.critical == 0.0:
                reason = f"the grain rocks, but not in the flow {following:.3g} times the scene's"
                break
            change = np.log(rocking.critical / beyond.critical) / np.log(following / factor)
            power = float(np.clip(change, 1.0, 3.0))
            rocking, factor = beyond, following
        return replace(self._ended(np.inf, held_to, reason), rocking=rocking)

    def rocks(self, factor: float) -> Rocking | None:
        """Rests of the grain as the load of a solved flow grows; its critical factor is noted in the trial."""
        found = from_first(self.run.comm, lambda: followed(self.run.scene, self._load(factor)))
        if found is not None:
            self.trials[-1] = SolvedFlow(factor, found.critical)
            self.run.voice.say(f"flow x {factor:.6g}: rocks, safety factor {found.critical:.6g}")
        return found

    def _from_slowest(self, bound: SlowestFlow) -> Found:
        """Search upwards from the flow to start with, if it holds the grain, or else from the slowest one."""
        if bound.expected:
            self.run.voice.say(bound.expected)
        if (
            bound.start > bound.factor
            and self._try(bound.start)
            and self.trials[0].safety_factor >= 1.0
        ):
            return self._upwards(bound.start)
        self._solve(bound.factor)
        if found := self._at_once(bound.factor):
            return found
        if self.trials[-1].safety_factor < 1.0:
            slowest = f"the slowest flow {bound.why}, {bound.factor:.3g} times the scene's"
            raise SceneError(
                f"flow: the grain moves in {slowest}; use a heavier grain, or {bound.remedy}"
            )
        return self._upwards(bound.factor)

    def near(self, before: Found) -> Found:
        """Search near the critical flow of another mesh, from whose load that of this mesh will differ little."""
        factor = before.factor
        if before.rocking is not None:
            return self._rocks_near(factor)
        while True:
            if factor not in self._states and not self._try(factor):
                raise ConvergenceError(
                    f"no steady flow was found at {factor:.4g} times that of the scene"
                )
            path = replace(self._path(), before=before.path.before or before.path)
            low, high = 0.5 * factor, 2.0 * factor
            new = path.loss(low, high) if path.judged(low).value >= 1.0 else None
            if new is None:
                raise ConvergenceError(
                    f"no threshold near {factor:.4g} times the flow of the scene"
                )
            if self._is_near(new):
                return Found(new, new, path, tuple(self.trials), tuple(self.unsolved))
            factor = self._next_near(factor, new)

    def _rocks_near(self, factor: float) -> Found:
        """The flow near a factor in which a grain that rocks leaves its pocket; loads go as the square of the speed."""
        while True:
            rocking = self.rocks(factor) if self._try(factor) else None
            if rocking is None or not 0.0 < rocking.critical < np.inf:
                raise ConvergenceError(
                    f"no threshold near {factor:.4g} times the flow of the scene"
                )
            new = factor * rocking.critical**0.5
            if self._is_near(new):
                return replace(self._ended(new, new, ""), rocking=rocking)
            factor = self._next_near(factor, new)

    def _next_near(self, factor: float, new: float) -> float:
        """The factor to try next. Raises ConvergenceError after MOST_FLOWS flows."""
        if len(self.trials) >= MOST_FLOWS:
            raise ConvergenceError(
                f"the threshold near {new:.4g} times the flow of the scene: {NOT_WITHIN}, the last two at "
                f"{factor:.4g} and {new:.4g}; use a smaller numerics.mesh_size"
            )
        return new

    def load_at(self, factor: float) -> Load:
        """The load in the flow at a factor, found at once or else from one half as fast. Raises ConvergenceError."""
        if not self._try(factor):
            self._solve(0.5 * factor)
            self._solve(factor)
        return self._load(factor)

    def at_nearest(self, factor: float) -> tuple[Forces, Couples]:
        """Make the fluid that of the flow solved nearest to a factor; force and couple there."""
        within = min(factor, max(self._states))
        nearest = min(self._states, key=lambda one: abs(one - within))
        if not self.run.setup.is_averaged:
            make_as_fast(self.run, nearest)
        self._start_from(nearest)
        return self._solved[nearest]

    def _upwards(self, slow: float) -> Found:
        largest = max(LARGEST / self._reynolds, MOST_FASTER)
        while len(self.trials) < MOST_FLOWS:
            path = self._path()
            inside = self._inside(path)
            if isinstance(inside, Found):
                return inside
            top = float(path.factors[-1])
            following = inside or self._beyond(
                path, top, self._after(slow) if top == slow else largest
            )
            if isinstance(following, Found):
                return following
            self._try(following)
        return self._ended(np.inf, self._sure, NOT_WITHIN)

    def _after(self, slow: float) -> float:
        """The flow after the slowest one; of mean flows the one in which a load that goes with its square moves it."""
        if not self.run.setup.is_averaged:
            return FIRST / self._reynolds
        return slow * float(
            np.clip(BEYOND_SQUARE * self.trials[-1].safety_factor ** 0.5, LEAST_GROWTH, GROWTH)
        )

    def _inside(self, path: LoadPath) -> float | Found | None:
        """The next flow among those solved, or the critical one; nothing: the grain is held in all of them."""
        for low, high in pairwise(path.factors.tolist()):
            self._sure = low
            if (low, high) in self._held:
                continue
            loss = path.loss(low, high)
            near = loss is not None and self._is_near(loss)
            if loss is not None and not near and self._may_be_solved(loss):
                return loss
            end = loss or high
            doubtful = path.doubtful(low, high, end) if end > RESOLVED * low else None
            if doubtful is not None and self._may_be_solved(doubtful):
                return doubtful
            if loss is None:
                self._held.add((low, high))
                continue
            found = self._ended(loss, loss, "" if near else "no steady flow was found nearer")
            return found if near else replace(found, between=(low, high))
        return None

    def _beyond(self, path: LoadPath, top: float, largest: float) -> float | Found:
        """The next flow above all those solved, or why there is none."""
        goal = min(GROWTH * top, largest) if len(path.factors) > 1 else largest
        loss = path.loss(top, max(goal, top))
        if loss is not None and self._is_near(loss):
            return self._ended(loss, loss, "")
        following = loss or goal
        beyond = [factor for factor in self.unsolved if factor > top]
        if top >= largest / APART:
            return self._ended(np.inf, top, "the grain is held in all flows looked at")
        if self._may_be_solved(following) and len(self.unsolved) < MOST_FAILURES:
            return following
        between = float(np.sqrt(top * min(beyond, default=top)))
        if (
            self._may_be_solved(between)
            and between > APART * top
            and len(self.unsolved) < MOST_FAILURES
        ):
            return between
        guess = (
            f"; the load extrapolated moves it at about {loss:.2g} times that flow" if loss else ""
        )
        return self._ended(
            np.inf, top, f"the grain is held, and beyond no steady flow was found{guess}"
        )

    def _is_near(self, factor: float) -> bool:
        near = NEAR_IN_SPACE if self._lingers() else NEAR
        return any(abs(one / factor - 1.0) < near for one in self._states)

    def _lingers(self) -> bool:
        """Whether wakes may change for ever: in space, where walls of a mean flow are resolved."""
        setup = self.run.setup
        return setup.is_averaged and setup.resolves_walls and setup.geometry.gdim == 3

    def _may_be_solved(self, factor: float) -> bool:
        """Whether no flow as fast has failed."""
        return all(max(factor / one, one / factor) > APART for one in self.unsolved)

    def _try(self, factor: float, here: bool = False) -> bool:
        """Solve; if there is no such flow, note that, and solve where the way to it ended."""
        try:
            self._solve(factor, here)
        except ConvergenceError:
            self.unsolved.append(factor)
            if self.run.setup.is_averaged:  # sought as a whole: what is left of it is no flow
                self.run.voice.say(f"flow x {factor:.6g}: no steady flow found")
                return False
            reached = self.run.fluid.reynolds / self.run.plan.reynolds
            self.run.voice.say(
                f"flow x {factor:.6g}: no steady flow found, the last at {reached:.6g}"
            )
            if not here and reached > APART * max(
                (one for one in self._states if one < factor), default=0.0
            ):
                self._try(
                    reached, here=True
                )  # on the way flows are solved less well: this may fail, too
            return False
        return True

    def _solve(self, factor: float, here: bool = False) -> None:
        """Solve from another flow, or from the present state, which is nearly that flow."""
        start = self._start(factor)
        if start and not here:
            self._start_from(start)
        run = self.run
        force, couple = self._loads_at(run, factor, factor if here else start)
        self._solved[factor] = force, couple
        self._states[factor] = [one.x.array.copy() for one in run.states]
        value = safety_factor(self._load(factor), self._contacts, self._friction).value
        self.trials.append(SolvedFlow(factor, value))
        run.voice.say(f"flow x {factor:.6g}: safety factor {value:.6g}")

    def _start(self, factor: float) -> float:
        """The flow that another one is solved from, the next slower or, where wakes linger, the nearest; 0: none."""
        if self._states and self._lingers():
            return min(self._states, key=lambda one: abs(np.log(one / factor)))
        return max((one for one in self._states if one < factor), default=0.0)

    def _start_from(self, factor: float) -> None:
        for one, values in zip(self.run.states, self._states[factor], strict=True):
            one.x.array[:] = values

    def _load(self, factor: float) -> Load:
        return load_of(self.run.scene.placement, *self._solved[factor])

    def _path(self) -> LoadPath:
        factors = np.array(sorted(self._solved))
        loads = [self._load(factor) for factor in factors]
        over = np.array([flow_of(load) for load in loads]) / factors[:, None]
        rest = Load(np.zeros(3), np.zeros(3), loads[0].weight, loads[0].centre)
        return LoadPath(factors, over, rest, self._contacts, self._friction)

    def _ended(self, factor: float, held_to: float, reason: str) -> Found:
        return Found(
            factor, held_to, self._path(), tuple(self.trials), tuple(self.unsolved), reason
        )
