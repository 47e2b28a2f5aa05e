"""What an effect adds to a run: terms, unknowns, quantities, estimates where it is left out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..fluid.transient import TimeStep, Transient
    from ..restart import Checkpoint
    from ..simulation.state import Run


class RunPart:
    """Unknowns of an effect solved with the flow in each step. Every method is collective."""

    effect: EffectName

    @property
    def unknowns(self) -> int:
        raise NotImplementedError

    def accept_step(self, step: TimeStep) -> None:
        """Record an accepted step."""

    def columns(self, step: TimeStep) -> dict[str, Any]:
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by name."""
        return {}

    def stored(self, transient: Transient) -> dict[str, Any]:
        """Fields of `restart.Checkpoint` by name."""
        return {}

    def resume(self, kept: Checkpoint) -> None:
        """Restore the state from a checkpoint, on the stored mesh at its present position."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Computed flow with omitted effects; loads and verdict may be missing."""

    run: Run
    force: Forces | None
    torque: Torques | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class Effect:
    """What one physical effect adds to a run, by default nothing; `planning.effects` decides on it.

    quantities: output quantities of a run with the effect
    terms:      the flow model with the effect's terms, of the unsteady flow or its steady start
    left_out:   estimated changes by the omitted effect; collective
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()
    terms: Callable[[FlowModel, Setup, Plan, bool], FlowModel] = lambda model, *others: model
    left_out: Callable[[Solved, Decision], Iterator[Omission]] = lambda *others: iter(())
