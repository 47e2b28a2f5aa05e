"""The search for the critical flow on one mesh, as the flow grows from rest.

It begins with Stokes flow, which always converges. The interpolated load (`path`) determines the next flow: the
critical one, an intermediate one to exclude motion, or a faster one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..contact import Load
from ..contact.safety import SafetyStatus, safety_factor
from ..errors import ConvergenceError, SceneError
from ..parallel import from_first
from ..planning.effects import slowest_flow
from ..results.quantity import without_rest
from ..simulation.loads import followed, load_of
from ..simulation.state import Run
from ..simulation.steady import loads_at, make_as_fast
from .outcome import Outcome, SolvedFlow
from .path import LoadPath

if TYPE_CHECKING:
    from ..contact.rocking import Rocking

Solve = Callable[[Run, float, float], Floats]  # force and torque, (6,) or (instants, 6)

FIRST = 30.0  # largest grain Reynolds number of the first flow with inertia
GROWTH = 4.0  # largest ratio of successive flows
MOST_FLOWS = 40
APART = 1.03  # least ratio of a flow to an unconverged one
# In 3-D with a model of turbulence, as measured (docs/contribute/defaults.md).
EXPECTED = "a search takes four flows or more, of up to a minute and a half each; above u* d/nu = 100 of four and more"
NOT_WITHIN = f"the search did not converge within {MOST_FLOWS} flows"


@dataclass(frozen=True, eq=False)
class OwnMesh:
    """The critical flow on a mesh made for it: absolute change (6,) of force and torque, and safety factor."""

    change: Floats
    safety_factor: float


@dataclass(frozen=True, eq=False)
class CriticalFlow(Outcome):
    """The result of a search on a mesh.

    between:  factors of the adjacent flows, if no nearer one converged
    rocking:  the equilibria of a grain that rocks before it leaves
    """

    path: LoadPath
    between: tuple[float, float] | None = None
    rocking: Rocking | None = None
    own_mesh: OwnMesh | None = None

    @property
    def load(self) -> Load:
        """The critical load; otherwise that of a weak flow if any flow moves the grain, or of the fastest.

        Without any flow if the weight alone moves it.
        """
        if (
            self.factor == 0.0
            and not safety_factor(self.path.rest, self.path.contacts, self.path.law).held
        ):
            return self.path.rest
        if self.factor == 0.0:
            drag = float(np.linalg.norm(self.path.loads[0, 0, :3])) or 1.0
            return self.path.load(0.1 * float(np.linalg.norm(self.path.rest.weight)) / drag)
        return self.path.load(self.factor if self.is_critical else float(self.path.factors[-1]))


class CriticalSearch:
    """The search in a prepared run. Public methods are collective.

    solve: computes the loads in a flow faster by a factor, starting from another (see `simulation.steady`); in an
        oscillating flow at the same instants of a period for all factors
    """

    def __init__(self, run: Run, solve: Solve = loads_at):
        scene, self._loads_at = run.scene, solve
        assert run.contacts is not None and scene.contact is not None
        self.run, self.trials, self.unsolved = run, list[SolvedFlow](), list[float]()
        self._holds = run.contacts, scene.contact.law
        self._solved: dict[float, Floats] = {}
        self._worst: dict[float, int] = {}  # the instant with the least safety factor
        self._states: dict[float, list[Floats]] = {}
        self._inertia = run.plan.has("inertia")
        self._reynolds = run.plan.numbers.grain_reynolds or scene.fluid.reynolds
        # Searched up to a grain Reynolds number of 1000, at least to ten times the flow.
        self._largest = max(1000.0 / self._reynolds, 10.0)
        # Whether wakes may change for ever: then the nearest flow is the best start.
        self._lingers = run.setup.scene.resolves_walls and run.setup.scene.gdim == 3
        # Relative distance from a computed flow within which the interpolated load is accurate.
        self._near = 0.01 if self._lingers else 3e-3

    def from_rest(self) -> CriticalFlow:
        averaged = self.run.setup.scene.is_averaged
        # Stokes flow is represented by that of a grain Reynolds number of 1e-6.
        slow, start = 1e-6 / self._reynolds if self._inertia else 1.0, 0.0
        if averaged:
            slow, start = slowest_flow(self.run.setup)
        if start:
            self.run.voice.say(EXPECTED)
        if start > slow and self._try(start) and self.trials[0].safety_factor >= 1.0:
            return self._upwards(start)
        self._solve(slow)
        at_rest = safety_factor(self._load(slow), *self._holds)
        held = at_rest.status is SafetyStatus.NO_RESERVE
        if held and (rocking := self._rocking(slow, 2.0 if averaged else 1.0)):
            return rocking
        if held:
            return self._ended(0.0, 0.0, "any flow moves the grain")
        if at_rest.value == 0.0:
            body = self.run.scene.body
            why = f"the grain moves without any flow; {without_rest(body and body.settle)}"
            return self._ended(0.0, 0.0, why)
        if not self._inertia:
            critical = slow * at_rest.value
            return self._ended(critical, critical, "the load grows in proportion")
        if averaged and at_rest.value < 1.0:
            slowest = f"the slowest flow looked at, {slow:.3g} times the scene's"
            raise SceneError(
                f"flow: the grain moves in {slowest}; use a heavier grain, or sweep fluid.reynolds below "
                'flow.kind = "log-law", without turbulence'
            )
        return self._upwards(slow)

    def near(self, before: CriticalFlow) -> CriticalFlow:
        """Search near the critical flow of another mesh, whose load differs little. Raises ConvergenceError."""
        factor, known = before.factor, before.path.before or before.path
        none = f"no threshold near {factor:.4g} times the flow of the scene"
        while len(self.trials) < MOST_FLOWS:
            if factor not in self._states and not self._try(factor):
                why = f"no steady flow converged at {factor:.4g} times that of the scene"
                raise ConvergenceError(why)
            if before.rocking is not None:
                rocking = self._rocking(factor, 2.0)
                if rocking is None or not rocking.is_critical:
                    raise ConvergenceError(f"{none}: {rocking.reason}" if rocking else none)
                return rocking
            path, last = replace(self._path(), before=known), factor
            low, high = 0.5 * factor, 2.0 * factor
            critical = path.loss(low, high) if path.safety(low) >= 1.0 else None
            if critical is None:
                raise ConvergenceError(none)
            if self._is_near(critical):
                return replace(self._ended(critical, critical, ""), path=path)
            factor = critical
        raise ConvergenceError(
            f"the threshold near {factor:.4g} times the flow of the scene: {NOT_WITHIN}, the last two at {last:.4g} "
            f"and {factor:.4g}; use a smaller numerics.mesh_size"
        )

    def load_at(self, factor: float) -> Load:
        """The load at a factor, if necessary started at half the factor. Raises ConvergenceError."""
        if not self._try(factor):
            self._solve(0.5 * factor)
            self._solve(factor)
        return self._load(factor)

    def at_nearest(self, factor: float) -> Floats:
        """Restore the computed flow nearest to a factor; returns its force and torque (6,)."""
        within = min(factor, max(self._states))
        nearest = min(self._states, key=lambda known: abs(known - within))
        if not self.run.setup.scene.is_averaged:
            make_as_fast(self.run, nearest)
        self._restore(nearest)
        return self._solved[nearest][self._worst[nearest]]

    def rocks(self, factor: float) -> Rocking | None:
        rocking = from_first(self.run.comm, lambda: followed(self.run.scene, self._load(factor)))
        if rocking is not None:
            self.trials[-1] = SolvedFlow(factor, rocking.critical)
            self.run.voice.say(f"flow x {factor:.6g}: rocks, safety factor {rocking.critical:.6g}")
        return rocking

    def _rocking(self, factor: float, power: float) -> CriticalFlow | None:
        rocking, held_to = self.rocks(factor), 0.0
        if rocking is None or rocking.critical == 0.0:
            return None

        def ended(reason: str) -> CriticalFlow:
            return replace(self._ended(np.inf, held_to, reason), rocking=rocking)

        while len(self.trials) < MOST_FLOWS:
            held_to = max(held_to, factor) if rocking.critical >= 1.0 else held_to
            critical = factor * rocking.critical ** (1.0 / power)
            if critical < np.inf and (not self._inertia or self._is_near(critical)):
                return replace(self._ended(critical, critical, ""), rocking=rocking)
            following = min(critical, max(GROWTH * factor, FIRST / self._reynolds))
            if critical == np.inf or following > self._largest:
                return ended("the grain rocks from rest to rest in all computed flows")
            failed = min((other for other in self.unsolved if other > factor), default=np.inf)
            if following > failed / APART or not self._try(following):
                following = max(self._states)  # towards the unconverged flow
                if following <= factor:
                    return ended(
                        "the grain rocks from rest to rest, and beyond no steady flow converged"
                    )
            beyond = self.rocks(following)
            if beyond is None or beyond.critical == 0.0:
                return ended(
                    f"the grain rocks, but not in the flow {following:.3g} times the scene's"
                )
            change = np.log(rocking.critical / beyond.critical) / np.log(following / factor)
            power = float(np.clip(change, 1.0, 3.0))
            rocking, factor = beyond, following
        return ended(NOT_WITHIN)

    def _upwards(self, slow: float) -> CriticalFlow:
        while len(self.trials) < MOST_FLOWS:
            path = self._path()
            following = self._inside(path) or self._beyond(path, slow)
            if isinstance(following, CriticalFlow):
                return following
            self._try(following)
        return self._ended(np.inf, slow, NOT_WITHIN)

    def _inside(self, path: LoadPath) -> float | CriticalFlow | None:
        for low, high in pairwise(path.factors.tolist()):
            loss = path.loss(low, high)
            near = loss is not None and self._is_near(loss)
            if loss is not None and not near and self._may_converge(loss):
                return loss
            end = loss or high
            doubtful = path.doubtful(low, high, end) if end > 1.1 * low else None
            if doubtful is not None and self._may_converge(doubtful):
                return doubtful
            if loss is not None:
                ended = self._ended(end, end, "" if near else "no steady flow converged nearer")
                return ended if near else replace(ended, between=(low, high))
        return None

    def _beyond(self, path: LoadPath, slow: float) -> float | CriticalFlow:
        top = float(path.factors[-1])
        goal = min(GROWTH * top, self._largest)
        if top <= slow and self.run.setup.scene.is_averaged:
            # A little over the critical flow of a quadratic load, since the load grows less.
            quadratic = 1.05 * self.trials[-1].safety_factor ** 0.5
            goal = slow * float(np.clip(quadratic, 1.1, GROWTH))
        elif top <= slow:
            goal = FIRST / self._reynolds
        loss = path.loss(top, max(goal, top))
        if loss is not None and self._is_near(loss):
            return self._ended(loss, loss, "")
        if top >= self._largest / APART:
            return self._ended(np.inf, top, "the grain is held in all computed flows")
        failed = min((factor for factor in self.unsolved if factor > top), default=top)
        for following in (loss or goal, float(np.sqrt(top * failed))):
            allowed = following > top and len(self.unsolved) < 6
            if allowed and self._may_converge(following):
                return following
        reason = "the grain is held, and beyond no steady flow converged"
        if loss:
            reason += f"; the extrapolated load moves it at about {loss:.2g} times that flow"
        return self._ended(np.inf, top, reason)

    def _is_near(self, factor: float) -> bool:
        return any(abs(known / factor - 1.0) < self._near for known in self._states)

    def _may_converge(self, factor: float) -> bool:
        return all(max(factor / failed, failed / factor) > APART for failed in self.unsolved)

    def _try(self, factor: float, here: bool = False) -> bool:
        try:
            self._solve(factor, here)
        except ConvergenceError:
            self.unsolved.append(factor)
            said = f"flow x {factor:.6g}: no steady flow converged"
            if self.run.setup.scene.is_averaged:  # no continuation: the last iterate is no flow
                self.run.voice.say(said)
                return False
            reached = self.run.fluid.reynolds / self.run.plan.reynolds
            self.run.voice.say(f"{said}, the last at {reached:.6g}")
            slower = max((known for known in self._states if known < factor), default=0.0)
            if not here and reached > APART * slower:
                self._try(reached, here=True)  # intermediate flows are less converged: may fail
            return False
        return True

    def _solve(self, factor: float, here: bool = False) -> None:
        run, start = self.run, self._start(factor)
        if start and not here:
            self._restore(start)
        loads = np.atleast_2d(self._loads_at(run, factor, factor if here else start))
        self._solved[factor] = loads
        self._states[factor] = [state.x.array.copy() for state in run.states]
        values = [safety_factor(load_of(run.scene, load), *self._holds).value for load in loads]
        self._worst[factor] = int(np.argmin(values))
        value = min(values)
        self.trials.append(SolvedFlow(factor, value))
        run.voice.say(f"flow x {factor:.6g}: safety factor {value:.6g}")

    def _start(self, factor: float) -> float:
        if self._states and self._lingers:
            return min(self._states, key=lambda known: abs(np.log(known / factor)))
        return max((known for known in self._states if known < factor), default=0.0)

    def _restore(self, factor: float) -> None:
        for state, values in zip(self.run.states, self._states[factor], strict=True):
            state.x.array[:] = values

    def _load(self, factor: float) -> Load:
        return load_of(self.run.scene, self._solved[factor][self._worst[factor]])

    def _path(self) -> LoadPath:
        factors = np.array(sorted(self._solved))
        # At the worst instants of all flows: from flow to flow they jump, as between the two ways of a flow to and fro.
        instants = sorted(set(self._worst.values()))
        over = np.array([self._solved[factor][instants] / factor for factor in factors])
        return LoadPath(factors, over, load_of(self.run.scene, np.zeros(6)), *self._holds)

    def _ended(self, factor: float, held_to: float, reason: str) -> CriticalFlow:
        tried = tuple(self.trials), tuple(self.unsolved)
        return CriticalFlow(factor, held_to, *tried, reason, self._path())
