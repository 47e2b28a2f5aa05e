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
    from ..fluid import Fluid
    from ..fluid.transient import TimeStep, Transient
    from ..mesh.domain import Domain
    from ..mesh.motion import MeshMotion
    from ..restart import Checkpoint


class Solving(Protocol):
    """Interface of a run for its effects."""

    scene: Scene
    plan: Plan
    comm: Comm
    voice: Silent

    @property
    def fluid(self) -> Fluid:
        """Flow on the newest mesh."""

    @property
    def probe(self) -> TractionProbe | None:
        """Traction probe of the grain, or None."""

    @property
    def time_stepper(self) -> Transient | None:
        """Time stepper; None for steady flow and before the first step."""

    def count(self, **numbers: int) -> None:
        """Add to iteration counts by name."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Time a stage."""


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

    def columns(self, step: TimeStep, coupling: Coupling | None) -> dict[str, Any]:
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by name."""
        return {}

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        """Fields of `restart.Checkpoint` by name."""
        return {}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        """Restore the state from a checkpoint, on the stored mesh."""
