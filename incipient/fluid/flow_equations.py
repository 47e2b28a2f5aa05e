"""Unknowns, parameters and UFL residual of the flow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import forms
from ..arrays import Floats
from ..forms import terms
from ..geometry.placement import Placement
from ..mesh.domain import Domain
from .conditions import Condition
from .constraints import Constraints
from .model import FlowModel
from .space import (
    TaylorHood,
    cell_size,
    geometry_function,
    geometry_rows,
    set_geometry_function,
    taylor_hood,
)


class FlowEquations:
    """Unknowns, parameters and residual of an incompressible flow. Every method is collective.

    Args:
        conditions: where boundaries meet the later one applies.
        reynolds: one over the molecular viscosity, in scene units.
        level: whether to pin an otherwise undetermined pressure.
        coarse: the same flow in lower-order elements.
    """

    def __init__(
        self,
        domain: Domain,
        model: FlowModel,
        conditions: Sequence[Condition],
        reynolds: float,
        level: bool,
        coarse: FlowEquations | None = None,
    ):
        self.domain, self.model, self.conditions = domain, model, tuple(conditions)
        self._below = coarse
        mesh = domain.mesh
        self.reference_map = model.reference_map or forms.ReferenceMap.renewed(domain.gdim)
        self.space: TaylorHood = taylor_hood(mesh, model.order)
        self.constraints = Constraints(domain, self.space, conditions, level=level)
        self.state = dolfinx.fem.Function(self.space.mixed)
        self.history = tuple(
            dolfinx.fem.Function(self.space.mixed) for _ in range(2 * model.unsteady)
        )
        self._reynolds, self._time = self.space.constant(reynolds), self.space.constant(0.0)
        self.rate = tuple(self.space.constant(0.0) for _ in range(3))
        self._acceleration = self.space.constant(0.0)
        self._extrapolation = tuple(self.space.constant(c) for c in (1.0, 0.0))
        self._shifts = tuple(geometry_function(mesh) for _ in range(2 * model.moving_mesh))
        self._rows = geometry_rows(self._shifts[0]) if self._shifts else None
        self.surface, self.walls = self._surface_load(), self._wall_load()
        dofs = self.space.mixed.dofmap
        owned = dofs.index_map.size_local * dofs.index_map_bs
        self._owned_velocities = self.space.velocity_map[self.space.velocity_map < owned]
        self._kept: dict[str, Any] = {}

    def let_in(self, conditions: Sequence[Condition]) -> None:
        self.conditions = tuple(conditions)
        self.constraints.prescribe(conditions)
        if self._below is not None:
            self._below.let_in(conditions)

    def _surface_load(self) -> Any:
        if self.constraints.surface is None:
            return None
        from .surface import SurfaceLoad

        return SurfaceLoad(self.domain, self.space, self.constraints, self.rate[0])

    def _wall_load(self) -> Any:
        if not (walls := self.constraints.friction):
            return None
        from .friction import WallLoad

        viscosities = 1 / self._reynolds, self.viscosity
        return WallLoad(self.domain, self.space, walls, viscosities, self.model.shear_velocity)

    # -- the residual ---------------------------------------------------------------------------

    def residual_form(
        self,
        w: Any,
        q: Any,
        cells: np.ndarray | None = None,
        measure: Any = None,
        upwind: bool = True,
    ) -> Any:
        """UFL residual of the present state, tested with w and q, over all cells, local `cells`, or a measure."""
        flow = (*ufl.split(self.state), w, q)
        return self._integrated(flow, measure or self.quadrature(cells), upwind)

    def pressure_force(self, measure: Any, upwind: bool = True) -> Any:
        """Pressure term of the momentum residual, a bilinear form of both spaces."""
        w, p = ufl.TestFunction(self.space.velocity), ufl.TrialFunction(self.space.pressure)
        flow = (ufl.split(self.state)[0], p, w, ufl.as_ufl(0))
        return ufl.lhs(self._integrated(flow, measure, upwind))

    def quadrature(self, cells: np.ndarray | None = None) -> Any:
        return self.space.quadrature(cells, self.model.polynomial and self.surface is None)

    def kept(self, name: str, make: Callable[[], Any]) -> Any:
        """Cache an object under a name, such as a form that UFL analyses slowly."""
        if name not in self._kept:
            self._kept[name] = make()
        return self._kept[name]

    def _integrated(self, flow: Sequence[Any], dx: Any, upwind: bool) -> Any:
        """Weak residual of momentum and continuity, (338) and (339), of v, p tested with w, q."""
        (v, p, w, q), model, at = flow, self.model, self.reference_map
        viscosity, force = self.viscosity, self._body_force()
        rate, carrier = self._rate_of_change(v), self.carrier(v)
        residual = terms.internal_force(v, p, w, viscosity, at) + terms.continuity(v, q, at)
        if rate is not None:
            residual += terms.inertia(rate, w, at)
        if carrier is not None:
            residual += self._convection(v, carrier, w)
        if model.inertia and model.stabilisation:
            size = cell_size(self.domain.mesh) / model.order
            residual += terms.grad_div(v, carrier, w, viscosity, size, at)
        if model.inertia and model.upwind and upwind:
            # Terms that vanish with the residual double the cost of a Jacobian and do not help Newton updates.
            along = self._frozen_velocity() if model.exact else carrier
            known = None if model.exact or model.viscosity is not None else viscosity
            strong = terms.momentum(v, p, carrier, known, rate, force, at)
            size = self._upwind_size()
            residual += terms.streamline_upwind(strong, along, w, viscosity, size, at)
        if force is not None:
            residual += terms.body_force(force, w, at)
        residual = residual * dx
        if self.constraints.crossings:
            residual += self._at_crossings(v, carrier, w)
        if self.walls is not None:
            residual += self.walls.integral(v, p, rate, w, q)
        return residual if self.surface is None else residual + self.surface.integral(v, carrier, w)

    def _convection(self, v: Any, carrier: Any, w: Any) -> Any:  # tests replace it
        return terms.convection(v, carrier, w, self.reference_map)

    def _at_crossings(self, v: Any, carrier: Any, w: Any) -> Any:
        n, at, backflow = (
            ufl.FacetNormal(self.domain.mesh),
            self.reference_map,
            self.constraints.backflow,
        )
        residual = terms.open_boundary(v, w, n, self.viscosity, at)
        # With this term 2-D flow past a grain on a rough bed does not converge (tests/end_to_end/test_rough_beds.py).
        turbulent_3d = self.domain.gdim == 3 and self.model.viscosity is not None
        if carrier is not None and (turbulent_3d or backflow is not None):
            brought = v if backflow is None else v - backflow
            residual += terms.entering_boundary(brought, carrier, w, forms.surface_vector(n, at))
        return residual * self.domain.measure(*self.constraints.crossings)

    def _body_force(self) -> Any:
        model = self.model
        force = None if model.body_force is None else model.body_force(self.place(), self._time)
        if model.driven is None or not model.unsteady:
            return force
        driving = self._acceleration * model.driven.velocity(self.place())
        return driving if force is None else force + driving

    def _frozen_velocity(self) -> Any:
        return ufl.split(dolfinx.fem.Function(self.state.function_space, self.state.x))[0]

    def _upwind_size(self) -> Any:
        return cell_size(self.domain.mesh) / (self.model.upwind_order or self.model.order)

    def _past(self) -> list[Any]:
        return [ufl.split(h)[0] for h in self.history]

    def _rate_of_change(self, v: Any) -> Any:
        if not self.model.unsteady:
            return None
        velocities = [v, *self._past()]
        return sum(a * u for a, u in zip(self.rate, velocities, strict=True))

    def carrier(self, v: Any) -> Any:
        model = self.model
        carrier = None
        if model.inertia and model.unsteady and model.convection == "extrapolated":
            carrier = sum(e * u for e, u in zip(self._extrapolation, self._past(), strict=True))
        elif model.inertia:
            carrier = v
        if not model.moving_mesh:
            return carrier
        # The same backward difference gives the mesh velocity; past positions are x - shift.
        of_mesh = sum(-a * shift for a, shift in zip(self.rate[1:], self._shifts, strict=True))
        return -of_mesh if carrier is None else carrier - of_mesh

    def place(self) -> Any:
        return ufl.SpatialCoordinate(self.domain.mesh) + self.reference_map.displacement

    # -- parameters -----------------------------------------------------------------------------

    @property
    def reynolds(self) -> float:
        return float(self._reynolds.value)

    @reynolds.setter
    def reynolds(self, value: float) -> None:
        self._reynolds.value = value
        if self._below is not None:
            self._below.reynolds = value

    @property
    def viscosity(self) -> Any:
        of_molecules = 1 / self._reynolds
        return of_molecules if self.model.viscosity is None else self.model.viscosity(of_molecules)

    @property
    def time(self) -> float:
        return float(self._time.value)

    @time.setter
    def time(self, value: float) -> None:
        self._time.value = value

    def discretise_time(self, rate: Sequence[float], extrapolation: Sequence[float]) -> None:
        """Set dv/dt = a0 v + a1 v(n) + a2 v(n-1) and the extrapolation e1 v(n) + e2 v(n-1); zeros: steady."""
        for one, value in zip(
            (*self.rate, *self._extrapolation), (*rate, *extrapolation), strict=True
        ):
            one.value = value

    @property
    def acceleration(self) -> float:
        return float(self._acceleration.value)

    def load_on_displaced(self, placement: Placement) -> Floats:
        """Force and torque (2, 3) of an accelerating base flow on the fluid that a grain displaces."""
        driven = self.model.driven
        if driven is None or driven.displaced is None:
            return np.zeros((2, 3))
        return self.acceleration * driven.displaced(placement)

    def drive(self, *times: float) -> None:
        """Set the rate of the base flow's factor from present and past times, by the backward difference."""
        if (driven := self.model.driven) is not None:
            pairs = zip(self.rate, times, strict=True)
            self._acceleration.value = sum(float(a.value) * driven.factor(t) for a, t in pairs)

    def mesh_moved(self, *past: np.ndarray) -> None:
        """Update for a moved mesh with `past` positions (n, 3), newest first, in `compat.geometry_dofs`'s order.

        Not collective. Give a single past state twice.
        """
        places = self.domain.mesh.geometry.x
        for function, before in zip(self._shifts, past, strict=True):
            set_geometry_function(function, places - before, self._rows)
        self.constraints.boundary_points_moved()

    # -- the state ------------------------------------------------------------------------------

    @property
    def velocity(self) -> Any:
        return self._part(self.space.velocity, self.space.velocity_map, "velocity")

    @property
    def pressure(self) -> Any:
        return self._part(self.space.pressure, self.space.pressure_map, "pressure")

    def _part(self, space: Any, places: np.ndarray, name: str) -> Any:
        part = dolfinx.fem.Function(space, name=name)
        part.x.array[:] = self.state.x.array[places]
        return part

    def interpolate(self, other: FlowEquations) -> None:
        parts = (
            (self.velocity, other.velocity, self.space.velocity_map),
            (self.pressure, other.pressure, self.space.pressure_map),
        )
        for mine, theirs, places in parts:
            mine.interpolate(theirs)
            self.state.x.array[places] = mine.x.array
        self.state.x.scatter_forward()

    def speed(self) -> float:
        return float(
            np.sqrt(self.squared_velocities(self.state.x.array) / self.space.velocity_nodes())
        )

    def squared_velocities(self, values: np.ndarray) -> float:
        mine = values[self._owned_velocities]
        return float(self.domain.comm.allreduce(float(mine @ mine)))
