"""The first mesh of a run or of a search for an accuracy, and the plan of a scene with its cost on that mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..errors import MissingError
from ..installed import free_bytes, memory_of_libraries
from ..planning import meshing
from ..planning.discretisation import FAR_CELL, LEVEL, order_of
from ..planning.effects import inertia
from ..planning.meshing import Layout, coarse_sizes
from ..planning.plan import Estimate, Plan, make_plan, plan_of
from ..scene import Scene
from ..scene.sections import MESH_SIZES, ORDERS, Numerics
from ..setup.setup import Setup
from .coarse_runs import (
    FEWEST_STEPS,
    LONGEST_FIRST,
    LONGEST_STEP,
    MODEL_MESH,
    changed,
    comparisons,
    longest_step,
    with_step,
)
from .terms import COARSEST_IN_SPACE, is_stream, on_more_bed

COARSEST = 4.0  # cells of the first mesh over the default


def includes_all(numerics: Numerics) -> bool:
    """Whether an accuracy includes errors of gap and domain."""
    return numerics.accuracy == "verdict" or numerics.accuracy_includes == "all"


def coarsest(scene: Scene) -> float:
    """Cells of the first mesh relative to the default. In 3-D it is also moved to other gaps and domains."""
    fine = scene.gdim == 3 and (includes_all(scene.numerics) or inertia(Setup(scene)).present)
    return MODEL_MESH if fine else COARSEST


@dataclass(frozen=True)
class Attempt:
    """A mesh to try: its scene, and the change of the planned cell sizes.

    growth, work: expected unknowns and work over those of the last run
    """

    scene: Scene
    sizing: Callable[[Layout], Layout] = lambda layout: layout
    growth: float = 1.0
    work: float = 1.0
    note: str = ""


def on_all_cells(scene: Scene, growth: float = 1.0, work: float = 1.0) -> Attempt:
    """The attempt on a scene's own cells."""
    note = "" if scene.time else f"mesh_size {scene.numerics.mesh_size:.3g}"
    return Attempt(scene, growth=growth, work=work, note=note)


def first_attempt(scene: Scene, failures: int = 0) -> Attempt:
    """The first attempt of a search, finer after failures: a coarse mesh, in unsteady flow also a few long steps.

    Below a free surface the inflow zone, at least one cell long, has the same length on all meshes.
    """
    finer = 0.5**failures
    if scene.is_averaged:
        most = COARSEST_IN_SPACE if scene.resolves_uneven_walls else MESH_SIZES[1]
        size = min(finer * COARSEST * scene.numerics.mesh_size, most)
        return on_all_cells(changed(scene, numerics={"mesh_size": size}))
    if scene.time is None:
        return Attempt(scene, partial(coarse_sizes, finer * coarsest(scene), None))
    longer, cells = LONGEST_FIRST, 8.0**0.5
    longest = min(scene.time.end / FEWEST_STEPS, longest_step(scene))
    while longer > 1.0 and longer * scene.time.step > longest:
        longer /= 2.0
    if is_stream(scene):
        size = FAR_CELL[scene.gdim][min(order_of(scene) + 1, ORDERS[-1])] * scene.numerics.mesh_size
        cells = float(np.clip(LEVEL / size, 1.0, cells))
    return on_all_cells(rescaled(scene, finer * longer, finer**0.5 * cells))


def rescaled(scene: Scene, steps: float, cells: float) -> Scene:
    """The scene with time steps and cells times a factor each, with so many steps that comparisons end as well."""
    mesh_size = min(float(f"{cells * scene.numerics.mesh_size:.12g}"), MESH_SIZES[1])
    sections = {"numerics": {"mesh_size": mesh_size}}
    if scene.time is not None:
        end, step = scene.time.end, scene.time.step
        number = math.ceil(end / (LONGEST_STEP * steps * step) * (1.0 - 1e-9))
        sections["time"] = with_step(scene, end / (LONGEST_STEP * number))
    return changed(scene, **sections)


def planned(scene: Scene) -> Plan:
    """The plan with cells, unknowns and memory of the first mesh, or without gmsh a warning. Raises MeshError."""
    plan = make_plan(scene)
    warnings = [*plan.warnings]
    estimate: Estimate | None = None
    try:
        estimate = first_mesh(scene)
        free = free_bytes() / 2**20
        if estimate.memory_mib > free:
            remedy = "use a coarser mesh (numerics.mesh_size), or free some memory"
            warnings.append(f"{free:.0f} MiB of memory are free, which may not suffice: {remedy}")
    except MissingError as error:
        warnings.append(f"cells, unknowns and memory are not known: {error}")
    return replace(plan, estimate=estimate, warnings=tuple(warnings))


def first_mesh(scene: Scene) -> Estimate:
    """Cells, unknowns and memory of the first mesh of a run. Raises MeshError.

    Memory includes the coarse run of the error bars that coexists with the flow.
    """
    attempt = Attempt(scene) if scene.numerics.accuracy is None else first_attempt(scene)
    scene, numerics, setup = attempt.scene, attempt.scene.numerics, Setup(attempt.scene)
    plan = plan_of(setup)
    held = scene.body is not None and scene.time is None and not scene.is_averaged
    has_dual = held and (numerics.error_bars or numerics.accuracy is not None)
    wider = on_more_bed(scene) if has_dual else None
    beside = None if wider is None else meshing.lay_out(Setup(wider), plan)
    layout = attempt.sizing(meshing.lay_out(setup, plan))
    expected = meshing.count(layout, plan.order, has_dual, plan.solver.name, beside)
    more = meshing.memory_of_parts(setup, expected.unknowns)
    if scene.gdim == 3 and scene.has_surface and numerics.error_bars:
        other = first_mesh(changed(comparisons(scene)[1], numerics={"accuracy": None}))
        more += other.memory_mib - memory_of_libraries()
    return replace(expected, memory_mib=expected.memory_mib + more)
