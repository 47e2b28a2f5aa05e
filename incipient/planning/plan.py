"""The plan of a scene: effects simulated and left out, discretisation, expense, warnings.

Sub-problems and terms that the plan does not name are never made.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..errors import refuse_path
from ..geometry.plane.curves import Line
from ..geometry.space.grains import Triangulated
from ..scene import Scene
from ..scene.flows import FEWEST
from ..scene.sections import WIDE_GAP
from ..scene.units import nominal_diameter
from ..setup.geometry import HIGHEST
from ..setup.setup import Numbers, Setup
from .discretisation import (
    Method,
    Stabilisation,
    method_of,
    stabilisation_of,
    velocity_order,
)
from .effects import Decision, EffectName, decisions, inertia, listed
from .sizes import GRAIN_CELL, wall_cell

# Of the range of a flow over time, beyond both ends of a step: that of a sine with the fewest steps in its period.
UNSEEN = 0.5 * (1.0 - math.cos(math.pi / FEWEST))
MOST_STEPS = 1e5  # of which a plan looks for extremes in between, within seconds
FREE_OF_INFLOW = 1.0  # grain sizes before a grain, below which a plan warns
# Over a grain, from which on the distance of the walls from the mesh is reported: 50 nu/u* of one of u* d/nu = 1000.
THICK = 0.05
# u* d/nu up to which steady 3-D flow past grains, its walls resolved, converges to one flow: past spheres on spheres it
# does at 100 in 18 iterations; at 300 two iterations converge to two flows, at 660 none does in 80.
CONVERGES_TO = 200.0
# Upwinded cells across a 3-D grain below which its loads are reported uncertain, where a cell over its order is more
# than so many boundary layers, d/Re^(1/2): where it is 1.1, 3.2 and 5.7 of them, lift on a sphere on a plane in a
# log-law flow is 0.2%, 5.6% and 32% above that on cells 0.6 times as large.
FEWEST_ACROSS, LAYERS = 6.0, 2.0
# Roughness over the smallest length of bedforms up to which it is small compared with them.
SMALL = 0.2

DATUMS = {
    "effective": "the effective height of the bed, computed from its shape",
    "mean": "the mean height of the bed",
    "crest": "the crest of the bed",
}

Row = tuple[bool, str]  # whether a warning holds, and its words


@dataclass(frozen=True)
class Estimate:
    """Expense of the computation, counted on the first mesh that will be used."""

    cells: int
    unknowns: int
    memory_mib: float

    def text(self) -> str:
        memory = f"about {self.memory_mib:.0f} MiB of memory"
        return f"{self.cells} cells, {self.unknowns} unknowns, {memory}"


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
    numbers: Numbers
    stabilisation: Stabilisation
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
        axis = "z" if self.has("third dimension") else "y"
        datum = self.datum and f"datum {axis} = {self.datum.height:g}: {self.datum.reason}"
        elements = (
            f"P{self.order}-P{self.order - 1} Taylor-Hood on cells of order {self.geometry_order}"
        )
        sizes = "" if self.sought else f", cell sizes x {self.mesh_size:g}"
        stabilised = "stabilised" if self.stabilisation.present else "not stabilised"
        lines = [
            *(effect.text() for effect in self.effects),
            self.numbers.text(),
            self.grain,
            datum,
            self.sought,
            f"{elements}{sizes}, {self.scheme}, {self.convection} convection",
            self.why_order and f"velocity of order {self.order}: {self.why_order}",
            f"convection {stabilised}: {self.stabilisation.reason}",
            f"linear systems by a {self.solver.name} method: {self.solver.reason}",
            self.estimate and ("first mesh: " if self.sought else "") + self.estimate.text(),
            *(f"warning: {warning}" for warning in self.warnings),
        ]
        return "\n".join(f"  {line}" for line in lines if line)


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
    effects = decisions(setup)
    order, why_order = velocity_order(setup)
    present = {effect.name for effect in effects if effect.present}
    inert, unsteady = "inertia" in present, "unsteadiness" in present
    stabilisation = stabilisation_of(setup, inert)
    convection = scene.numerics.convection if unsteady else "implicit"
    scheme = "steady" if scene.time is None else scene.time.scheme if unsteady else "quasi-steady"
    return Plan(
        effects=effects,
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
        warnings=warnings(setup),
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
    included = "discretisation, gap and domain" if everything else "discretisation"
    aim = f"the error of the {scene.accuracy_of} (of {included}) is below {numerics.accuracy}"
    until = "the verdict is decided" if numerics.accuracy == "verdict" else aim
    budgets = ((numerics.budget_seconds, "s"), (numerics.budget_mib, "MiB"))
    limits = " and ".join(f"{limit:g} {unit}" for limit, unit in budgets if limit is not None)
    within = f", within {limits}" if limits else ""
    return f"numerics.accuracy: {chosen} chosen by the run, until {until}{within}"


def _geometry_order(scene: Scene, order: int) -> int:
    if scene.numerics.geometry_order is not None:
        return scene.numerics.geometry_order
    grain, bed = scene.grain, scene.bed_shape
    if scene.gdim == 3:
        faceted = grain is None or isinstance(grain, Triangulated) or grain.sharp
        flat = faceted and math.isinf(bed.feature)
    else:
        curves = bed.curves(scene.domain.left, scene.domain.right)
        curves = (*curves, *(() if grain is None else grain.chain.curves))
        flat = all(isinstance(curve, Line) for curve in curves)
    if flat and not scene.has_surface:  # a wave is curved
        return 1
    # Cells in layers are second-order at most.
    return 2 if scene.gdim == 3 or scene.resolves_walls else min(order, 3)


def _datum(setup: Setup) -> Datum | None:
    scene, bed, base_flow = setup.scene, setup.scene.bed_shape, setup.base_flow
    if not hasattr(scene.flow, "datum") or scene.bed is None or scene.is_averaged:
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
    grain, body, scales, in_file = scene.grain, scene.body, scene.scales, ""
    if grain is None or body is None or not (scales or body.shape in ("mesh", "polygon")):
        return ""
    if body.shape == "mesh" and body.size is not None:
        own = body.model_copy(update={"size": None}).new_grain().size
        in_file = f"by its file {own:.6g}, of which body.size makes {body.size:.6g}"
    return listed(
        f"grain: largest diameter {grain.size:.6g}, nominal {nominal_diameter(grain):.6g}",
        in_file,
        scales and f"one unit of length is {scales.length:.6g} m",
    )


# -- warnings --------------------------------------------------------------------------------------


def warnings(setup: Setup) -> tuple[str, ...]:
    """What in the scene makes its result less sure, in words.

    Raises SceneError where an effect that is present cannot be simulated in the scene.
    """
    scene, froude, gust = setup.scene, setup.numbers.froude or 0.0, setup.base_flow.gust
    begins = -math.inf if gust is None or scene.time is None else gust.knots()[0]
    late = scene.time is not None and begins >= scene.time.end
    loaded = scene.body is not None and not (scene.is_averaged and setup.walls.is_resolved)
    rows = (
        *(() if scene.body is None else _of_grain(setup)),
        (
            scene.is_still,
            "the fluid is at rest and exerts no load: any verdict is that of the weight alone; use another flow.kind, "
            "or incipient judge, which needs no mesh",
        ),
        (
            scene.has_surface and scene.domain.kind == "channel" and 0.95 <= froude <= 1.3,
            f"the Froude number, {froude:.3g}, is between 0.95 and 1.3: long waves hardly leave near-critical flow, so "
            "that its level depends on the ends and on the length of the run; compare with a larger domain.length and "
            "time.end, or choose another gravity.acceleration or flow.velocity",
        ),
        (late, f"the gust begins at t = {begins:g}, after the end of the run; enlarge time.end"),
        *_between_steps(setup),
        *((_of_upwinding(setup),) if loaded else ()),
        *(_of_turbulence(setup) if scene.is_averaged else ()),
    )
    return tuple(text for holds, text in rows if holds)


def _of_grain(setup: Setup) -> tuple[Row, ...]:
    """The gap between grain and bed, and the distance from the inflow."""
    scene, body, stance = setup.scene, setup.scene.body, setup.stance
    size, placement, resting = scene.grain.size, stance.placement, stance.resting
    assert body is not None and placement is not None and resting is not None
    gap = scene.contact.gap if scene.contact is not None and not scene.closes_contacts else 0.0
    kept, rise = gap * size, placement.centre[scene.up] - resting.centre[scene.up]
    away = (resting.centre[0] - scene.domain.left) / size - 0.5
    return (
        (
            gap > WIDE_GAP and (scene.rests or body.moves),
            f"contact.gap = {gap:g} is wide: loads are computed for a grain {gap:g} of its size above the bed; "
            f"give {WIDE_GAP:g} or less",
        ),
        (
            scene.rests and not body.moves and rise > HIGHEST * kept > 0.0,
            f"for the flow the grain is raised by {rise / size:.2g} of its size, since a steep bed "
            "is nearer than its gap: loads are those of a more exposed grain; give a smaller contact.gap",
        ),
        (
            body.motion == "released" and stance.gap < 0.95 * kept,
            f"the grain starts {stance.gap:.3g} from its bed, closer than its gap of {kept:.3g}, because it touches on "
            "one side only; the first step corrects this: set body.settle = true",
        ),
        (
            away < FREE_OF_INFLOW and scene.domain.kind == "channel" and not scene.flow.at_rest,
            f"the grain is {max(away, 0.0):.2g} of its size from the inflow, where the velocity is prescribed: that "
            f"changes its load; leave {FREE_OF_INFLOW:g} of its size at the least, by body.x or domain.origin",
        ),
    )


def _between_steps(setup: Setup) -> tuple[Row, ...]:
    """Extremes of the flow within time steps of a fixed length, such as those of short gusts."""
    base_flow, domain, time = setup.base_flow, setup.scene.domain, setup.scene.time
    in_steps = time is not None and time.tolerance is None and time.end <= MOST_STEPS * time.step
    if time is None or not in_steps or not setup.scene.flow.changes:
        return ()
    steps = time.step * np.arange(math.ceil(time.end / time.step) + 1)
    instants = base_flow.instants(5 * len(steps))
    instants = instants[instants <= steps[-1]]
    column = domain.entrance, domain.bottom, domain.ceiling
    at_steps = base_flow.sampled(*column, steps, 5)
    within = base_flow.sampled(*column, instants, 5)
    after = np.clip(np.searchsorted(steps, instants), 1, len(steps) - 1)
    low, high = np.sort([at_steps[after - 1], at_steps[after]], axis=0)
    whole = max(np.ptp(within, axis=0).max(), 1e-300)
    unseen = np.maximum(within - high, low - within).max(axis=(1, 2)) / whole
    return (
        (
            unseen.max() > UNSEEN,
            f"at t = {instants[unseen.argmax()]:.4g}, within a time step, the flow differs by {unseen.max():.0%} of "
            "its range from the values at both ends of the step, and no step sees that; use a smaller time.step",
        ),
    )


def _of_turbulence(setup: Setup) -> tuple[Row, ...]:
    """Walls, bedforms and grain of a mean flow."""
    from ..turbulence.wall_law import SMOOTH_TO

    walls, scene, size, gap = setup.walls, setup.scene, math.inf, math.inf
    if scene.grain is not None:
        size, gap = scene.grain.size, setup.stance.gap
    functions = scene.body is not None and not walls.is_resolved
    rough, within, feature = walls.roughness, walls.distance("body") / size, scene.bed_shape.feature
    return (
        (
            not walls.is_resolved and within > THICK,
            f"the grain has u* d/nu = {size / walls.unit:.3g}: the layer that the law of the wall stands for is "
            f"{100 * within:.0f}% of it; it is thin up to {100 * THICK:.0f}%",
        ),
        (
            walls.is_resolved and scene.gdim == 3 and CONVERGES_TO < size / walls.unit < math.inf,
            f"the grain has u* d/nu = {size / walls.unit:.3g}, and above {CONVERGES_TO:g} a steady 3-D flow with "
            "resolved walls often does not converge, or converges to one of several flows that separate at different "
            "places: at 300 past spheres lift was 0.06 or 0.16 of the drag, a difference that no error bar contains; "
            'compare with turbulence.model = "k-epsilon", or with 2-D',
        ),
        (
            walls.asked.model == "k-epsilon" and scene.grain is not None,
            "the k-epsilon model is far from measured loads on smooth round bodies, by more than error bars tell: drag "
            "on a sphere on a bed a third too small, on a hump a quarter to two fifths of it, lift there a quarter to "
            "a third too large; another program with this model has 1.1 to 1.6 times the drag, 0.5 to 0.9 of the lift",
        ),
        (
            0.0 < rough < SMOOTH_TO * walls.unit,
            f"the walls are hydraulically smooth, u* k_s/nu about {rough / walls.unit:.2g}: their roughness changes "
            "nothing",
        ),
        (
            rough > SMALL * feature,
            f"the roughness of the bed, {rough:.3g}, is {100 * rough / feature:.0f}% of the smallest length of its "
            f"forms, {feature:.3g}: the model assumes that it is small compared with them, as it is up to "
            f"{100 * SMALL:.0f}%",
        ),
        (
            rough > gap,
            f"the roughness of the bed, {rough:.3g}, is higher than the gap below the grain, {gap:.3g}: flow in the "
            "gap is not resolved, since the model assumes a roughness smaller than all meshed lengths",
        ),
        (
            walls.is_resolved and _cut_at_inflow(setup),
            "the inflow cuts bedforms, next to which k may diverge, since the inflow profile has developed over "
            "a planar bed: put the grain farther downstream of the inflow",
        ),
        (
            walls.is_laminar,
            f"the inflow is laminar by the k-omega model, u* h/nu = {walls.depth / walls.unit:.3g}: k decays to "
            "nothing there, and loads are those of laminar flow",
        ),
        *((_of_wall_functions(setup),) if functions else ()),
    )


def _of_upwinding(setup: Setup) -> Row:
    """Large upwinded cells at a grain; in laminar flow error bars contain what they change."""
    scene, order, mesh_size = setup.scene, velocity_order(setup)[0], setup.scene.numerics.mesh_size
    across, barred = 1.0 / GRAIN_CELL[scene.gdim][order], scene.numerics.error_bars
    layers = math.sqrt(max(setup.numbers.grain_reynolds or 0.0, 1e-9))
    fewest = min(FEWEST_ACROSS, layers / (LAYERS * order))
    if scene.is_averaged:
        across, barred = max(scene.grain.size / wall_cell(setup.walls, order), across), False
        fewest = FEWEST_ACROSS
    across /= mesh_size
    upwind = stabilisation_of(setup, inertia(setup).present).upwind
    return (
        upwind and across < fewest and not barred,
        f"the grain is {across:.2g} times as wide as its cells, which are upwinded: at 3 times drag was a fifth or "
        "lift a third too large, and a safety factor a quarter off; "
        f"use numerics.mesh_size = {mesh_size * across / fewest:.2g} or less",
    )


def _of_wall_functions(setup: Setup) -> Row:
    """The gap of a grain in the logarithmic layer."""
    scene, walls = setup.scene, setup.walls
    assert scene.placement is not None
    # The law of each wall ignores the other: friction in a gap is too small.
    least, near = 2.0 * walls.distance("body"), setup.clearance(scene.placement)
    held = not scene.rests and not scene.moves
    return (
        held and near.other in walls.names and near.distance < least,
        f"the grain is held {near.distance:.3g} from the {near.other}, twice the distance of the law of the wall "
        f"is {least:.3g}: flow in the gap is not resolved; hold it farther away, or let it touch by body.x",
    )


def _cut_at_inflow(setup: Setup) -> bool:
    """Whether the inflow cuts bedforms, which are meshed there."""
    scene, bed, placement = setup.scene, setup.scene.bed_shape, setup.scene.placement
    if scene.gdim == 2 or placement is None or math.isinf(bed.feature):
        return False
    resolved = setup.resolved_bed(placement)
    nearest = np.array([[scene.domain.left, placement.centre[1]]])
    return resolved is None or bool(resolved.share(nearest)[0] < 1.0)
