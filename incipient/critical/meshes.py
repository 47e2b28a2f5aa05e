"""The meshes on which a critical flow is searched for: refined to an accuracy, or made for its walls.

To an accuracy meshes are refined as for a load, by what its errors mean for the critical flow. On the first mesh the
whole search is made. On the next ones the load as a function of the factor differs by little, and one flow, the
critical one of the mesh before, is enough in most cases.

With wall functions, where the mesh ends, or how large its cells at walls are, goes with the distance of the law of the
wall, which the flow changes: on the mesh of a slower flow cells are too large for the thinner layer of a faster one.
So a search from rest on the mesh of the scene's own flow is followed by searches near its result, each on a mesh made
for the critical flow before, until its law's distance is that of its mesh to a tenth. How far the load then is from
that on a mesh made for the critical flow itself is a term of its error: meshes as fine differ by what they scatter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from ..accuracy.goal import LoadsOnMesh
from ..accuracy.search import Attempt, Search
from ..accuracy.strategies import DualWeighted
from ..errors import ConvergenceError, SceneError
from ..parallel import Comm
from ..planning.flow_setup import Setup
from ..progress import Silent
from ..results.adaptation import Adaptation
from ..scene import Scene
from ..simulation.build import prepared
from ..simulation.recorder import Recorder
from ..simulation.state import Accounts, Run
from .bars import CriticalGoal
from .loadpath import flow_of
from .search import CriticalSearch, Found, OwnMesh

# Ratio of the length that cells at walls are made for to that of the mesh, or its inverse, up to which the mesh serves.
CHANGED = 1.1
MOST_MESHES = 6
DIFFERING = (
    "the critical flow differs from mesh to mesh, each made for the walls in the one before: it is {factors} "
    "times the scene's; use a smaller numerics.mesh_size"
)
OTHER_MESH = (
    "all on the mesh for the scene's own flow, whose cells are too large at the walls of these"
)

Concluded = TypeVar("Concluded")


def to_accuracy(
    scene: Scene,
    comm: Comm,
    voice: Silent,
    conclude: Callable[[Run, CriticalSearch, Found, Adaptation], Concluded],
) -> Concluded:
    """Find the critical flow to an accuracy; returns what `conclude` makes of it on the last mesh. Collective.

    Raises:
        SceneError: a threshold has no such accuracy.
    """
    if scene.numerics.accuracy == "verdict":
        remedy = "give a relative error of the critical flow such as 0.01"
        raise SceneError(f'numerics.accuracy: "verdict" means nothing for a threshold; {remedy}')
    if scene.numerics.accuracy_includes == "all":
        remedy = "leave it out, and see the error bars of the threshold"
        raise SceneError(f'numerics.accuracy_includes: "all" is for runs; {remedy}')
    strategy = partial(_CriticalFlow, conclude=conclude)
    found: Concluded = Search(scene, comm, Recorder(), voice, strategy).result()
    return found


class _CriticalFlow(DualWeighted):
    """Cells by the error that each vertex contributes to the critical flow."""

    _critical: CriticalSearch

    def __init__(self, search: Search, conclude: Callable[..., Any]):
        super().__init__(search)
        self._conclude, self._found = conclude, list[Found]()

    def solve(self, run: Run) -> LoadsOnMesh:
        """See `Steady`."""
        self._critical = CriticalSearch(run)
        found = _next(self._critical, self._found)
        self._found.append(found)
        if found.rocking is not None:
            why = "the grain rocks before it leaves its pocket, and no error bar of that is known"
            raise SceneError(f"numerics.accuracy: {why}; leave it out")
        if found.is_critical:
            search, halved = self.search, run.setup.symmetric
            search.speed, search.goal = found.factor, CriticalGoal(found, run.scene.gdim, halved)
        return LoadsOnMesh(*self._critical.at_nearest(found.factor))

    def following(self, attempt: Attempt, run: Run, *estimated: Any) -> Attempt | None:
        """See `Strategy`."""
        if self._found[-1].is_critical:
            return super().following(attempt, run, *estimated)
        self.search.reason = "there is no critical flow whose error could be made smaller"
        return None

    def concluded(self, run: Run) -> Any:
        """See `Strategy`."""
        return self._conclude(run, self._critical, self._found[-1], self.search.adaptation())


def on_its_own_mesh(
    scene: Scene,
    comm: Comm,
    voice: Silent,
    conclude: Callable[[Run, CriticalSearch, Found], Concluded],
) -> Concluded:
    """Find the critical flow on a mesh made for its walls; returns what `conclude` makes of it. Collective.

    Raises:
        ConvergenceError: no such flow was found within a few meshes, or near that of another mesh.
    """
    accounts, setup, speed, known = Accounts(), Setup(scene), 1.0, list[Found]()
    while not known or outgrown(setup, speed, known[-1].factor):
        if len(known) == MOST_MESHES:
            factors = ", ".join(f"{found.factor:.4g}" for found in known)
            raise ConvergenceError(DIFFERING.format(factors=factors))
        speed = known[-1].factor if known else 1.0
        voice.say(f"mesh for the walls of flow x {speed:.4g}")
        with prepared(scene, comm, accounts, voice=voice, speed=speed) as run:
            search = CriticalSearch(run)
            found = _next(search, known)
            if known:
                trials = *known[-1].trials, *found.trials
                found = replace(
                    found, trials=trials, unsolved=(*known[-1].unsolved, *found.unsolved)
                )
            known.append(found)
            if not found.is_critical:
                return conclude(run, search, _doubted(setup, found))
    found = known[-1]
    with prepared(scene, comm, accounts, voice=voice, speed=found.factor) as run:
        search = CriticalSearch(run)
        try:
            load = search.load_at(found.factor)
        except ConvergenceError as error:
            was = f"the critical flow was {found.factor:.4g} times the scene's"
            raise ConvergenceError(f"{error}; {was}") from error
        if found.rocking is not None:
            search.rocks(found.factor)
        own = OwnMesh(abs(flow_of(load) - flow_of(found.load)), search.trials[-1].safety_factor)
        return conclude(run, search, replace(found, own_mesh=own))


def _next(search: CriticalSearch, known: list[Found]) -> Found:
    """The critical flow on a mesh, near that on the mesh before, or from rest on the first one. Collective."""
    return search.near(known[-1]) if known else search.from_rest()


def outgrown(setup: Setup, made_for: float, factor: float) -> bool:
    """Whether a mesh made for one flow does not serve for another; both are factors of the scene's. Not collective."""
    one, other = (setup.faster(each).wall_cell for each in (made_for, factor))
    return max(one / other, other / one) > CHANGED


def _doubted(setup: Setup, found: Found) -> Found:
    """Adds to a search without a critical flow the reason to doubt it, where faster flows were solved."""
    fastest = max((trial.factor for trial in found.trials), default=1.0)
    if fastest <= 1.0 or not outgrown(setup, 1.0, fastest):
        return found
    return replace(found, reason=f"{found.reason}; {OTHER_MESH}")
