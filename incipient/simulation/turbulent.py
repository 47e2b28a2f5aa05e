"""The turbulence of a run: made for a scene, solved with its flow, judged by the distance of its walls."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..fluid import Fluid
from ..fluid.space import boundary_blocks
from ..forms import turbulence as forms
from ..mesh.domain import Domain
from ..planning import turbulence as planned
from ..planning.cells import side_names
from ..results.turbulence import WallReport
from ..scene import Scene
from ..scene.tolerance import of_steady
from ..turbulence import InTime, Surroundings, Turbulence, solve_steadily

if TYPE_CHECKING:
    from .state import Run

ORDER = 2  # of the elements of ln k and ln epsilon


class TurbulentFlow:
    """The turbulence of a scene's flow. Every method is collective.

    Attributes:
        fields: k and epsilon.
    """

    def __init__(self, scene: Scene, domain: Domain):
        self._scene, self._walls = scene, planned.walls_of(scene)
        inflow, walls = (side_names(scene)[3],), planned.wall_names(scene)
        surroundings = Surroundings(inflow, planned.logarithms(scene), walls, self._walls.distance)
        self.fields = Turbulence(domain, surroundings, ORDER, planned.section(scene).constants)

    def joined(self, fluid: Fluid) -> None:
        """Let the velocity of the fluid that this turbulence is in carry it; both are freed together."""
        fluid.holding(self.fields)
        velocity, _ = ufl.split(fluid.state)
        self.fields.carried_by(velocity, self.fields.constant(self._scene.viscosity))

    def solve(self, run: Run) -> None:
        """Find the steady flow with its turbulence, from that of the inflow everywhere.

        Raises:
            ConvergenceError: there is none that could be found.
        """
        fluid, walls, scene = run.fluid, self._walls, self._scene
        enters = planned.velocity(scene)
        start = dolfinx.fem.Function(fluid.space.velocity)
        start.interpolate(lambda x: enters(x, 0.0))
        fluid.state.x.array[fluid.space.velocity_map] = start.x.array
        with run.stage("flow"):
            rounds = solve_steadily(
                *(fluid, self.fields, walls.depth / scene.reference_velocity),
                of_steady(scene.numerics.tolerance, False),
                lambda found: run.voice.iterate(1.0, found.number, found.of_turbulence),
                _stage(run),
            )
        run.accounts.count(turbulence=len(rounds))

    def in_time(self, run: Run) -> InTime:
        """What a flow in time is solved together with."""
        return InTime(run.fluid, self.fields, _stage(run))

    def unknowns(self) -> int:
        """How many there are."""
        space = self.fields.space
        return int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)

    def functions(self) -> dict[str, Any]:
        """k, epsilon and the eddy viscosity on the nodes, by the names that files have."""
        closure, logarithms = self.fields.closure, ufl.split(self.fields.state)
        eddies = forms.eddy_viscosity(logarithms, closure)
        expressions = {
            "k": ufl.exp(logarithms[0]),
            "epsilon": ufl.exp(logarithms[1]),
            "eddy_viscosity": eddies,
        }
        scalar = compat.space(self.fields.domain.mesh, ("Lagrange", ORDER))
        found = {}
        for name, expression in expressions.items():
            found[name] = dolfinx.fem.Function(scalar, name=name)
            points = compat.interpolation_points(scalar)
            found[name].interpolate(dolfinx.fem.Expression(expression, points))
        return found

    def report(self, fluid: Fluid) -> WallReport:
        """u* and y+ along the walls, and what they say of the law."""
        scene, walls = self._scene, self._walls
        own = fluid.space.velocity.dofmap.index_map.size_local
        names = planned.wall_names(scene)
        nodes = [boundary_blocks(fluid.space.velocity, fluid.domain.facets_of(name)) for name in names]
        chosen = np.unique(np.concatenate(nodes)).astype(int)
        blocks = fluid.state.x.array[fluid.space.velocity_map].reshape(-1, scene.gdim)[chosen[chosen < own]]
        speeds = np.linalg.norm(blocks, axis=1)
        found = walls.law.shear_velocity(np.maximum(speeds, 1e-300), scene.viscosity, walls.distance)
        places = fluid.constraints.points[chosen[chosen < own], 0]
        gathered = fluid.domain.comm.allgather((places, found))
        along, everywhere = (np.concatenate([one[i] for one in gathered]) for i in range(2))
        last = everywhere[np.isclose(along, along.max())]
        return WallReport(
            distance=walls.distance,
            least=float(everywhere.min() * walls.distance / scene.viscosity),
            largest=float(everywhere.max() * walls.distance / scene.viscosity),
            shear_velocity=float(everywhere.mean()),
            at_outflow=float(last.mean()),
            friction=float(2.0 * (last.mean() / scene.reference_velocity) ** 2),
            viscosity=scene.viscosity,
            c_mu=planned.section(scene).c_mu,
        )


def _stage(run: Run) -> Callable[[], AbstractContextManager[None]]:
    """Takes the time of k and epsilon."""
    return lambda: run.accounts.ledger.stage("turbulence")
