"""Transport of turbulence in logarithms, as weak forms, and the k-epsilon model in K = ln k and E = ln epsilon.

A model is a closure (`KEpsilon`; `k_omega_sst.KOmegaSST`). With k = exp(K) and epsilon = exp(E) both are positive on
any mesh and at any step, and the logarithmic layer, where epsilon falls as 1/y, is smooth in E. Each equation is that
of k or epsilon over k or epsilon itself:

    dK/dt + v . grad K = div(D_k grad K) + D_k |grad K|^2 + P/k - epsilon/k,
    dE/dt + v . grad E = div(D_e grad E) + D_e |grad E|^2 + C_1 P/k - C_2 epsilon/k

with D_k = nu + nu_t/sigma_k, D_e = nu + nu_t/sigma_e, nu_t = C_mu k^2/epsilon. Sources: Launder & Spalding (1974),
Comput. Methods Appl. Mech. Engrg. 3, 269; logarithms: Ilinca & Pelletier (1998), Int. J. Thermal Sciences 38, 560.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import ufl

from .terms import streamline_time

# Largest production of k over its dissipation (Menter 1994, AIAA J. 32, 1598: 20 in omega's terms; 10 since 2003): near
# a stagnation point the model makes far too much. In homogeneous shear it is 2.1, in a channel 1.
MOST_PRODUCED = 10.0

# Steps in time for which upwinding acts at most. With 4 and 16 one of a thousand random steps fails, without a bound
# six of a thousand random states have no step; 64 and 200 have neither (tests/unit/test_turbulence.py, slow).
LONGEST_UPWINDING = 100


@dataclass(frozen=True)
class FlowFields:
    """Velocity, viscosity and other fields that transport and produce turbulence.

    size:  that of a cell over the order of the elements, for upwinding along streamlines; None: without
    known: logarithms of an earlier state, whose eddies decide on upwinding, outside of Newton's method
    added: (2,) further production of both quantities, over these quantities themselves
    carrier: the velocity less that of the mesh, if moved; None: the velocity
    reach: function of a direction: a cell's size along it over the order of the elements; upwinding then follows
        v - 2 D grad K, the carrier of a change of a logarithm, which next to walls is not v; None: along v
    balanced: whether upwinding is limited to the time in which sources change a quantity by its own size: where
        omega of a start is a millionth of its production, upwinding otherwise disturbs other nodes
    weighted: whether the equation of k is that of k itself, in which D |grad K|^2 is part of its diffusion; as a
        source it grows with the square of a peak of ln k, which diffusion lowers linearly: on coarse cells k of single
        nodes became a hundred times the square of the velocity
    per_step: factor of the newest state in its rate, about one over the time step; 0 in a steady flow
    """

    velocity: Any
    viscosity: Any
    measure: Any
    size: Any = None
    known: Any = None
    added: Any = (0, 0)
    carrier: Any = None
    per_step: Any = 0
    reach: Any = None
    balanced: bool = False
    weighted: bool = False


@dataclass(frozen=True)
class KEpsilon:
    """The k-epsilon model.

    second: name of the second quantity; eddies: ln nu_t = eddies . (1, K, E)
    """

    c_mu: float = 0.09
    c_1: float = 1.44
    c_2: float = 1.92
    sigma_k: float = 1.0
    sigma_epsilon: float = 1.3
    second = "epsilon"

    @property
    def eddies(self) -> tuple[float, float, float]:
        return math.log(self.c_mu), 2.0, -1.0

    def eddy_viscosity(self, logarithms: Any, flow: FlowFields) -> Any:
        return unlimited(logarithms, self)

    def diffusivities(self, logarithms: Any, flow: FlowFields) -> tuple[Any, Any]:
        """Molecular plus turbulent diffusivities of k and epsilon."""
        eddies = unlimited(logarithms, self)
        return (
            flow.viscosity + eddies / self.sigma_k,
            flow.viscosity + eddies / self.sigma_epsilon,
        )

    def sources(self, logarithms: Any, flow: FlowFields) -> tuple[Any, Any]:
        """Production less destruction of k and epsilon, over k and epsilon."""
        strain, lost = ufl.sym(ufl.grad(flow.velocity)), ufl.exp(logarithms[1] - logarithms[0])
        produced = (
            self.c_mu * ufl.exp(logarithms[0] - logarithms[1]) * 2 * ufl.inner(strain, strain)
        )
        produced = ufl.min_value(produced, MOST_PRODUCED * lost)
        return produced - lost, self.c_1 * produced - self.c_2 * lost

    def powers_at_wall(self, eddies: Any) -> tuple[Any, Any]:
        """Powers of the distance from a wall of k and epsilon: those of a logarithmic layer."""
        return 0, -1


def unlimited(logarithms: Any, closure: Any) -> Any:
    """nu_t of both quantities, where no strain limits it."""
    constant, of_k, of_second = closure.eddies
    return ufl.exp(constant + of_k * logarithms[0] + of_second * logarithms[1])


def residual(logarithms: Any, rate: Any, tests: Any, flow: FlowFields, closure: Any) -> Any:
    """Weak residual of both equations; `rate` (2,) is the time derivative, None in a steady flow.

    On a moving mesh it is that at its nodes. The form conserves nothing itself, but uniform values stay so on any mesh.
    The closure has the methods of `KEpsilon`. The natural condition is no diffusive flux; see `at_walls` for epsilon.
    """
    carrier = flow.velocity if flow.carrier is None else flow.carrier
    diffusivities, sources = (
        closure.diffusivities(logarithms, flow),
        closure.sources(logarithms, flow),
    )
    known = None if flow.size is None else closure.diffusivities(flow.known, flow)
    form = 0
    for i, diffusivity in enumerate(diffusivities):
        test, slope = tests[i], ufl.grad(logarithms[i])
        weight, square = weights(logarithms, flow)[i], diffusivity * ufl.inner(slope, slope)
        strong = ufl.dot(carrier, slope) - (square + sources[i] + flow.added[i])
        if rate is not None:
            strong += rate[i]
        tested = strong + square if flow.weighted and i == 0 else strong
        diffused = diffusivity * ufl.inner(slope, ufl.grad(test))
        form += weight * (tested * test + diffused) * flow.measure
        if known is not None:
            along, size = carrier, flow.size
            if flow.reach is not None:
                along = carrier - 2 * known[i] * ufl.grad(flow.known[i])
                size, strong = flow.reach(along), strong - diffusivity * ufl.div(slope)
            delta = streamline_time(along, known[i], size)
            if flow.balanced:
                delta /= ufl.max_value(1, delta * abs(closure.sources(flow.known, flow)[i]))
            # Much longer than a step in time the rate would weigh more along the flow than by itself.
            delta /= ufl.max_value(1, flow.per_step * delta / LONGEST_UPWINDING)
            form += weight * delta * strong * ufl.dot(along, ufl.grad(test)) * flow.measure
    return form


def weights(logarithms: Any, flow: FlowFields) -> tuple[Any, Any]:
    """Factors of both equations: k and one, or one each."""
    return ufl.exp(logarithms[0]) if flow.weighted else 1, 1


def at_walls(logarithms: Any, tests: Any, distance: Any, flow: FlowFields, closure: Any) -> Any:
    """-D p/y b: the fluxes of both logarithms where a wall is a distance y beyond the boundary, for any y.

    Each quantity is a power p of the distance: in a logarithmic layer k is constant, epsilon and omega go as 1/y
    (Kuzmin, Mierka & Turek 2007, Int. J. Computing Science and Mathematics 1, 193); in the viscous sublayer and the
    buffer layer powers are those of the closure, by nu_t/nu.
    """
    eddies = unlimited(logarithms, closure)
    powers, diffusivities = (
        closure.powers_at_wall(eddies / flow.viscosity),
        closure.diffusivities(logarithms, flow),
    )
    fluxes = zip(weights(logarithms, flow), diffusivities, powers, tests, strict=True)
    return sum(
        weight * diffusivity * power / distance * test
        for weight, diffusivity, power, test in fluxes
    )


def shear_velocity(logarithms: Any, closure: Any) -> Any:
    """C_mu^(1/4) sqrt(k): u* of a logarithmic layer with this k."""
    return closure.c_mu**0.25 * ufl.exp(logarithms[0] / 2)
