"""The k-epsilon model on a mesh that ends a distance from its walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl

from ...fluid import Fluid
from ...fluid.along_walls import AlongWall, along_wall, at_end
from ...forms import turbulence as forms
from ...mesh.domain import Domain
from ...planning import wall_conditions
from ...planning.base_flow import Velocity
from ...planning.wall_layer import LayeredWalls
from ...results.wall_report import WallReport
from .fields import TurbulenceConditions, TurbulenceFields, Values
from .part import ORDER, TurbulentFlow


class KEpsilon(TurbulenceFields):
    """ln k and ln epsilon, with walls felt by wall functions. Every method is collective."""

    second = "epsilon"
    # With half of it the stone of demos/scenes/large_grain.toml takes 40 iterations, not 28, that of
    # stone_in_turbulence.toml 50, not 36.
    wanted = 1.0, 0.1

    def __init__(
        self,
        domain: Domain,
        surroundings: TurbulenceConditions,
        order: int,
        constants: Sequence[float],
    ):
        super().__init__(domain, surroundings, order)
        self.closure = forms.Closure(*(self.constant(one) for one in constants))
        self._away = self.constant(surroundings.distance)

    def stand(self, distance: float) -> None:
        """Let walls be another distance from the mesh."""
        self._away.value = distance

    def viscosity(self, of_molecules: Any) -> Any:
        """The molecular and eddy viscosity, for `FlowModel.viscosity`."""
        return of_molecules + forms.eddy_viscosity(ufl.split(self.state), self.closure)

    def shear_velocity(self) -> Any:
        """u* of a logarithmic layer of this k, for `FlowModel.shear_velocity`."""
        return forms.shear_velocity(ufl.split(self.state), self.closure)

    def _equations(self, rate: Any, tests: Any, stream: forms.Stream) -> Any:
        """The residual of both equations in UFL, with the flux of epsilon at walls."""
        form = super()._equations(rate, tests, stream)
        if not self.surroundings.walls:
            return form
        flux = forms.at_wall(
            ufl.split(self.state), tests[1], self._away, stream.viscosity, self.closure
        )
        names = self.domain.names
        walls = ufl.ds(
            tuple(names[name] for name in self.surroundings.walls),
            domain=self.domain.mesh,
            subdomain_data=self.domain.facets,
            metadata=stream.measure.metadata(),
        )
        return form + flux * walls


class KEpsilonFlow(TurbulentFlow):
    """The k-epsilon model in a scene's flow, judged by the distance of its walls. Every method is collective."""

    fields: KEpsilon

    def _made(self, domain: Domain) -> KEpsilon:
        walls = self._walls
        given = TurbulenceConditions(
            (self._setup.sides.left,),
            wall_conditions.logarithms(self._setup),
            walls.names,
            walls.distance,
        )
        return KEpsilon(domain, given, ORDER, self._setup.turbulence.constants)

    def _entering(self) -> tuple[Velocity, Values]:
        return wall_conditions.velocity(self._setup), wall_conditions.logarithms(self._setup)

    @property
    def _walls(self) -> LayeredWalls:
        return self._setup.walls

    def _give(self, fluid: Fluid) -> None:
        """Let inflow and walls be those of the setup as it is now."""
        super()._give(fluid)
        self.fields.stand(self._walls.distance)
        fluid.walls.stand(self._walls.distance)

    def wall_report(self) -> WallReport:
        """u* and y+ along the walls, and what they say of the law."""
        scene, walls, names = self._scene, self._walls, self._walls.names
        along = {
            name: along_wall(self._fluid, name, self.fields.shear_velocity()) for name in names
        }
        governing, found, shares, x = (
            np.concatenate(parts)
            for parts in zip(*(self._shear_velocities(one) for one in along.values()), strict=True)
        )
        y_plus = governing * walls.distance / scene.viscosity
        end = at_end(x)
        last = np.average(found[end], weights=shares[end])
        outside = ~walls.law.holds(governing, scene.viscosity, walls.distance, walls.depth)
        return WallReport(
            distance=walls.distance,
            least=float(y_plus.min()),
            largest=float(y_plus.max()),
            shear_velocity=float(found @ shares / shares.sum()),
            at_outflow=float(last),
            friction=float(2.0 * (last / scene.reference_velocity) ** 2),
            viscosity=scene.viscosity,
            c_mu=self._setup.turbulence.c_mu,
            outside=float(shares[outside].sum() / shares.sum()),
            plane=walls.plane,
            roughness=walls.law.roughness,
            reach=walls.depth,
            iteration=self.continued,
            backward=along[names[0]].backward() if scene.gdim == 2 else (),
            along={name: self._told(one) for name, one in along.items()} if scene.gdim == 2 else {},
        )

    def _told(self, along: AlongWall) -> dict[str, list[float]]:
        """What is drawn of a wall, in six digits."""
        scene = self._scene
        governing, found, _, x = self._shear_velocities(along)
        friction = 2.0 * np.sign(along.velocities[:, 0]) * (found / scene.reference_velocity) ** 2
        columns = {
            "x": x,
            "y_plus": governing * self._walls.distance / scene.viscosity,
            "friction": friction,
        }
        return {name: [float(f"{one:.6g}") for one in values] for name, values in columns.items()}

    def _shear_velocities(self, along: AlongWall) -> tuple[np.ndarray, ...]:
        """The governing u* at nodes (n,) of a wall, u* of the wall's stress, lengths or areas, and x."""
        law, away = self._walls.law, (self._scene.viscosity, self._walls.distance)
        flow = np.maximum(along.speeds, 1e-300), along.shear_velocities
        stress = law.drag(*flow, *away) * along.speeds
        return law.governing(*flow, *away), np.sqrt(stress), along.lengths, along.places[:, 0]
