"""The state of a run, from its plan to its last step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

from ..effects.run_part import RunPart
from ..parallel import Comm
from ..planning.effects import EffectName
from ..planning.flow_setup import Setup
from ..planning.layout import Layout
from ..planning.plan import Plan
from ..progress import Silent
from ..results.cost_of_effects import Corrections
from ..results.elevations import Elevations
from ..results.errorbars import Loads, Term
from ..results.timing import Ledger
from .steadiness import Steadiness

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..coupled.tractions import TractionProbe
    from ..effects.free_surface.part import MovingSurface
    from ..effects.moving_grain.part import MovingGrain
    from ..effects.turbulent_flow import TurbulentFlow
    from ..fluid import Fluid
    from ..fluid.transient import Transient
    from ..mesh.domain import Domain
    from ..results.wall_report import WallReport
    from .march import March


@dataclass
class Known:
    """Known estimates: terms of error bars by name, loads of coarse runs by the JSON of their scene."""

    terms: dict[str, Term] = field(default_factory=dict)
    loads: dict[str, Loads] = field(default_factory=dict)


@dataclass
class Accounts:
    """Data shared by the runs of one search: costs and known estimates.

    known: results of earlier estimates
    spent: why no further estimate may begin, or ""
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
    """A scene, its plan, mesh, flow and progress. Only its own methods change it.

    Args:
        fluid: on the first mesh; remeshing replaces it.
        probe: of the traction on the grain; None without a grain.
        voice: reports the stages.
        parts: solved together with the flow.
    """

    def __init__(
        self,
        setup: Setup,
        plan: Plan,
        layout: Layout,
        contacts: Contacts | None,
        fluid: Fluid,
        probe: TractionProbe | None,
        accounts: Accounts,
        voice: Silent,
        parts: Sequence[RunPart] = (),
    ):
        self.setup, self.scene = setup, setup.scene
        self.plan, self.layout, self.contacts = plan, layout, contacts
        self.accounts, self.voice, self._parts = accounts, voice, tuple(parts)
        self.comm: Comm = fluid.domain.comm
        self.corrections = Corrections(accounts.ledger, plan)
        fluid.watch = self.corrections.record
        self._fluid, self._probe = fluid, probe
        self._march: March | None = None
        self._steadiness: Steadiness | None = None
        self._first_motion: float | None = None

    @property
    def fluid(self) -> Fluid:
        """The flow, on the newest mesh."""
        return self._fluid

    @property
    def parts(self) -> tuple[RunPart, ...]:
        """Parts solved together with the flow, on the newest mesh; moving boundaries first."""
        return self._parts

    @property
    def states(self) -> list[Any]:
        """The state functions of a steady flow and its parts."""
        return [self.fluid.state, *(state for part in self.parts for state in part.states())]

    @property
    def domain(self) -> Domain:
        """The newest mesh."""
        return self.fluid.domain

    @property
    def probe(self) -> TractionProbe | None:
        """The traction probe of the grain; None without a grain."""
        return self._probe if self.grain is None else self.grain.probe

    @property
    def march(self) -> March | None:
        """The integration in time; None for a steady flow, and before the first step."""
        return self._march

    @property
    def time_stepper(self) -> Transient | None:
        """The time stepper; None for a steady flow, and before the first step."""
        return None if self._march is None else self._march.transient

    @property
    def grain(self) -> MovingGrain | None:
        """The moving grain; None without one, and before the first step."""
        return cast("MovingGrain | None", self.part(EffectName.FREE_BODY))

    @property
    def surface(self) -> MovingSurface | None:
        """The free surface; None without one, and before the first step."""
        return cast("MovingSurface | None", self.part(EffectName.FREE_SURFACE))

    @property
    def turbulence(self) -> TurbulentFlow | None:
        """The turbulence of the flow; None without."""
        return cast("TurbulentFlow | None", self.part(EffectName.TURBULENCE))

    @property
    def elevations(self) -> Elevations | None:
        """Elevations of the free surface so far; None without one, and before the first step."""
        return None if self.surface is None else self.surface.elevations

    def part(self, effect: EffectName) -> Any:
        """The part of an effect on the newest mesh, or None."""
        return next((part for part in self.parts if part.effect == effect), None)

    def wall_report(self) -> WallReport | None:
        """Flow along walls with a wall-function layer, None without. Collective."""
        return None if self.turbulence is None else self.turbulence.wall_report()

    def separated(self) -> tuple[tuple[float, float], ...] | None:
        """Intervals of x of reverse laminar flow along the bed; None: not determined. Collective."""
        if not self.scene.has_separation:
            return None
        from ..fluid.along_walls import along_no_slip_wall

        return along_no_slip_wall(self.fluid, self.setup.sides.bottom).backward()

    @property
    def steadiness(self) -> Steadiness | None:
        """Rate of change in a run until steady flow, otherwise None."""
        return self._steadiness

    @property
    def is_steady(self) -> bool:
        """Whether a run until steady flow has reached it."""
        return self._steadiness is not None and self._steadiness.reached

    @property
    def first_motion(self) -> float | None:
        """First time at which a fixed grain in unsteady flow would move."""
        return self._first_motion

    def march_with(self, march: March, parts: Sequence[RunPart]) -> None:
        """Set the time integration and its parts. Not collective."""
        self._march, self._parts = march, tuple(parts)

    def take_mesh(self, fluid: Fluid, parts: Sequence[RunPart]) -> None:
        """Continue with a fluid and parts on a new mesh; the previous fluid is freed. Collective."""
        before, self._fluid, self._parts = self._fluid, fluid, tuple(parts)
        fluid.solver.statistics.add(before.solver.statistics)
        before.destroy()

    def watch(self, steadiness: Steadiness) -> None:
        """Set the test of steady flow. Not collective."""
        self._steadiness = steadiness

    def take_fluid(self, fluid: Fluid, probe: TractionProbe | None) -> None:
        """Continue with another fluid on the mesh; the previous one is freed. Collective."""
        fluid.watch = self.corrections.record
        fluid.solver.statistics.add(self._fluid.solver.statistics)
        self._fluid.destroy()
        self._fluid, self._probe = fluid, probe

    def would_move(self, time: float | None) -> None:
        """Record the first time at which the grain would move. Not collective."""
        if self._first_motion is None:
            self._first_motion = time

    def count(self, **numbers: int) -> None:
        """Add to the numbers of iterations by name. Not collective."""
        self.accounts.count(**numbers)

    def stage(self, name: str) -> AbstractContextManager[None]:
        """A context manager that reports and times a stage. Not collective."""
        self.voice.begin(name)
        return self.accounts.ledger.stage(name)
