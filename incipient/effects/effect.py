"""Interface of a physical effect for planning, runs and results."""

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
    """Computed flow with omitted effects; loads and verdict may be missing."""

    run: Solving
    force: Forces | None
    torque: Torques | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class SlowestFlow:
    """Slowest flow in which an effect can be simulated in a scene.

    factor: of the scene's flow. why, remedy: for messages. start: factor with which a search begins
    if that flow holds the grain; 0: the slowest. expected: expense of a search.
    """

    factor: float
    why: str
    remedy: str
    start: float = 0.0
    expected: str = ""


class Effect:
    """One physical effect, imported only where present. The default methods do nothing.

    `quantities`: output quantities of a run with the effect.
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Decide whether the scene calls for the effect, with the reason. Not collective."""
        raise NotImplementedError

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Add the effect's terms to the flow model, of the `unsteady` flow or its steady start. Not collective."""
        return model

    def warnings(self, setup: Setup) -> Iterator[str]:
        """Features of the scene that make the result less certain. Not collective.

        Raises SceneError if the effect cannot be simulated in the scene.
        """
        return iter(())

    def part_at_start(self, setup: Setup, domain: Domain, stage: Stage) -> RunPart | None:
        """Unknowns solved with a steady flow, created before its fluid. Collective."""
        return None

    def part_in_time(self, setup: Setup, stage: Stage, kept: Checkpoint | None) -> RunPart | None:
        """Unknowns that move the mesh of an unsteady flow, at the start or from a checkpoint. Collective."""
        return None

    def memory(self, setup: Setup, unknowns: int) -> float:
        """Additional memory [MiB] for a flow with so many unknowns. Not collective."""
        return 0.0

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Estimated changes by the omitted effect. Collective."""
        return iter(())
