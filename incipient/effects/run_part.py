"""Interface of the part of a run that an effect adds to the flow."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, Self

from ..coupled.part import Stage as Stage
from ..parallel import Comm
from ..planning.effects import EffectName
from ..planning.plan import Plan
from ..progress import Silent
from ..scene import Scene

if TYPE_CHECKING:
    from ..coupled.coupling import Coupling
    from ..coupled.part import Part
    from ..coupled.tractions import TractionProbe
    from ..fluid import FlowModel, Fluid
    from ..fluid.transient import Interface, TimeStep, Transient
    from ..mesh.domain import Domain
    from ..mesh.motion import MeshMotion
    from ..restart.checkpoint import Checkpoint


class Solving(Protocol):
    """Interface of a run for its effects."""

    scene: Scene
    plan: Plan
    comm: Comm
    voice: Silent

    @property
    def fluid(self) -> Fluid:
        """The flow on the newest mesh."""

    @property
    def probe(self) -> TractionProbe | None:
        """Traction probe of the grain, or None."""

    @property
    def time_stepper(self) -> Transient | None:
        """Time stepper; None for steady flow and before the first step."""

    def count(self, **numbers: int) -> None:
        """Add to iteration counts by name. Not collective."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Context manager that times a stage. Not collective."""


class RunPart:
    """Unknowns of an effect solved with the flow in each step. Every method is collective.

    The default methods add nothing. A part extends the flow model (`within`), enters the fluid
    (`joined`), moves the mesh (`moving`) and wraps the solution of a step (`around`); after
    remeshing another part takes over (`on`, `carry_over`).
    """

    effect: EffectName

    # -- solution ---------------------------------------------------------------------------------

    def within(self, model: FlowModel) -> FlowModel:
        """Add the part's terms to the flow model."""
        return model

    def joined(self, fluid: Fluid, before: Self | None = None) -> None:
        """Enter the fluid on its original mesh; `before` is the part on the previous mesh."""

    def moving(self, motion: MeshMotion) -> tuple[Part, ...]:
        """Boundaries moved by the part; the mesh moves to their initial positions."""
        return ()

    def around(self, interface: Interface | None) -> Interface | None:
        """Wrap the interface of the moving parts that a step solves with the flow."""
        return interface

    def on(self, domain: Domain) -> Self:
        """The part for a new mesh, not yet in a fluid."""
        raise NotImplementedError(f"{type(self).__name__} has no new meshes")

    def carry_over(self, before: Self) -> None:
        """Take over the state from the part on the previous mesh."""

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Solve the steady flow with the part's unknowns; False if the flow does not depend on them.

        `factor`: speed relative to the scene's; `onwards`: from the present state.
        """
        return False

    def states(self) -> tuple[Any, ...]:
        """Functions that belong to the state of a steady flow."""
        return ()

    def accept_step(self, step: TimeStep) -> None:
        """Record an accepted step."""

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep, coupling: Coupling | None) -> dict[str, Any]:
        """History columns of a step."""
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by name."""
        return {}

    def functions(self) -> dict[str, Any]:
        """Functions on the mesh by file name."""
        return {}

    def unknowns(self) -> dict[str, int]:
        """Numbers of unknowns by effect, over all ranks."""
        return {}

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        """Fields of `restart.checkpoint.Checkpoint` by name."""
        return {}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        """Restore the state from a checkpoint, on the stored mesh."""
