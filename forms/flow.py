"""The residual of the flow, composed of the terms that the plan calls for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import ufl

from . import terms
from .kinematics import ReferenceMap, surface_vector, volume_before


@dataclass(frozen=True)
class Unknowns:
    """Velocity and pressure v, p, their test functions w, q, and the map of the reference domain."""

    v: Any
    p: Any
    w: Any
    q: Any
    reference_map: ReferenceMap


class FlowTerm:
    """One term of the residual: an integrand over cells, integrals over boundaries, or both."""

    def in_cells(self, of: Unknowns) -> Any:
        """The integrand over cells; None: there is none."""
        return None

    def on_boundary(self, of: Unknowns) -> Any:
        """The integrals over boundaries; None: there are none."""
        return None


@dataclass(frozen=True)
class Stress(FlowTerm):
    """Viscous stress and pressure, with the continuity of the flow.

    viscosity: kinematic, any expression, such as 1/Re
    """

    viscosity: Any

    def in_cells(self, of: Unknowns) -> Any:
        """P : grad w, and continuity."""
        force = terms.internal_force(of.v, of.p, of.w, self.viscosity, of.reference_map)
        return force + terms.continuity(of.v, of.q, of.reference_map)


@dataclass(frozen=True)
class RateOfChange(FlowTerm):
    """The rate of change of momentum; `rate`: dv/dt at fixed X as an expression in the unknown velocity."""

    rate: Any

    def in_cells(self, of: Unknowns) -> Any:
        """J dv/dt . w."""
        return terms.inertia(self.rate, of.w, of.reference_map)


@dataclass(frozen=True)
class Convection(FlowTerm):
    """Convection of momentum.

    carrier:  velocity that convects, less that of the mesh where the mesh itself has been moved
    boundary: measure of the whole boundary for the energy-stable form; None: as printed
    """

    carrier: Any
    boundary: Any = None

    def in_cells(self, of: Unknowns) -> Any:
        """The form as printed, or the skew one, which is written for a renewed reference."""
        if self.boundary is None:
            return terms.convection(of.v, self.carrier, of.w, of.reference_map)
        return terms.skew_convection(of.v, self.carrier, of.w)

    def on_boundary(self, of: Unknowns) -> Any:
        """What the skew form lacks where fluid crosses the boundary."""
        if self.boundary is None:
            return None
        n = ufl.FacetNormal(of.w.ufl_domain())
        return terms.through_boundary(of.v, self.carrier, of.w, n) * self.boundary


@dataclass(frozen=True)
class GradDiv(FlowTerm):
    """`terms.grad_div`; `cell_size`: size of a cell over the order of the velocity."""

    carrier: Any
    viscosity: Any
    cell_size: Any

    def in_cells(self, of: Unknowns) -> Any:
        """J gamma div(v) div(w)."""
        return terms.grad_div(
            of.v, self.carrier, of.w, self.viscosity, self.cell_size, of.reference_map
        )


@dataclass(frozen=True)
class StreamlineUpwind(FlowTerm):
    """`terms.streamline_upwind` of the residual of momentum; rate and body force are None where there are none.

    along:   velocity along which it acts
    viscous: whether the residual has its viscous part, for which the viscosity is constant
    """

    carrier: Any
    along: Any
    viscosity: Any
    cell_size: Any
    viscous: bool = True
    rate: Any = None
    body_force: Any = None

    def in_cells(self, of: Unknowns) -> Any:
        """J delta r . (c . grad w)."""
        x = of.reference_map
        viscosity = self.viscosity if self.viscous else None
        strong = terms.momentum(of.v, of.p, self.carrier, viscosity, self.rate, self.body_force, x)
        return terms.streamline_upwind(strong, self.along, of.w, self.viscosity, self.cell_size, x)


@dataclass(frozen=True)
class BodyForce(FlowTerm):
    """A force per unit mass that is not the gradient of a potential (gravity is absorbed in the pressure)."""

    force: Any

    def in_cells(self, of: Unknowns) -> Any:
        """-J b . w."""
        return terms.body_force(self.force, of.w, of.reference_map)


@dataclass(frozen=True)
class OpenBoundary(FlowTerm):
    """A boundary through which fluid leaves freely; `measure` is its.

    carrier: velocity that carries momentum, where the momentum of returning fluid is prescribed; None: it is free
    stream:  velocity whose momentum the backflow carries; None: it carries none
    """

    viscosity: Any
    measure: Any
    carrier: Any = None
    stream: Any = None

    def on_boundary(self, of: Unknowns) -> Any:
        """`terms.open_boundary`, and `terms.entering_boundary`."""
        n = ufl.FacetNormal(of.w.ufl_domain())
        found = terms.open_boundary(of.v, of.w, n, self.viscosity, of.reference_map)
        if self.carrier is not None:
            brought = of.v if self.stream is None else of.v - self.stream
            found += terms.entering_boundary(
                brought, self.carrier, of.w, surface_vector(n, of.reference_map)
            )
        return found * self.measure


@dataclass(frozen=True)
class BoundaryLoad(FlowTerm):
    """The load of a boundary, which brings its integral, a function of w and q: a free surface, walls with friction."""

    load: Callable[[Any, Any], Any]

    def on_boundary(self, of: Unknowns) -> Any:
        """The integral."""
        return self.load(of.w, of.q)


def residual(of: Unknowns, present: Iterable[FlowTerm], dx: Any) -> Any:
    """Weak residual of momentum and continuity, (338) and (339): the sum of the terms present over the measure dx."""
    present = tuple(present)
    cells = [found for term in present if (found := term.in_cells(of)) is not None]
    boundaries = [found for term in present if (found := term.on_boundary(of)) is not None]
    return reduce(add, boundaries, reduce(add, cells) * dx)


def vorticity(v: Any) -> Any:
    """curl v: a scalar in two dimensions, a vector in three."""
    return ufl.curl(v) if len(v) == 3 else v[1].dx(0) - v[0].dx(1)


def energy_stable_rate(coefficients: Any, velocities: Any, shifts: Any) -> Any:
    """Rate of change J dv/dt + (1/2) dJ/dt v on a mesh that has moved, for the energy-stable form.

    With J_k the volumes of the past states (see `volume_before`; one where there are no shifts) and a_k the
    coefficients of the backward difference it is sum a_k J_k v_k - (1/2) (sum a_k J_k) v. To first order it is
    J_1 (v - v_1)/dt + (1/2) (1 - J_1)/dt v.
    """
    volumes = [1, *(volume_before(shift) for shift in shifts)] if shifts else [1] * len(velocities)
    terms_of_sum = list(zip(coefficients, volumes, velocities, strict=True))
    return (
        sum(a * J * u for a, J, u in terms_of_sum)
        - sum(a * J for a, J, _ in terms_of_sum) / 2 * velocities[0]
    )
