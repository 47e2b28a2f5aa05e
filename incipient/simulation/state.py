"""State of a run, from its plan to its last step, and the receiver of its results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..parallel import Comm
from ..planning.meshing import Layout
from ..planning.plan import Plan
from ..progress import Silent
from ..results.errorbars import Loads, Term
from ..results.timing import Corrections, Ledger
from ..scene import Scene
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
    from ..results.accuracy import Adaptation
    from ..results.result import Result, Steadied
    from ..results.wall_report import WallReport


@dataclass
class Accounts:
    """Costs and known estimates, shared by the runs of a search.

    terms: of error bars, by name; loads: of coarse runs, by the JSON of their scene.
    spent: why no further estimate may begin, or "".
    adaptation: record of the search so far, or None.
    """

    ledger: Ledger = field(default_factory=Ledger)
    iterations: Counter[str] = field(default_factory=Counter)
    terms: dict[str, Term] = field(default_factory=dict)
    loads: dict[str, Loads] = field(default_factory=dict)
    spent: Callable[[], str] = lambda: ""
    adaptation: Callable[[], Adaptation | None] = lambda: None


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
        self._observe(fluid)
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
        every = self.surface, self.grain, self.turbulence
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
        self._observe(fluid)
        fluid.solver.statistics.update(self.fluid.solver.statistics)
        self.fluid.destroy()
        self.fluid, self._probe = fluid, probe

    def _observe(self, fluid: Fluid) -> None:
        fluid.watch, fluid.stage = self.corrections.record, self.accounts.ledger.stage

    def stage(self, name: str, effect: str = "") -> AbstractContextManager[None]:
        self.voice.begin(name)
        return self.accounts.ledger.stage(name, effect)


class Recorder:
    """Receiver of a run's results; the base class keeps time steps alone, as `rows`. All methods are collective.

    keeps: whether `keep` stores checkpoints.
    """

    keeps = False

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def begin(self, scene: Scene, domain: Domain) -> None:
        """Begin after meshing."""

    def step(self, row: dict[str, Any], contacts: Sequence[dict[str, Any]] = ()) -> None:
        """Record an accepted time step, and the contacts of a moving grain after it."""
        self.rows.append(row)

    def fields(self, run: Run, number: int, last: bool) -> None:
        """Record fields, and the traction on the grain, after a step, if requested."""

    def keep(self, checkpoint: Checkpoint) -> Path | None:
        """Store a checkpoint; returns its directory, if any."""
        return None

    def provisional(self, result: Result) -> Path | None:
        """Store a result without error bars until `finish`; returns its directory, if any."""
        return None

    def finish(self, result: Result) -> None:
        """Record the result of a run, complete or not."""
