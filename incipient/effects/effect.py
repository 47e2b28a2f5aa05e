"""Interface of a physical effect, as planning, runs and results use it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from .run_part import RunPart, Solving, Stage

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..mesh.domain import Domain
    from ..restart.checkpoint import Checkpoint


@dataclass(frozen=True, eq=False)
class Solved:
    """A computed flow of which effects were left out: loads and verdict are None where there are none."""

    run: Solving
    force: Forces | None
    torque: Torques | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class SlowestFlow:
    """The slowest flow in which an effect can be simulated in a scene.

    factor: of the scene's flow; why: the reason, after its name; remedy: where a slower one is needed
    start: factor of the flow that a search begins with where it holds the grain; 0: with the slowest one
    expected: expense of a search, reported before it
    """

    factor: float
    why: str
    remedy: str
    start: float = 0.0
    expected: str = ""


class Effect:
    """One physical effect. The default methods do nothing.

    Callers iterate over `known.EFFECTS`. The modules of an effect are imported only where the effect is present.

    Attributes:
        quantities: numbers that a run's outcome has where the effect is present; history, result, text, page and tables
            walk them.
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Whether the scene calls for the effect, and the reason. Not collective."""
        raise NotImplementedError

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The model of the flow with the effect's terms, for a plan that has the effect. Not collective.

        `unsteady` distinguishes an unsteady flow from the steady one that it may start from.
        """
        return model

    def warnings(self, setup: Setup) -> Iterator[str]:
        """Features of the scene that make the result less certain where the effect is present. Not collective.

        Raises:
            SceneError: the effect cannot be simulated in the scene.
        """
        return iter(())

    def part_at_start(self, setup: Setup, domain: Domain, stage: Stage) -> RunPart | None:
        """Unknowns that are also solved with a steady flow, made before its fluid. Collective."""
        return None

    def part_in_time(self, setup: Setup, stage: Stage, kept: Checkpoint | None) -> RunPart | None:
        """Unknowns that move the mesh of an unsteady flow, at the start or from a checkpoint. Collective."""
        return None

    def memory(self, setup: Setup, unknowns: int) -> float:
        """MiB that the effect adds to a flow with so many unknowns. Not collective."""
        return 0.0

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Estimated changes by the effect, which the plan leaves out. Collective."""
        return iter(())
