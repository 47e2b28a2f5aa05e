"""The plan of a scene with its expense, by making the first mesh of its run."""

from __future__ import annotations

from ..accuracy.coarse_runs import changed
from ..effects.plan import make_plan, plan_of
from ..errors import MissingError
from ..planning import expense, meshing
from ..planning.flow_setup import Setup, has_inertia
from ..planning.layout import coarse_sizes
from ..planning.plan import Estimate, Plan
from ..scene import Scene
from ..simulation.build import estimate
from . import balance
from .orders import COARSEST, coarsest

LARGEST = 100.0  # of numerics.mesh_size


def planned(scene: Scene) -> Plan:
    """The plan with cells, unknowns and memory, on the first mesh if there are several. Not collective.

    Without gmsh the plan has a warning instead. Raises MeshError.
    """
    plan = make_plan(scene)
    try:
        return plan.with_estimate(first_mesh(scene))
    except MissingError as error:
        return plan.warned(f"cells, unknowns and memory are not known: {error}")


def first_mesh(scene: Scene) -> Estimate:
    """Cells, unknowns, memory on the first mesh of a run, which is made. Not collective; raises MeshError."""
    if scene.numerics.accuracy is None:
        return estimate(scene).counted
    if scene.is_averaged:
        size = min(COARSEST * scene.numerics.mesh_size, LARGEST)
        return estimate(changed(scene, numerics={"mesh_size": size})).counted
    steady = scene.time is None
    setup = Setup(scene if steady else balance.first(scene))
    plan = plan_of(setup)
    layout = meshing.lay_out(setup, plan)
    factor = coarsest(scene.gdim, has_inertia(scene))
    sized = coarse_sizes(factor, None, layout) if steady else layout
    return expense.count(sized, plan.order, steady, plan.solver.name)
