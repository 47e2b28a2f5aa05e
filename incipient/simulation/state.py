"""State of a run, from its plan to its last step."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..parallel import Comm
from ..planning.meshing import Layout
from ..planning.plan import Plan
from ..progress import Silent
from ..results.errorbars import Loads, Term
from ..results.timing import Corrections, Ledger
from ..setup.setup import Setup

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..coupled.moving_grain import MovingGrain
    from ..coupled.moving_surface import MovingSurface
    from ..coupled.tractions import TractionProbe
    from ..coupled.turbulent_flow import TurbulentFlow
    from ..fluid import Fluid
    from ..fluid.transient import Transient
    from ..mesh.domain import Domain
    from ..restart import Checkpoint
    from ..results.result import Result, Steadied
    from ..results.wall_report import WallReport


@dataclass
class Known:
    """Known estimates: error-bar terms by name, coarse loads by the JSON of their scene."""

    terms: dict[str, Term] = field(default_factory=dict)
    loads: dict[str, Loads] = field(default_factory=dict)


@dataclass
class Accounts:
    """Costs and known estimates, shared by the runs of a search.

    spent: why no further estimate may begin, or "".
    described: adds the search to a result.
    """

    ledger: Ledger = field(default_factory=Ledger)
    iterations: dict[str, int] = field(default_factory=dict)
    known: Known = field(default_factory=Known)
    spent: Callable[[], str] = lambda: ""
    described: Callable[[Result], Result] = lambda result: result

    def count(self, **numbers: int) -> None:
        for name, number in numbers.items():
            self.iterations[name] = self.iterations.get(name, 0) + number


class Run:
    """A scene, its plan, mesh, flow and progress.

    fluid, grain, surface, turbulence: on the newest mesh, the latter three None where absent; grain and surface where
    they move. transient: None for steady flow and before the first step. steady: whether unsteady flow has become so,
    where that is sought. first_motion: time at which a fixed grain in unsteady flow would first move. last_checkpoint:
    of the last step, to be written after the result.
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
        turbulence: TurbulentFlow | None = None,
    ):
        self.setup, self.scene = setup, setup.scene
        self.plan, self.layout, self.contacts = plan, layout, contacts
        self.accounts, self.voice, self.turbulence = accounts, voice, turbulence
        self.grain: MovingGrain | None = None
        self.surface: MovingSurface | None = None
        self.comm: Comm = fluid.domain.comm
        self.corrections = Corrections(accounts.ledger, plan)
        fluid.watch = self.corrections.record
        self.fluid, self._probe = fluid, probe
        self.transient: Transient | None = None
        self.steady: Steadied | None = None
        self.first_motion: float | None = None
        self.last_checkpoint: Checkpoint | None = None

    @property
    def states(self) -> list[Any]:
        turbulence = [] if self.turbulence is None else [self.turbulence.fields.state]
        return [self.fluid.state, *turbulence]

    @property
    def domain(self) -> Domain:
        return self.fluid.domain

    @property
    def probe(self) -> TractionProbe | None:
        return self._probe if self.grain is None else self.grain.probe

    @property
    def parts(self) -> tuple[MovingGrain | MovingSurface | TurbulentFlow, ...]:
        every = self.grain, self.surface, self.turbulence
        return tuple(part for part in every if part is not None)

    def wall_report(self) -> WallReport | None:
        """Flow along walls with wall functions, or None. Collective."""
        return None if self.turbulence is None else self.turbulence.wall_report()

    def separated(self) -> tuple[tuple[float, float], ...] | None:
        """Intervals of x with reverse laminar flow along the bed; None: undetermined. Collective."""
        if not self.scene.has_separation:
            return None
        from ..fluid.along_walls import along_no_slip_wall

        return along_no_slip_wall(self.fluid, self.setup.sides.bottom).backward()

    def take_fluid(self, fluid: Fluid, probe: TractionProbe | None = None) -> None:
        """Continue with another fluid, freeing the previous one. Collective."""
        fluid.watch = self.corrections.record
        fluid.solver.statistics.update(self.fluid.solver.statistics)
        self.fluid.destroy()
        self.fluid, self._probe = fluid, probe

    def stage(self, name: str, effect: str = "") -> AbstractContextManager[None]:
        self.voice.begin(name)
        return self.accounts.ledger.stage(name, effect)
