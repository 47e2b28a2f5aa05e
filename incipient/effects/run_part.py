"""Interface of the part of a run that an effect adds to the flow."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, Self

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

Stage = Callable[[str], AbstractContextManager[Any]]


class Solving(Protocol):
    """Interface of a run, as its effects use it."""

    scene: Scene
    plan: Plan
    comm: Comm
    voice: Silent

    @property
    def fluid(self) -> Fluid:
        """The flow, on the newest mesh."""

    @property
    def probe(self) -> TractionProbe | None:
        """Reads the traction on the grain; None without a grain."""

    @property
    def time_stepper(self) -> Transient | None:
        """The time stepper; None for a steady flow, and before the first step."""

    def count(self, **numbers: int) -> None:
        """Add to the numbers of iterations by name. Not collective."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Begin a stage; a context manager that takes its time. Not collective."""


class RunPart:
    """Unknowns of an effect that are solved with the flow, within each step. Every method is collective.

    The default methods add nothing. A part is made for a mesh, changes the model of the flow
    (`within`), enters the fluid that is made with that model (`joined`), moves the mesh by what `moving` returns, and
    wraps the solution of a step (`around`). On a new mesh another part of the kind takes over (`on`, `carry_over`).

    Attributes:
        effect: whose part it is.
    """

    effect: EffectName

    # -- solution ---------------------------------------------------------------------------------

    def within(self, model: FlowModel) -> FlowModel:
        """The model of the flow with the part's terms in it."""
        return model

    def joined(self, fluid: Fluid, before: Self | None = None) -> None:
        """Enter the fluid, whose mesh is as it was made; `before` is the part on the mesh before, to take over from."""

    def moving(self, motion: MeshMotion) -> tuple[Part, ...]:
        """The boundaries that the part moves, and the mesh with them; the mesh goes to where they are at the start."""
        return ()

    def around(self, interface: Interface | None) -> Interface | None:
        """The interface solved together with the flow in a step, given that of the moving parts."""
        return interface

    def on(self, domain: Domain) -> Self:
        """The part on a new mesh, not yet in a fluid."""
        raise NotImplementedError(f"{type(self).__name__} has no new meshes")

    def carry_over(self, before: Self) -> None:
        """Take the state over from the part on the mesh before; both meshes are where they are now."""

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Solve the steady flow together with the part's unknowns; False: the flow does not depend on them.

        The flow may be faster than the scene's by a factor, and may be computed from the present state (`onwards`).
        """
        return False

    def states(self) -> tuple[Any, ...]:
        """Functions that are part of the state of a steady flow."""
        return ()

    def accept_step(self, step: TimeStep) -> None:
        """Record an accepted step."""

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep, coupling: Coupling | None) -> dict[str, Any]:
        """Columns of the history after a step."""
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by their names."""
        return {}

    def functions(self) -> dict[str, Any]:
        """Functions on the mesh by their names in files."""
        return {}

    def unknowns(self) -> dict[str, int]:
        """Numbers of unknowns by effect, over all ranks."""
        return {}

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        """Fields of `restart.checkpoint.Checkpoint` by their names."""
        return {}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        """Take the state from a checkpoint; the part and the coupling are made on the stored mesh."""
