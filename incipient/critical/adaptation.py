"""A critical flow to a given accuracy: meshes are refined as for a load, by what its errors mean for the critical flow.

On the first mesh the whole search is made. On the next ones the load as a function of the factor differs by little,
and one flow, the critical one of the mesh before, is enough in most cases.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..adaptive.refinement import Refinement
from ..errors import SceneError
from ..results.adaptation import Adaptation
from ..simulation.recorder import Unrecorded
from .bars import CriticalGoal
from .search import Found, Search

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..progress import Silent
    from ..results.loads import Couples, Forces
    from ..scene import Scene
    from ..simulation.state import Run

Conclude = Callable[["Run", Search, Found, Adaptation], Any]


class CriticalRefinement(Refinement):
    """From mesh to mesh by what each vertex contributes to the error of the critical flow.

    Args:
        conclude: makes the result of the search on the last mesh, while its run is at hand.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm, voice: Silent, conclude: Conclude):
        if scene.numerics.accuracy == "verdict":
            raise SceneError(
                'numerics.accuracy: "verdict" means nothing for a threshold; give a relative error of the critical '
                "flow such as 0.01"
            )
        if scene.numerics.accuracy_includes == "all":
            raise SceneError(
                'numerics.accuracy_includes: "all" is for runs; leave it out, and see the error bars of the threshold'
            )
        super().__init__(scene, comm, Unrecorded(), voice)
        self._conclude, self._found = conclude, list[Found]()
        self._search: Search | None = None

    def threshold(self) -> Any:
        """Try meshes until the accuracy is reached or cannot be; what `conclude` makes of the last. Collective."""
        return self.result()

    def _solved(self, run: Run) -> tuple[Forces, Couples]:
        self._search = search = Search(run)
        found = search.near(self._found[-1]) if self._found else search.from_rest()
        self._found.append(found)
        if found.rocking is not None:
            raise SceneError(
                "numerics.accuracy: the grain rocks before it leaves its pocket, and no error bar of that is known; "
                "leave it out"
            )
        if found.is_critical:
            self.speed, self.goal = found.factor, CriticalGoal(found, self.scene.gdim, self.scene.symmetric)
        return search.at_nearest(found.factor)

    def _to_refine(self, attempt: Any, excess: float, shares: Any, error: float) -> Any:
        if self._found[-1].is_critical:
            return super()._to_refine(attempt, excess, shares, error)
        self.reason = "there is no critical flow whose error could be made smaller"
        return None

    def _handed_over(self, run: Run) -> Any:
        """Nothing is kept before the conclusion."""

    def _concluded(self, run: Run, told: Any) -> Any:
        assert self._search is not None
        return self._conclude(run, self._search, self._found[-1], self.adaptation())
