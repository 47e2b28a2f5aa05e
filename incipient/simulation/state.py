"""The state of a run: all that a run of one scene has, from its plan to its last step."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..progress import Silent
from ..results.cost_of_effects import Corrections
from ..results.elevations import Elevations, Reading
from ..results.timing import Ledger

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..contact import Contacts
    from ..coupled.tractions import TractionProbe
    from ..fluid import Fluid, Transient
    from ..mesh.domain import Domain
    from ..planning.drawing import Layout
    from ..planning.plan import Plan
    from ..results.errorbars import Loads, Term
    from ..scene import Scene
    from ..turbulence import InTime
    from .free_surface import MovingSurface
    from .moving_grain import Trajectory
    from .steadiness import Steadiness
    from .turbulent import TurbulentFlow


@dataclass
class Known:
    """What estimates have found: terms of error bars by name, loads of coarse runs by the JSON of their scene."""

    terms: dict[str, Term] = field(default_factory=dict)
    loads: dict[str, Loads] = field(default_factory=dict)


@dataclass
class Accounts:
    """What the runs of one search share: what they cost, and the estimates that are known already.

    known: what estimates have found already
    spent: why no estimate shall be begun any more, or an empty string
    """

    ledger: Ledger = field(default_factory=Ledger)
    iterations: dict[str, int] = field(default_factory=dict)
    known: Known = field(default_factory=Known)
    spent: Callable[[], str] = lambda: ""

    def count(self, **numbers: int) -> None:
        """Add to the numbers of iterations by name. Not collective."""
        for name, number in numbers.items():
            self.iterations[name] = self.iterations.get(name, 0) + number


class Run:
    """A scene, its plan, mesh and flow, and how far the run has come. Only its own methods change it.

    Args:
        fluid: on the mesh that was made for the scene; it is replaced when a moving grain is meshed anew.
        probe: reads the traction on the grain; None without a grain.
        voice: told of the stages.
        turbulence: of the fluid; None where there is none.
    """

    def __init__(
        self,
        scene: Scene,
        plan: Plan,
        layout: Layout,
        contacts: Contacts | None,
        fluid: Fluid,
        probe: TractionProbe | None,
        accounts: Accounts,
        voice: Silent,
        turbulence: TurbulentFlow | None = None,
    ):
        self.scene, self.plan, self.layout, self.contacts = scene, plan, layout, contacts
        self.accounts, self.voice, self._turbulence = accounts, voice, turbulence
        self.comm: MPI.Comm = fluid.domain.comm
        self.corrections = Corrections(accounts.ledger, plan)
        fluid.watch = self.corrections.record
        self._fluid, self._probe = fluid, probe
        self._time_stepper: Transient | None = None
        self._trajectory: Trajectory | None = None
        self._surface: MovingSurface | None = None
        self._eddies: InTime | None = None
        self._steadiness: Steadiness | None = None
        self._first_motion: float | None = None
        self._readings: list[Reading] = []

    @property
    def fluid(self) -> Fluid:
        """The flow, on the newest mesh."""
        return self._fluid if self._trajectory is None else self._trajectory.fluid

    @property
    def states(self) -> list[Any]:
        """The functions that a steady flow is the state of: the flow's, and with turbulence ln k and ln epsilon."""
        return [self.fluid.state, *(() if self.turbulence is None else (self.turbulence.fields.state,))]

    @property
    def domain(self) -> Domain:
        """The newest mesh."""
        return self.fluid.domain

    @property
    def probe(self) -> TractionProbe | None:
        """Reads the traction on the grain; None without a grain."""
        return self._probe if self._trajectory is None else self._trajectory.part.probe

    @property
    def time_stepper(self) -> Transient | None:
        """The integration in time; None for a steady flow, and before the first step."""
        return self._time_stepper

    @property
    def trajectory(self) -> Trajectory | None:
        """The grain that moves; None without one, and before the first step."""
        return self._trajectory

    @property
    def surface(self) -> MovingSurface | None:
        """The free surface; None without one, and before the first step."""
        return self._surface if self._trajectory is None else self._trajectory.surface

    @property
    def turbulence(self) -> TurbulentFlow | None:
        """That of the flow, on the newest mesh; None without."""
        return self._turbulence if self._trajectory is None else self._trajectory.turbulence

    @property
    def eddies(self) -> InTime | None:
        """k and epsilon in time; None without turbulence, and before the first step."""
        return self._eddies if self._trajectory is None else self._trajectory.eddies

    @property
    def steadiness(self) -> Steadiness | None:
        """How fast a flow changes that is to become steady; None where that is not asked."""
        return self._steadiness

    @property
    def is_steady(self) -> bool:
        """Whether a flow that is to become steady is so."""
        return self._steadiness is not None and self._steadiness.reached

    @property
    def first_motion(self) -> float | None:
        """Time at which a grain that is held in time would first have moved."""
        return self._first_motion

    @property
    def elevations(self) -> Elevations | None:
        """Those of the free surface so far; None without one, and before the first step."""
        return Elevations.of(self._readings) if self._readings else None

    def read_surface(self) -> None:
        """Keep the elevations of the free surface as they are now, if there is one. Collective."""
        if self.surface is not None:
            self._readings.append(self.surface.reading())

    def march_with(
        self,
        time_stepper: Transient,
        trajectory: Trajectory | None = None,
        surface: MovingSurface | None = None,
        eddies: InTime | None = None,
    ) -> None:
        """Take a time integration and what is solved together with it into the state. Not collective."""
        self._time_stepper, self._trajectory = time_stepper, trajectory
        self._surface, self._eddies = surface, eddies

    def watch(self, steadiness: Steadiness) -> None:
        """Take what tells whether the flow is steady into the state. Not collective."""
        self._steadiness = steadiness

    def take_fluid(self, fluid: Fluid, probe: TractionProbe | None) -> None:
        """Go on with another fluid on the mesh; the one before is freed. Collective."""
        fluid.watch = self.corrections.record
        fluid.solver.statistics.add(self._fluid.solver.statistics)
        self._fluid.destroy()
        self._fluid, self._probe = fluid, probe

    def would_move(self, time: float | None) -> None:
        """Note a time at which the grain would move; the first one counts. Not collective."""
        if self._first_motion is None:
            self._first_motion = time

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Tell that a stage begins; a context manager that takes its time. Not collective."""
        self.voice.begin(name)
        return self.accounts.ledger.stage(name)
