"""Flows chosen first, with the body force that makes them solutions, and the errors against them.

A flow is written once, for UFL and for numpy: `velocity(x, t, m)` and `pressure(x, t, m)` take the place in
space, the time and the module of elementary functions `m` (`ufl` or `numpy`), and return components.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import dolfinx
import numpy as np
import ufl
from domains import SIDES, integral

from incipient import compat
from incipient.fluid import FlowModel, Fluid, Open, Prescribed
from incipient.mesh.domain import Domain

Components = Callable[[Any, Any, Any], Sequence[Any]]


@dataclass(frozen=True)
class Flow:
    """A solenoidal velocity and a pressure, functions of place and time."""

    gdim: int
    velocity: Components
    pressure: Callable[[Any, Any, Any], Any]

    def body_force(self, reynolds: float) -> Callable[[Any, Any], Any]:
        """dv/dt + grad(v) v - div sigma of (338) with F = I, differentiated with respect to the place in space."""

        def force(place: Any, time: Any) -> Any:
            x, t = ufl.variable(place), ufl.variable(time)
            v = ufl.as_vector(list(self.velocity(x, t, ufl)))
            gradient = ufl.diff(v, x)
            stress = (gradient + gradient.T) / reynolds - self.pressure(x, t, ufl) * ufl.Identity(
                self.gdim
            )
            i, j = ufl.indices(2)
            divergence = ufl.as_vector(ufl.diff(stress, x)[i, j, j], i)
            return ufl.diff(v, t) + ufl.dot(gradient, v) - divergence

        return force


@dataclass(frozen=True)
class Motion:
    """A map x = X + d(X, t) of the unit box."""

    displacement: Components

    def place(self, x: np.ndarray, t: float) -> np.ndarray:
        """Places (3, n) in space of reference points (3, n)."""
        d = [np.broadcast_to(part, x.shape[1:]) for part in self.displacement(x, t, np)]
        return x + np.vstack([*d, np.zeros((3 - len(d), *x.shape[1:]))])


def fluid_of(
    flow: Flow, domain: Domain, model: FlowModel, reynolds: float, open_side: str | None = None
) -> Fluid:
    """The flow's velocity prescribed on all sides but an open one, and its body force."""

    def boundary_velocity(x: np.ndarray, time: float) -> np.ndarray:
        return interpolated(flow.velocity, x, time)

    model = replace(model, body_force=flow.body_force(reynolds))
    names = [name for name in SIDES[: 2 * flow.gdim] if name != open_side]
    free = [] if open_side is None else [Open(open_side)]
    conditions = [*free, *(Prescribed(name, boundary_velocity) for name in names)]
    return Fluid(domain, model, conditions, reynolds)


def start_from(fluid: Fluid, flow: Flow) -> None:
    """Put the exact flow at the fluid's time into its state."""
    for part, field in ((0, flow.velocity), (1, lambda x, t, m: [flow.pressure(x, t, m)])):
        target = fluid.state.sub(part)
        target.interpolate(lambda x, field=field: interpolated(field, x, fluid.time))
    fluid.state.x.scatter_forward()


def interpolated(field: Components, x: np.ndarray, t: float) -> np.ndarray:
    """Components (n components, n points), also of constant ones."""
    return np.vstack([np.broadcast_to(part, x.shape[1:]) for part in field(x, t, np)])


@dataclass(frozen=True)
class Errors:
    """L2 norms of the errors; the pressure is compared up to a constant."""

    velocity: float
    pressure: float


def errors(fluid: Fluid, flow: Flow) -> Errors:
    """Errors of the fluid's state."""
    v, p = ufl.split(fluid.state)
    x, t = fluid.place(), fluid._time
    dx = ufl.Measure(
        "dx", domain=fluid.domain.mesh, metadata={"quadrature_degree": 2 * fluid.model.order + 3}
    )

    dv = v - ufl.as_vector(list(flow.velocity(x, t, ufl)))
    dp = p - flow.pressure(x, t, ufl)
    one = dolfinx.fem.Constant(fluid.domain.mesh, 1.0)
    mean, volume = (integral(fluid.domain, of * dx) for of in (dp, one))
    away = dp - dolfinx.fem.Constant(fluid.domain.mesh, mean / volume)
    squares = (ufl.inner(dv, dv), away**2)
    return Errors(*(np.sqrt(integral(fluid.domain, of * dx)) for of in squares))


def errors_with_eddies(fluid: Fluid, fields: Any, flow: Any) -> list[float]:
    """L2 norms of errors in the plane: of velocity, pressure, and both logarithms of a turbulence model."""
    of_flow, exact = errors(fluid, flow), flow.logarithms(fluid.place(), fluid._time, ufl)
    measure = ufl.dx(domain=fluid.domain.mesh, metadata={"quadrature_degree": 8})
    forms_of = [(fields.state[i] - exact[i]) ** 2 * measure for i in (0, 1)]
    result = [np.sqrt(dolfinx.fem.assemble_scalar(compat.form(one)).real) for one in forms_of]
    return [of_flow.velocity, of_flow.pressure, *result]


def bubble(x: Any, t: Any, m: Any) -> Any:
    """A polynomial in the unit box that is the same at the sides at any time."""
    return 0.5 + 8 * m.sin(2 * t) * x[0] * (1 - x[0]) * x[1] * (1 - x[1])


def orders(sizes: Sequence[float], result: Sequence[float]) -> np.ndarray:
    """Observed orders between neighbouring levels of a size (of cells or steps)."""
    return np.diff(np.log(result)) / np.diff(np.log(sizes))
