"""The plan of a computation as data: effects simulated and left out, discretisation, expense."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .datum import Datum
from .effects import Decision, EffectName
from .linear import Method
from .numbers import Numbers
from .stabilisation import NO_CONVECTION, Stabilisation


@dataclass(frozen=True)
class Estimate:
    """Expense of the computation, counted on the mesh that will be used, the first one if there are several."""

    cells: int
    unknowns: int
    memory_mib: float


@dataclass(frozen=True)
class Plan:
    """Effects, discretisation and (where it has been counted) expense of a scene's computation."""

    effects: tuple[Decision, ...]
    order: int
    geometry_order: int
    mesh_size: float
    convection: str
    scheme: str
    reynolds: float
    solver: Method  # method for the linear systems
    numbers: Numbers | None = None
    stabilisation: Stabilisation = NO_CONVECTION
    estimate: Estimate | None = None
    # What the order of the velocity follows from, in words; empty where the scene gives it
    why_order: str = ""
    # What mesh and order are chosen for by the run, in words; empty where the scene chooses them
    sought: str = ""
    warnings: tuple[str, ...] = ()  # what in the scene makes the result less sure, in words
    datum: Datum | None = (
        None  # where the profile of the flow starts, None without a profile or a bed
    )
    grain: str = ""  # how large a scanned grain is, or one in SI units, in words

    def has(self, name: EffectName) -> bool:
        """Whether an effect is simulated."""
        return any(effect.present for effect in self.effects if effect.name == name)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def text(self) -> str:
        """The plan as a few lines for a reader."""
        lines = [f"  {'yes' if e.present else ' no'}  {e.name}: {e.reason}" for e in self.effects]
        if self.numbers is not None:
            lines.append(f"  {self.numbers.text()}")
        if self.grain:
            lines.append(f"  {self.grain}")
        if self.datum is not None:
            lines.append(
                f"  {self.datum.text('z' if self.has(EffectName.THIRD_DIMENSION) else 'y')}"
            )
        lines += [
            *self._discretisation(),
            f"  {self.stabilisation.text()}",
            f"  {self.solver.text()}",
        ]
        if self.estimate is not None:
            e, first = self.estimate, "first mesh: " if self.sought else ""
            lines.append(
                f"  {first}{e.cells} cells, {e.unknowns} unknowns, about {e.memory_mib:.0f} MiB of memory"
            )
        lines += [f"  warning: {warning}" for warning in self.warnings]
        return "\n".join(lines)

    def _discretisation(self) -> list[str]:
        elements = (
            f"P{self.order}-P{self.order - 1} Taylor-Hood on cells of order {self.geometry_order}"
        )
        solved = f"{self.scheme}, {self.convection} convection"
        why = [f"  velocity of order {self.order}: {self.why_order}"] if self.why_order else []
        if not self.sought:
            return [f"  {elements}, cell sizes x {self.mesh_size:g}, {solved}", *why]
        return [f"  {self.sought}", f"  {elements} at first, {solved}", *why]
