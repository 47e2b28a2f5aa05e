"""The plan of a scene with its cost on the first mesh of its run."""

from __future__ import annotations

from dataclasses import replace

from ..errors import MissingError
from ..installed import memory_of_libraries
from ..planning import meshing
from ..planning.meshing import coarse_sizes
from ..planning.plan import Estimate, Plan, make_plan, plan_of
from ..scene import Scene
from ..setup.setup import Setup
from . import next_mesh
from .coarse_runs import changed, comparisons
from .terms import on_more_bed


def planned(scene: Scene) -> Plan:
    """The plan with cells, unknowns and memory of the first mesh, or without gmsh a warning. Raises MeshError."""
    plan = make_plan(scene)
    try:
        return replace(plan, estimate=first_mesh(scene))
    except MissingError as error:
        return replace(
            plan, warnings=(*plan.warnings, f"cells, unknowns and memory are not known: {error}")
        )


def first_mesh(scene: Scene) -> Estimate:
    """Cells, unknowns and memory of the first mesh of a run. Raises MeshError."""
    if scene.numerics.accuracy is None:
        return counted(scene)
    if scene.is_averaged:
        return counted(changed(scene, numerics={"mesh_size": next_mesh.first_size(scene)}))
    steady = scene.time is None
    setup = Setup(scene if steady else next_mesh.first(scene))
    plan = plan_of(setup)
    layout = meshing.lay_out(setup, plan)
    sized = coarse_sizes(next_mesh.coarsest(scene), None, layout) if steady else layout
    return meshing.count(sized, plan.order, steady, plan.solver.name)


def counted(scene: Scene) -> Estimate:
    """Cells, unknowns and memory of a run on its mesh.

    Memory includes the coarse run of the error bars that coexists with the flow.
    """
    setup = Setup(scene)
    plan, has_dual = plan_of(setup), meshing.has_dual(setup)
    wider = on_more_bed(scene) if has_dual else None
    beside = None if wider is None else meshing.lay_out(Setup(wider), plan)
    layout = meshing.lay_out(setup, plan)
    expected = meshing.count(layout, plan.order, has_dual, plan.solver.name, beside)
    more = meshing.memory_of_parts(setup, expected.unknowns)
    if scene.gdim == 3 and scene.has_surface and scene.numerics.error_bars:
        other = counted(comparisons(scene)[1])
        more += other.memory_mib - memory_of_libraries()
    return replace(expected, memory_mib=expected.memory_mib + more)
