"""The plan of a scene: effects simulated and left out, discretisation, expense.

Sub-problems and terms that the plan does not name are never made.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from ..errors import refuse_path
from ..geometry.plane.curves import Line
from ..geometry.space.grains import Box, Triangulated
from ..scene import Scene
from ..scene.units import nominal_diameter
from ..setup.setup import Numbers, Setup
from . import doubts, effects
from .discretisation import (
    NO_CONVECTION,
    Method,
    Stabilisation,
    method_of,
    stabilisation_of,
    velocity_order,
)
from .effects import Decision, EffectName

DATUMS = {
    "effective": "the effective height of the bed, computed from its shape",
    "mean": "the mean height of the bed",
    "crest": "the crest of the bed",
}


@dataclass(frozen=True)
class Estimate:
    """Expense of the computation, counted on the first mesh that will be used."""

    cells: int
    unknowns: int
    memory_mib: float


@dataclass(frozen=True)
class Datum:
    """The height at which the profile of a scene's flow starts [length], and what it is of the bed, in words."""

    height: float
    reason: str


@dataclass(frozen=True)
class Plan:
    """Effects, discretisation and (if counted) expense of a scene's computation."""

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
    # What the mesh is chosen for by the run, in words; empty where the scene chooses them
    sought: str = ""
    warnings: tuple[str, ...] = ()  # what in the scene makes the result less sure, in words
    datum: Datum | None = None  # None without a profile or a bed
    grain: str = ""  # how large a scanned grain is, or one in SI units, in words

    def has(self, name: EffectName) -> bool:
        """Whether an effect is simulated."""
        return any(effect.present for effect in self.effects if effect.name == name)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def text(self) -> str:
        """The plan in a few lines."""
        lines = [f"  {effect.text()}" for effect in self.effects]
        if self.numbers is not None:
            lines.append(f"  {self.numbers.text()}")
        if self.grain:
            lines.append(f"  {self.grain}")
        if self.datum is not None:
            axis = "z" if self.has(EffectName.THIRD_DIMENSION) else "y"
            lines.append(f"  datum {axis} = {self.datum.height:g}: {self.datum.reason}")
        stabilised = "stabilised" if self.stabilisation.present else "not stabilised"
        lines += [
            *self._discretisation(),
            f"  convection {stabilised}: {self.stabilisation.reason}",
            f"  linear systems by a {self.solver.name} method: {self.solver.reason}",
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
        return [f"  {self.sought}", f"  {elements}, {solved}", *why]


def make_plan(scene: Scene) -> Plan:
    """Decide from the scene alone; nothing is meshed or computed.

    Raises:
        SceneError: an effect that is present cannot be simulated in the scene.
    """
    refuse_path(scene, "make_plan")
    return plan_of(Setup(scene))


def plan_of(setup: Setup) -> Plan:
    """The plan of a prepared scene, as by `make_plan`."""
    scene = setup.scene
    decisions = tuple(decide(setup) for decide in effects.TABLE)
    order, why_order = velocity_order(setup)
    present = {decision.name for decision in decisions if decision.present}
    inert, unsteady = EffectName.INERTIA in present, EffectName.UNSTEADINESS in present
    stabilisation = stabilisation_of(setup, inert)
    convection = scene.numerics.convection if unsteady else "implicit"
    scheme = "steady" if scene.time is None else scene.time.scheme if unsteady else "quasi-steady"
    return Plan(
        effects=decisions,
        order=order,
        why_order=why_order,
        geometry_order=_geometry_order(scene, order),
        mesh_size=scene.numerics.mesh_size,
        convection=convection if inert else "no",
        scheme=scheme,
        reynolds=1.0 / scene.viscosity,
        solver=method_of(setup, inert, unsteady, stabilisation.upwind),
        numbers=setup.numbers,
        stabilisation=stabilisation,
        sought=_sought(setup),
        warnings=tuple(text for doubt in doubts.DOUBTS for text in doubt(setup)),
        datum=_datum(setup),
        grain=_grain(scene),
    )


def _sought(setup: Setup) -> str:
    scene, numerics = setup.scene, setup.scene.numerics
    if numerics.accuracy is None:
        return ""
    everything = numerics.accuracy_includes == "all"
    others = ["gap", "domain"] * everything + ["steps"] * (scene.time is not None)
    chosen = f"{', '.join(others)} and mesh are" if others else "the mesh is"
    of = "of discretisation, gap and domain" if everything else "of discretisation"
    aim = f"until the error of the {scene.accuracy_of} ({of}) is below {numerics.accuracy}"
    if numerics.accuracy == "verdict":
        aim = "until the verdict is decided"
    budgets = ((numerics.budget_seconds, "s"), (numerics.budget_mib, "MiB"))
    limits = [f"{limit:g} {unit}" for limit, unit in budgets if limit is not None]
    beyond = f", within {' and '.join(limits)}" if limits else ""
    return f"numerics.accuracy: {chosen} chosen by the run, {aim}{beyond}"


def _geometry_order(scene: Scene, order: int) -> int:
    if scene.numerics.geometry_order is not None:
        return scene.numerics.geometry_order
    grain, bed = scene.grain, scene.bed_shape
    if scene.gdim == 3:
        sharp = isinstance(grain, Box) and grain.edge_radius == 0.0
        flat = bed is None or math.isinf(bed.feature)
        flat = flat and (grain is None or sharp or isinstance(grain, Triangulated))
    else:
        curves = list(scene.grain.chain.curves) if grain is not None else []
        if bed is not None:
            curves.extend(bed.curves(scene.domain.left, scene.domain.right))
        flat = all(isinstance(curve, Line) for curve in curves)
    if flat and not scene.has_surface:  # a wave is curved
        return 1
    # Cells in layers are second-order at most.
    return 2 if scene.gdim == 3 or scene.resolves_walls else min(order, 3)


def _datum(setup: Setup) -> Datum | None:
    scene, bed, base_flow = setup.scene, setup.scene.bed_shape, setup.base_flow
    if not hasattr(scene.flow, "datum") or bed is None or scene.is_averaged:
        return None
    level = base_flow.level
    why = DATUMS[level] if isinstance(level, str) else f"flow.datum = {level:g}"
    if level == "crest" and bed.crest > base_flow.datum:
        why = (
            "the crests of the bed, which are as high in every third of the domain; "
            f"what is higher, up to {'xyz'[scene.up]} = {bed.crest:g}, does not count"
        )
    return Datum(base_flow.datum, f"{why}; the {scene.flow.kind} flow starts there")


def _grain(scene: Scene) -> str:
    grain, body, scales = scene.grain, scene.body, scene.scales
    if grain is None or body is None or not (scales or body.shape in ("mesh", "polygon")):
        return ""
    said = f"grain: largest diameter {grain.size:.6g}, nominal {nominal_diameter(grain):.6g}"
    if body.shape == "mesh" and body.size is not None:
        own = body.model_copy(update={"size": None}).new_grain().size
        said += f"; by its file {own:.6g}, of which body.size makes {body.size:.6g}"
    return said if scales is None else f"{said}; one unit of length is {scales.length:.6g} m"
