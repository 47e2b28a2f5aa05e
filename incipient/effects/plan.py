"""Plan of a scene: effects simulated and omitted, and resolution; only what it names is built."""

from __future__ import annotations

import math

from ..geometry.plane.curves import Line
from ..geometry.space.grains import Box, Triangulated
from ..planning.datum import datum_of
from ..planning.effects import EffectName
from ..planning.flow_setup import Setup
from ..planning.linear import method_of
from ..planning.numbers import grain_size
from ..planning.plan import Plan
from ..planning.scene_geometry import Geometry
from ..planning.stabilisation import stabilisation_of
from ..scene import Scene
from . import known

GEOMETRY_ORDER = {2: 2, 3: 3, 4: 3}


def make_plan(scene: Scene) -> Plan:
    """Plan a scene without meshing or computing. Not collective.

    Raises SceneError if a required effect cannot be simulated in the scene.
    """
    return plan_of(Setup(scene))


def plan_of(setup: Setup) -> Plan:
    """Plan a prepared scene, as `make_plan` does. Not collective."""
    scene = setup.scene
    numbers = setup.numbers
    effects = known.decisions(setup, numbers)
    present = {effect.name for effect in effects if effect.present}
    inert, unsteady = EffectName.INERTIA in present, EffectName.UNSTEADINESS in present
    convection = scene.numerics.convection if unsteady else "implicit"
    scheme = "steady" if scene.time is None else scene.time.scheme if unsteady else "quasi-steady"
    return Plan(
        effects=effects,
        order=setup.order.number,
        why_order=setup.order.reason,
        geometry_order=_geometry_order(setup),
        mesh_size=scene.numerics.mesh_size,
        convection=convection if inert else "no",
        scheme=scheme,
        reynolds=1.0 / scene.viscosity,
        solver=method_of(setup, slow=not (inert or unsteady), unsteady=unsteady),
        numbers=numbers,
        stabilisation=stabilisation_of(setup, inert),
        sought=_sought(setup),
        warnings=tuple(warning for effect in known.EFFECTS for warning in effect.warnings(setup)),
        datum=datum_of(setup),
        grain=grain_size(scene),
    )


def _sought(setup: Setup) -> str:
    """Describe how the run chooses mesh, order and time steps."""
    scene, numerics = setup.scene, setup.scene.numerics
    if numerics.accuracy is None:
        return ""
    everything = numerics.accuracy_includes == "all"
    chosen = ("gap, domain, " if everything else "") + (
        "mesh and order" if scene.time is None else "steps, mesh and order"
    )
    chosen = f"{chosen} are"
    if scene.is_averaged:
        chosen = "gap, domain and mesh are" if everything else "the mesh is"
    of = "of discretisation, gap and domain" if everything else "of discretisation"
    aim = f"until the error of the {scene.accuracy_of} ({of}) is below {numerics.accuracy}"
    if numerics.accuracy == "verdict":
        aim = "until the verdict is decided"
    budgets = ((numerics.budget_seconds, "s"), (numerics.budget_mib, "MiB"))
    limits = [f"{limit:g} {unit}" for limit, unit in budgets if limit is not None]
    beyond = f", within {' and '.join(limits)}" if limits else ""
    return f"numerics.accuracy: {chosen} chosen by the run, {aim}{beyond}"


def _geometry_order(setup: Setup) -> int:
    """Straight cells if all boundaries are straight, otherwise curved ones to match the velocity."""
    scene, geometry = setup.scene, setup.geometry
    if scene.numerics.geometry_order is not None:
        return scene.numerics.geometry_order
    if scene.has_surface:  # a wave is curved
        return GEOMETRY_ORDER[setup.order.number if scene.gdim == 2 else 2]
    if scene.gdim == 3:
        return 1 if _has_flat_faces(geometry) else GEOMETRY_ORDER[2]
    curves = list(geometry.grain.drawn()) if geometry.grain is not None else []
    if geometry.bed is not None:
        curves.extend(geometry.bed.curves(geometry.domain.left, geometry.domain.right))
    # Layers support second-order cells at most.
    order = 2 if setup.scene.resolves_walls else setup.order.number
    return 1 if all(isinstance(curve, Line) for curve in curves) else GEOMETRY_ORDER[order]


def _has_flat_faces(geometry: Geometry) -> bool:
    """Whether all boundaries of a 3-D geometry are planes."""
    grain, bed = geometry.grain, geometry.bed
    level = bed is None or not math.isfinite(bed.feature)
    sharp = isinstance(grain, Box) and grain.edge_radius == 0.0
    return level and (grain is None or sharp or isinstance(grain, Triangulated))
