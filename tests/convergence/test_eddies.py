"""Orders of convergence of the models of turbulence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import ufl
from domains import SIDES, unit_box
from manufactured import (
    Components,
    Flow,
    bubble,
    errors_with_eddies,
    fluid_of,
    interpolated,
    orders,
    start_from,
)
from moving import Swaying
from turbulent import k_epsilon, k_omega

from incipient.fluid import FlowModel, Fluid
from incipient.fluid.transient import Transient
from incipient.mesh.domain import Domain
from incipient.turbulence.continuation import continued
from incipient.turbulence.fields import TurbulenceFields
from incipient.turbulence.in_time import InTime

# Orders of convergence of flow, k and epsilon together, against solutions chosen first.
#
# Source of the orders: elements of order two approximate velocity, ln k and ln epsilon to order three in L2,
# pressure of order one to order two; backward differences are of order one and two.


CONSTANTS = (0.09, 1.44, 1.92, 1.0, 1.3)
NU, END = 0.01, 0.5


@dataclass(frozen=True)
class Eddying(Flow):
    """A flow in the plane with ln k and ln epsilon."""

    logarithms: Components

    def body_force(self, reynolds: float) -> Any:
        """dv/dt + grad(v) v - div(2 (nu + nu_t) D - p I), a function of place and time."""

        def force(place: Any, time: Any) -> Any:
            x, t = ufl.variable(place), ufl.variable(time)
            v, (k, epsilon) = (
                ufl.as_vector(list(self.velocity(x, t, ufl))),
                self.logarithms(x, t, ufl),
            )
            viscosity = 1 / reynolds + CONSTANTS[0] * ufl.exp(2 * k - epsilon)
            gradient, (i, j) = ufl.diff(v, x), ufl.indices(2)
            stress = viscosity * (gradient + gradient.T) - self.pressure(x, t, ufl) * ufl.Identity(
                2
            )
            return (
                ufl.diff(v, t)
                + ufl.dot(gradient, v)
                - ufl.as_vector(ufl.diff(stress, x)[i, j, j], i)
            )

        return force

    def sources(self, place: Any, time: Any) -> list[Any]:
        """What the equations of k and epsilon (Launder & Spalding 1974) lack, over k and over epsilon."""
        c_mu, c_1, c_2, *sigmas = CONSTANTS
        x, t, i = ufl.variable(place), ufl.variable(time), ufl.indices(1)[0]
        v = ufl.as_vector(list(self.velocity(x, t, ufl)))
        k, epsilon = (ufl.exp(one) for one in self.logarithms(x, t, ufl))
        gradient, eddy = ufl.diff(v, x), c_mu * k**2 / epsilon
        made = eddy * ufl.inner(gradient + gradient.T, gradient)
        found = []
        for one, sigma, of_made, of_lost in ((k, sigmas[0], 1, 1), (epsilon, sigmas[1], c_1, c_2)):
            slope = ufl.diff(one, x)
            spread = ufl.diff((NU + eddy / sigma) * slope, x)[i, i]
            rate = ufl.diff(one, t) + ufl.dot(v, slope)
            found.append((rate - spread) / one - (of_made * made - of_lost * epsilon) / k)
        return found

    def joined(
        self, domain: Domain, model: FlowModel, order: int
    ) -> tuple[Fluid, TurbulenceFields]:
        """Flow and turbulence, exact at time zero, all values given on the sides; the fluid frees both."""
        fields = k_epsilon(
            domain, lambda x: interpolated(self.logarithms, x, 0.0), SIDES[:4], order=order
        )
        fluid = fluid_of(self, domain, replace(model, viscosity=fields.viscosity), 1 / NU)
        fluid.holding(fields)
        start_from(fluid, self)
        fields.carried_by(ufl.split(fluid.state)[0], NU, self.sources(fluid.place(), fluid._time))
        return fluid, fields


# From psi = sin(3 x + 0.3) cos(2 y)/3; eddies three to thirty times as viscous as molecules.
STEADY = Eddying(
    2,
    lambda x, t, m: (
        -2 / 3 * m.sin(3 * x[0] + 0.3) * m.sin(2 * x[1]),
        -m.cos(3 * x[0] + 0.3) * m.cos(2 * x[1]),
    ),
    lambda x, t, m: m.sin(2 * x[0] + x[1]),
    lambda x, t, m: (0.4 * m.sin(3 * x[0] + x[1]), 0.6 * m.cos(x[0] - 3 * x[1])),
)
# Polynomials that the elements hold, with as much viscosity everywhere: only time errs.
IN_TIME = Eddying(
    2,
    lambda x, t, m: (m.sin(2 * t) + x[1] ** 2 * m.cos(2 * t), x[0] ** 2 * m.sin(3 * t)),
    lambda x, t, m: (x[0] - 2 * x[1]) * m.cos(2 * t),
    lambda x, t, m: (bubble(x, t, m), 2 * bubble(x, t, m) - 1),
)


def test_orders_in_space() -> None:
    found, counts = [], [4, 8, 16]
    for cells in counts:
        fluid, fields = STEADY.joined(unit_box(2, cells), FlowModel(), 2)
        with fluid:
            fields.state.x.array[:] *= 0.8
            assert continued(fluid, fields, (1e-8, 1e-8)).converged
            found.append(errors_with_eddies(fluid, fields, STEADY))
    observed = np.array([orders([1 / n for n in counts], column) for column in np.array(found).T])
    print(found[-1], observed)
    # Between 8 and 16 cells a side the next term of the error still makes 0.13 of an order.
    assert observed[:, -1] == pytest.approx([3.0, 2.0, 3.0, 3.0], abs=0.2)


@pytest.mark.parametrize("order", [1, 2])
def test_orders_in_time(order: int) -> None:
    found, counts = [], [16 * order, 32 * order]
    for steps in counts:
        fluid, fields = IN_TIME.joined(unit_box(2, 2), FlowModel(unsteady=True), 4)
        with fluid:
            transient = Transient(fluid, order, 1e-9, interface=InTime(fluid, fields))
            for _ in range(steps):
                transient.advance(END / steps)
            found.append(errors_with_eddies(fluid, fields, IN_TIME))
    observed = np.array(
        [orders([1 / n for n in counts], column)[-1] for column in np.array(found).T]
    )
    print(order, found[-1], observed)
    assert observed == pytest.approx(order, abs=0.1)


# Orders of convergence of flow, k and omega together, against solutions chosen first.
#
# Source of the orders: elements of order two approximate velocity, ln k and ln omega to order three in L2, pressure of
# order one to order two; backward differences are of order one and two.


DISTANCE = 1.0  # taken as that from walls, at which both models are blended
INNER, OUTER = (0.85, 0.5, 0.075, 5 / 9), (1.0, 0.856, 0.0828, 0.44)


@dataclass(frozen=True)
class EddyingToTheWall(Flow):
    """A flow with ln k and ln omega."""

    logarithms: Components

    def _eddies(self, x: Any, t: Any) -> tuple[Any, ...]:
        """v, k, omega, S^2, F_1 and nu_t, as Menter, Kuntz & Langtry (2003) print them."""
        v = ufl.as_vector(list(self.velocity(x, t, ufl)))
        k, omega = (ufl.exp(one) for one in self.logarithms(x, t, ufl))
        gradient = ufl.diff(v, x)
        square = ufl.inner(gradient + gradient.T, gradient)
        turbulent, viscous = (
            ufl.sqrt(k) / (0.09 * omega * DISTANCE),
            500 * NU / (DISTANCE**2 * omega),
        )
        cross = 2 * 0.856 / omega * ufl.inner(ufl.diff(k, x), ufl.diff(omega, x))
        third = 4 * 0.856 * k / (ufl.max_value(cross, 1e-10) * DISTANCE**2)
        inner = ufl.tanh(ufl.min_value(ufl.max_value(turbulent, viscous), third) ** 4)
        limited = ufl.tanh(ufl.max_value(2 * turbulent, viscous) ** 2)
        eddies = 0.31 * k / ufl.max_value(0.31 * omega, ufl.sqrt(square) * limited)
        return v, k, omega, square, inner, eddies

    def body_force(self, reynolds: float) -> Any:
        """dv/dt + grad(v) v - div(2 (nu + nu_t) D - p I), a function of place and time."""

        def force(place: Any, time: Any) -> Any:
            x, t = ufl.variable(place), ufl.variable(time)
            v, *_, eddies = self._eddies(x, t)
            gradient, (i, j) = ufl.diff(v, x), ufl.indices(2)
            stress = (1 / reynolds + eddies) * (gradient + gradient.T) - self.pressure(
                x, t, ufl
            ) * ufl.Identity(self.gdim)
            return (
                ufl.diff(v, t)
                + ufl.dot(gradient, v)
                - ufl.as_vector(ufl.diff(stress, x)[i, j, j], i)
            )

        return force

    def sources(self, place: Any, time: Any) -> list[Any]:
        """What the equations of k and omega lack, over k and over omega."""
        x, t, i = ufl.variable(place), ufl.variable(time), ufl.indices(1)[0]
        v, k, omega, square, inner, eddies = self._eddies(x, t)
        sigma_k, sigma_omega, beta, gamma = (
            inner * a + (1 - inner) * b for a, b in zip(INNER, OUTER, strict=True)
        )
        made = ufl.min_value(eddies * square, 10 * 0.09 * k * omega) - 0.09 * k * omega
        carried = 2 * (1 - inner) * 0.856 / omega * ufl.inner(ufl.diff(k, x), ufl.diff(omega, x))
        found = []
        for one, sigma, source in (
            (k, sigma_k, made),
            (omega, sigma_omega, gamma * square - beta * omega**2 + carried),
        ):
            slope = ufl.diff(one, x)
            spread = ufl.diff((NU + sigma * eddies) * slope, x)[i, i]
            rate = ufl.diff(one, t) + ufl.dot(v, slope)
            found.append((rate - spread - source) / one)
        return found

    def joined(
        self, domain: Domain, model: FlowModel, order: int
    ) -> tuple[Fluid, TurbulenceFields]:
        """Flow and turbulence, exact at time zero, all values given on the sides; the fluid frees both."""
        fields = k_omega(
            domain,
            lambda x: interpolated(self.logarithms, x, 0.0),
            SIDES[:4],
            viscosity=NU,
            order_of_flow=order,
            order=order,
        )
        fields._distance.x.array[:] = DISTANCE
        fluid = fluid_of(self, domain, replace(model, viscosity=fields.viscosity), 1 / NU)
        fluid.holding(fields)
        start_from(fluid, self)
        velocity = ufl.split(fluid.state)[0]
        carrier = fluid.carrier(velocity) if model.moving_mesh else None
        fields.carried_by(velocity, NU, self.sources(fluid.place(), fluid._time), carrier)
        fields.watch(fluid)
        return fluid, fields


# From psi = sin(3 x + 0.3) cos(2 y)/3. omega is so large that F_1 lies between its bounds, and strain limits nowhere.
STEADY_TO_THE_WALL = EddyingToTheWall(
    2,
    lambda x, t, m: (
        -2 / 3 * m.sin(3 * x[0] + 0.3) * m.sin(2 * x[1]),
        -m.cos(3 * x[0] + 0.3) * m.cos(2 * x[1]),
    ),
    lambda x, t, m: m.sin(2 * x[0] + x[1]),
    lambda x, t, m: (0.9 + 0.3 * m.sin(2 * x[0] + x[1]), 3.0 - 0.2 * m.sin(2 * x[0] + x[1])),
)
# Polynomials that the elements hold, with as much viscosity everywhere: only time errs.
IN_TIME_TO_THE_WALL = EddyingToTheWall(
    2,
    lambda x, t, m: (m.sin(2 * t) + x[1] ** 2 * m.cos(2 * t), x[0] ** 2 * m.sin(3 * t)),
    lambda x, t, m: (x[0] - 2 * x[1]) * m.cos(2 * t),
    lambda x, t, m: (bubble(x, t, m) + 1, bubble(x, t, m) + 3),
)


def test_orders_in_space_to_the_wall() -> None:
    found, counts = [], [8, 16, 32]
    for cells in counts:
        fluid, fields = STEADY_TO_THE_WALL.joined(unit_box(2, cells), FlowModel(), 2)
        with fluid:
            fields.state.x.array[:] *= 0.9
            assert continued(fluid, fields, (1e-8, 1e-8)).converged
            found.append(errors_with_eddies(fluid, fields, STEADY_TO_THE_WALL))
    observed = np.array([orders([1 / n for n in counts], column) for column in np.array(found).T])
    print(found[-1], observed)
    assert observed[:, -1] == pytest.approx([3.0, 2.0, 3.0, 3.0], abs=0.2)


def swaying(fluid: Fluid) -> Swaying:
    """The vertex amid the box goes to and fro by a tenth of the box, too slowly for upwinding."""
    made = fluid.domain.mesh.geometry.x.copy()
    amid = np.abs(made[:, : fluid.domain.gdim] - 0.5).max(axis=1) < 0.1

    def places(time: float) -> np.ndarray:
        return made + np.outer(amid, [0.1 * np.sin(4 * time), 0.05 * (np.cos(5 * time) - 1), 0.0])

    return Swaying(fluid, places)


@pytest.mark.parametrize("moving", [False, True], ids=["mesh at rest", "mesh that moves"])
@pytest.mark.parametrize("order", [1, 2])
def test_orders_in_time_to_the_wall(order: int, moving: bool) -> None:
    """On a mesh that moves, too: its straight cells hold the solution wherever they are."""
    found, counts = [], [16 * order, 32 * order]
    for steps in counts:
        fluid, fields = IN_TIME_TO_THE_WALL.joined(
            unit_box(2, 2), FlowModel(unsteady=True, moving_mesh=moving), 4
        )
        with fluid:
            interface = InTime(fluid, fields, moving=swaying(fluid) if moving else None)
            transient = Transient(fluid, order, 1e-9, interface=interface)
            for _ in range(steps):
                transient.advance(END / steps)
            found.append(errors_with_eddies(fluid, fields, IN_TIME_TO_THE_WALL))
    observed = np.array(
        [orders([1 / n for n in counts], column)[-1] for column in np.array(found).T]
    )
    print(order, found[-1], observed)
    assert observed == pytest.approx(order, abs=0.1)
