"""The part of a run that an effect adds to the flow, as everything that handles runs sees it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, Self

from ..arrays import Floats
from ..geometry.placement import Placement
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
    from ..results.elevations import Elevations
    from ..results.wall_report import WallReport

Stage = Callable[[str], AbstractContextManager[Any]]


class Solving(Protocol):
    """What effects ask of the run that they are in."""

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
        """The steps in time; None for a steady flow, and before the first step."""

    def count(self, **numbers: int) -> None:
        """Add to the numbers of iterations by name. Not collective."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Begin a stage; a context manager that takes its time. Not collective."""


class RunPart:
    """Unknowns of an effect that are solved with the flow, within each step. Every method is collective.

    The methods here are those of a part that adds nothing. A part is made for a mesh, changes the model of the flow
    (`within`), enters the fluid that is made with that model (`joined`), moves the mesh by what `moving` returns, and
    wraps the solution of a step (`around`). On a new mesh another part of the kind takes over (`on`, `carry_over`).

    Attributes:
        effect: whose part it is.
        elevations: of a free surface so far; None: there are none.
        probe: reads the traction on the grain where the part has a better one than the run; None: it has not.
    """

    effect: EffectName
    probe: TractionProbe | None = None
    elevations: Elevations | None = None

    # -- solution ---------------------------------------------------------------------------------

    def within(self, model: FlowModel) -> FlowModel:
        """The model of the flow with the part's terms in it."""
        return model

    def joined(self, fluid: Fluid, before: Self | None = None) -> None:
        """Enter the fluid, whose mesh is as it was made; `before` is the part on the mesh before, to take over from."""

    def displaced(self, motion: MeshMotion) -> None:
        """Make ready to move the mesh, as the parts' states at the start require."""

    def moving(self) -> tuple[Part, ...]:
        """The boundaries that the part moves, and the mesh with them."""
        return ()

    def around(self, interface: Interface | None) -> Interface | None:
        """What is solved together with the flow in a step, given what moves in it."""
        return interface

    def on(self, domain: Domain) -> Self:
        """The part on a new mesh, not yet in a fluid."""
        raise NotImplementedError(f"{type(self).__name__} has no new meshes")

    def carry_over(self, before: Self) -> None:
        """Take the state over from the part on the mesh before; both meshes are where they are now."""

    def drawn_height(self, height: float, placement: Placement) -> float:
        """Height of the domain for which a new mesh is made around a grain, given what the parts before would have.

        Raises:
            MeshError: there cannot be one.
        """
        return height

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Find the steady flow together with the part's unknowns; False: the flow does not depend on them.

        The flow may be faster than the scene's by a factor, and may be computed from the present state (`onwards`).
        """
        return False

    def mean_load(self) -> tuple[Floats, Floats] | None:
        """Force and torque (3,) on the grain that stand for a steady flow which has not converged."""
        return None

    def start(self, steady: Self) -> None:
        """Begin from the part of a steady flow on the mesh."""

    def states(self) -> tuple[Any, ...]:
        """Functions that are part of the state of a steady flow."""
        return ()

    def begin(self) -> None:
        """Take note of the state before the first step, at the start or as a checkpoint has it."""

    def accept_step(self, step: TimeStep) -> None:
        """Take note of an accepted step."""

    def check(self, step: TimeStep, placement: Placement | None) -> None:
        """Refuse to continue from the state after a step, with a moving grain in a placement or none.

        Raises:
            ConvergenceError: why it cannot, and a remedy.
        """

    def change(self, depth: float) -> float:
        """The change of the part's state in the last step over the depth of the flow."""
        return 0.0

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep, coupling: Coupling | None) -> dict[str, Any]:
        """Columns of the history after a step."""
        return {}

    def contact_rows(self) -> list[dict[str, Any]]:
        """Rows of contacts.csv after a step: one for each contact of a moving grain. Not collective."""
        return []

    def budget(self) -> dict[str, float]:
        """Columns of the history that stand at its end: energies."""
        return {}

    def reported(self) -> dict[str, Any]:
        """Fields of `results.result.Result` by their names."""
        return {}

    def wall_report(self) -> WallReport | None:
        """The flow along walls with a wall-function layer, of a part that knows any."""
        return None

    def functions(self) -> dict[str, Any]:
        """Functions on the mesh by the names that files have."""
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
