"""From the scene follows the plan: which effects are simulated, which are left out and why, and how finely.

The plan decides what is built. A sub-problem or a term that it does not name is never made: no space, no
compiled form, no unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..errors import SceneError
from ..geometry.plane.curves import Line
from ..scene import Scene
from ..scene.model import WIDE_GAP
from ..scene.order import order_of
from .clearance import near_inflow
from .datum import Datum, datum_of
from .effects import Effect, EffectName, Numbers, effects_of, numbers_of
from .linear import Method, method_of
from .open_channel import near_critical
from .stabilisation import NO_CONVECTION, Stabilisation, stabilisation_of

__all__ = ["Effect", "Estimate", "Plan", "make_plan"]

GEOMETRY_ORDER = {2: 2, 3: 3, 4: 3}


@dataclass(frozen=True)
class Estimate:
    """What the computation will need, counted on the mesh that will be used, the first one if there are several."""

    cells: int
    unknowns: int
    memory_mib: float

    def with_more(self, memory_mib: float) -> Estimate:
        """The estimate with more memory [MiB]."""
        return replace(self, memory_mib=self.memory_mib + memory_mib)


@dataclass(frozen=True)
class Plan:
    """Effects, discretisation and (where it has been counted) expense of a scene's computation.

    why_order: what the order of the velocity follows from, in words; empty where the scene gives it
    sought:   what mesh and order are chosen for by the run, in words; empty where the scene chooses them
    warnings: what in the scene makes the result less sure, in words
    solver:   method for the linear systems
    datum:    where the profile of the flow starts, None without a profile or a bed
    """

    effects: tuple[Effect, ...]
    order: int
    geometry_order: int
    mesh_size: float
    convection: str
    scheme: str
    reynolds: float
    solver: Method
    numbers: Numbers | None = None
    stabilisation: Stabilisation = NO_CONVECTION
    estimate: Estimate | None = None
    why_order: str = ""
    sought: str = ""
    warnings: tuple[str, ...] = ()
    datum: Datum | None = None

    def has(self, name: EffectName) -> bool:
        """Whether an effect is simulated."""
        return any(effect.present for effect in self.effects if effect.name == name)

    def with_estimate(self, estimate: Estimate) -> Plan:
        """This plan with its expense counted."""
        return replace(self, estimate=estimate)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def text(self) -> str:
        """The plan as a few lines for a reader."""
        lines = [f"  {'yes' if e.present else ' no'}  {e.name}: {e.reason}" for e in self.effects]
        if self.numbers is not None:
            lines.append(f"  {self.numbers.text()}")
        if self.datum is not None:
            lines.append(f"  {self.datum.text('z' if self.has(EffectName.THIRD_DIMENSION) else 'y')}")
        lines += [*self._discretisation(), f"  {self.stabilisation.text()}", f"  {self.solver.text()}"]
        if self.estimate is not None:
            e, first = self.estimate, "first mesh: " if self.sought else ""
            lines.append(
                f"  {first}{e.cells} cells, {e.unknowns} unknowns, about {e.memory_mib:.0f} MiB of memory"
            )
        lines += [f"  warning: {warning}" for warning in self.warnings]
        return "\n".join(lines)

    def _discretisation(self) -> list[str]:
        elements = f"P{self.order}-P{self.order - 1} Taylor-Hood on cells of order {self.geometry_order}"
        solved = f"{self.scheme}, {self.convection} convection"
        why = [f"  velocity of order {self.order}: {self.why_order}"] if self.why_order else []
        if not self.sought:
            return [f"  {elements}, cell sizes x {self.mesh_size:g}, {solved}", *why]
        return [f"  {self.sought}", f"  {elements} at first, {solved}", *why]


def make_plan(scene: Scene) -> Plan:
    """Decide from the scene alone; nothing is meshed or computed. Not collective."""
    numerics, numbers = scene.numerics, numbers_of(scene)
    effects = effects_of(scene, numbers)
    present = {effect.name for effect in effects if effect.present}
    return Plan(
        effects=effects,
        order=scene.order,
        why_order=order_of(scene).reason,
        geometry_order=_geometry_order(scene),
        mesh_size=numerics.mesh_size,
        convection=_convection(scene, present),
        scheme=_scheme(scene, present),
        reynolds=1.0 / scene.viscosity,
        solver=method_of(
            scene,
            slow=not present & {EffectName.INERTIA, EffectName.UNSTEADINESS},
            unsteady=EffectName.UNSTEADINESS in present,
        ),
        numbers=numbers,
        stabilisation=stabilisation_of(scene, EffectName.INERTIA in present),
        sought=_sought(scene),
        warnings=tuple(_warnings(scene)),
        datum=datum_of(scene),
    )


def _warnings(scene: Scene) -> Iterator[str]:
    if scene.is_turbulent:
        from . import turbulence as walls
        from .clearance import narrow_gap, through_the_top

        if why := walls.beyond_walls(scene) or walls.within_sand(scene):
            raise SceneError(f"turbulence.{why}")
        if why := walls.within_forms(scene):
            raise SceneError(f"bed: {why}")
        if why := walls.too_small(scene):
            raise SceneError(f"turbulence: {why}")
        if why := walls.too_near(scene):
            raise SceneError(f"turbulence: {why}")
        if why := through_the_top(scene):
            raise SceneError(f"body.{why}")
        told = (walls.small, narrow_gap, walls.cornered, walls.coarse_at_grain, walls.smooth_grain)
        yield from filter(None, (one(scene) for one in told))
    yield from filter(None, (near_critical(scene), near_inflow(scene)))
    gap = scene.contact.gap if scene.contact is not None and not scene.closes_contacts else 0.0
    if gap > WIDE_GAP and scene.body is not None and (scene.rests or scene.body.moves):
        yield (
            f"contact.gap = {gap:g} is wide: contact is judged by the flow around a grain {gap:g} of its size "
            f"away from the bed; give {WIDE_GAP:g} or less"
        )


def _sought(scene: Scene) -> str:
    """What the run chooses mesh and order, in time the steps as well, for."""
    numerics = scene.numerics
    if numerics.accuracy is None:
        return ""
    everything = numerics.accuracy_includes == "all"
    chosen = ("gap, domain, " if everything else "") + (
        "mesh and order" if scene.time is None else "steps, mesh and order"
    )
    chosen = f"{chosen} are"
    if scene.is_turbulent:
        chosen = "gap, domain and mesh are" if everything else "the mesh is"
    of = "of discretisation, gap and domain" if everything else "of discretisation"
    aim = f"until the error of the {scene.accuracy_of} ({of}) is below {numerics.accuracy}"
    if numerics.accuracy == "verdict":
        aim = "until the verdict is decided"
    budgets = ((numerics.budget_seconds, "s"), (numerics.budget_mib, "MiB"))
    limits = [f"{limit:g} {unit}" for limit, unit in budgets if limit is not None]
    beyond = f", within {' and '.join(limits)}" if limits else ""
    return f"numerics.accuracy: {chosen} chosen by the run, {aim}{beyond}"


def _geometry_order(scene: Scene) -> int:
    """Straight cells where every boundary is straight, else curved ones to match the velocity."""
    if scene.numerics.geometry_order is not None:
        return scene.numerics.geometry_order
    if scene.has_surface:  # a wave is curved
        return GEOMETRY_ORDER[scene.order if scene.gdim == 2 else 2]
    if scene.gdim == 3:
        return 1 if _has_flat_faces(scene) else GEOMETRY_ORDER[2]
    curves = list(scene.grain.drawn()) if scene.grain is not None else []
    if scene.bed_shape is not None:
        curves.extend(scene.bed_shape.curves(scene.domain.left, scene.domain.right))
    return 1 if all(isinstance(curve, Line) for curve in curves) else GEOMETRY_ORDER[scene.order]


def _has_flat_faces(scene: Scene) -> bool:
    """Whether every boundary of a scene in space is made of planes."""
    from ..geometry.space.polyhedra import Box, Triangulated

    grain, bed = scene.grain, scene.bed_shape
    level = bed is None or not math.isfinite(bed.feature)
    sharp = isinstance(grain, Box) and grain.edge_radius == 0.0
    return level and (grain is None or sharp or isinstance(grain, Triangulated))


def _convection(scene: Scene, present: set[EffectName]) -> str:
    if EffectName.INERTIA not in present:
        return "no"
    return scene.numerics.convection if EffectName.UNSTEADINESS in present else "implicit"


def _scheme(scene: Scene, present: set[EffectName]) -> str:
    if scene.time is None:
        return "steady"
    return scene.time.scheme if EffectName.UNSTEADINESS in present else "quasi-steady"
