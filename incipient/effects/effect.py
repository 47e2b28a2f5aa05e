"""Interface of a physical effect for planning, runs and results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup
from .run_part import RunPart, Solving, Stage

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..restart import Checkpoint


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

    factor: of the scene's flow. start: factor with which a search begins if that flow holds the
    grain; 0: the slowest. expected: expense of a search.
    """

    factor: float
    why: str
    remedy: str
    start: float = 0.0
    expected: str = ""


class Effect:
    """What one physical effect adds to a run, by default nothing; `planning.effects` decides on it.

    `quantities`: output quantities of a run with the effect.
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()

    def __init__(self, name: EffectName | None = None, *quantities: OutputQuantity):
        if name is not None:
            self.name, self.quantities = name, quantities

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Add the effect's terms to the flow model, of the `unsteady` flow or its steady start."""
        return model

    def part_in_time(self, setup: Setup, stage: Stage, kept: Checkpoint | None) -> RunPart | None:
        """Unknowns that move the mesh of an unsteady flow, at the start or from a checkpoint. Collective."""
        return None

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Estimated changes by the omitted effect. Collective."""
        return iter(())
