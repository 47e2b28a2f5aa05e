"""What an effect adds to a run: terms, a part of its own, estimates where it is left out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from ..coupled.part import Stage as Stage
from ..planning.effects import Decision, EffectName
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup

if TYPE_CHECKING:
    from ..coupled.part import Part
    from ..fluid import FlowModel, Fluid
    from ..fluid.transient import TimeStep, Transient
    from ..mesh.domain import Domain
    from ..mesh.motion import MeshMotion
    from ..restart import Checkpoint
    from ..simulation.state import Run


class RunPart:
    """Unknowns of an effect solved with the flow in each step. Every method is collective.

    A part is made for a mesh, enters the fluid on it (`joined`), and moves the mesh by what `moving` returns.
    On a new mesh another part takes over (`on`, then `joined` with the part before).
    """

    effect: EffectName

    @property
    def unknowns(self) -> int:
        raise NotImplementedError

    # -- solution ---------------------------------------------------------------------------------

    def joined(self, fluid: Fluid, before: Self | None = None) -> None:
        """Enter the fluid on its original mesh; `before` is the part on the previous mesh."""

    def moving(self, motion: MeshMotion) -> tuple[Part, ...]:
        """Boundaries moved by the part; the mesh moves to their initial positions."""
        return ()

    def on(self, domain: Domain) -> Self:
        """The part on a new mesh, not yet in a fluid."""
        raise NotImplementedError

    def accept_step(self, step: TimeStep) -> None:
        """Record an accepted step."""

    # -- output and checkpoints -------------------------------------------------------------------

    def columns(self, step: TimeStep) -> dict[str, Any]:
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by name."""
        return {}

    def stored(self, transient: Transient) -> dict[str, Any]:
        """Fields of `restart.Checkpoint` by name."""
        return {}

    def restore(self, kept: Checkpoint) -> None:
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

    quantities:   output quantities of a run with the effect
    terms:        the flow model with the effect's terms, of the unsteady flow or its steady start
    part_in_time: unknowns that move the mesh of an unsteady flow, from the start or a checkpoint, or None; collective
    left_out:     estimated changes by the omitted effect; collective
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()
    terms: Callable[[FlowModel, Setup, Plan, bool], FlowModel] = lambda model, *others: model
    part_in_time: Callable[[Setup, Stage, Checkpoint | None], RunPart | None] = lambda *others: None
    left_out: Callable[[Solved, Decision], Iterator[Omission]] = lambda *others: iter(())
