"""Transport of turbulence in logarithms, as weak forms, and the k-epsilon model in K = ln k and E = ln epsilon.

A model is a closure: it says what diffuses, makes and destroys both quantities (`Closure`; `k_omega_sst.Closure`).
With k = exp(K) and epsilon = exp(E) both are positive on any mesh and at any step, and the logarithmic layer, where
epsilon falls as 1/y, is smooth in E. Each equation is that of k or epsilon over k or epsilon itself:

    dK/dt + v . grad K = div(D_k grad K) + D_k |grad K|^2 + P/k - epsilon/k,
    dE/dt + v . grad E = div(D_e grad E) + D_e |grad E|^2 + C_1 P/k - C_2 epsilon/k

with D_k = nu + nu_t/sigma_k, D_e = nu + nu_t/sigma_e, nu_t = C_mu k^2/epsilon. Sources: Launder & Spalding (1974),
Comput. Methods Appl. Mech. Engrg. 3, 269; logarithms: Ilinca & Pelletier (1998), Int. J. Thermal Sciences 38, 560.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

from .terms import streamline_time

# Largest production of k over its dissipation (Menter 1994, AIAA J. 32, 1598: 20 in omega's terms; 10 since 2003): near
# a stagnation point the model makes far too much. In homogeneous shear it is 2.1, in a channel 1.
MOST_PRODUCED = 10.0

# Steps in time for which upwinding acts at most. With 4 and 16 one of a thousand random steps fails, without a bound
# six of a thousand random states have no step; 64 and 200 have neither (tests/unit/test_turbulence*.py, slow).
LONGEST_UPWINDING = 100

# Change of ln k from node to node from which on D |grad K|^2 grows no more, where k may have peaks. Smooth fields do
# not feel it: where the change is half as large the term is 0.1% less.
STEEPEST = 3.0


@dataclass(frozen=True)
class Stream:
    """What carries and makes the turbulence: the velocity, viscosity of the molecules, and measure of the cells.

    size:  that of a cell over the order of the elements, for upwinding along streamlines; None: without
    known: logarithms of an earlier state, whose eddies decide on upwinding: it then is no matter of Newton's method
    added: (2,) what else makes both quantities, over these quantities themselves
    carrier: the velocity less that of the mesh, where that is moved; None: the velocity
    reach: function of a direction that is a cell's size along it over the order of the elements; upwinding is
        then along what carries a change of a logarithm, v - 2 D grad K, which next to walls is not v; None: along v
    across: function of a slope that is the square of the change from node to node; where that of ln k is large, D
        |grad K|^2 is bounded; None: nowhere
    slopes: whether what is upwinded has the slope of the diffusivity, with `reach`; in long cells that matters
    balanced: whether upwinding lasts no longer than what is made or destroyed takes to change a quantity by its own
        size: where omega of a start is a millionth of what the strain makes, upwinding of that source else throws
        other nodes about
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
    slopes: bool = False
    across: Any = None
    balanced: bool = False


@dataclass(frozen=True)
class Closure:
    """The constants of the k-epsilon model, and the most that P/epsilon may be; numbers or UFL constants."""

    c_mu: Any = 0.09
    c_1: Any = 1.44
    c_2: Any = 1.92
    sigma_k: Any = 1.0
    sigma_epsilon: Any = 1.3
    most_produced: Any = MOST_PRODUCED

    def eddy_viscosity(self, logarithms: Any, stream: Stream) -> Any:
        """nu_t = C_mu k^2/epsilon."""
        return eddy_viscosity(logarithms, self)

    def diffusivities(self, logarithms: Any, stream: Stream) -> tuple[Any, Any]:
        """Diffusivities of k and of epsilon, molecules and eddies together."""
        eddies = eddy_viscosity(logarithms, self)
        return (
            stream.viscosity + eddies / self.sigma_k,
            stream.viscosity + eddies / self.sigma_epsilon,
        )

    def sources(self, logarithms: Any, stream: Stream) -> tuple[Any, Any]:
        """What makes k and epsilon less what destroys them, over k and epsilon."""
        made, lost = (
            rate_of_production(logarithms, stream.velocity, self),
            rate_of_dissipation(logarithms),
        )
        return made - lost, self.c_1 * made - self.c_2 * lost


def eddy_viscosity(logarithms: Any, closure: Closure) -> Any:
    """nu_t = C_mu k^2/epsilon."""
    return closure.c_mu * ufl.exp(2 * logarithms[0] - logarithms[1])


def rate_of_dissipation(logarithms: Any) -> Any:
    """epsilon/k."""
    return ufl.exp(logarithms[1] - logarithms[0])


def rate_of_production(logarithms: Any, velocity: Any, closure: Closure) -> Any:
    """P/k with P = nu_t 2 D : D, at most `most_produced` times epsilon."""
    strain = ufl.sym(ufl.grad(velocity))
    made = closure.c_mu * ufl.exp(logarithms[0] - logarithms[1]) * 2 * ufl.inner(strain, strain)
    return ufl.min_value(made, closure.most_produced * rate_of_dissipation(logarithms))


def residual(logarithms: Any, rate: Any, tests: Any, stream: Stream, closure: Any) -> Any:
    """Weak residual of both equations; `rate` (2,) is the time derivative, None in a steady flow.

    On a mesh that is moved it is that at its nodes. Nothing is conserved by the form itself, each equation being that
    of a quantity over that quantity: what is uniform stays so, whatever the mesh does. The closure has the methods of
    `Closure`.

    Boundaries let nothing of both quantities diffuse through; see `at_wall` for what epsilon does at a wall.
    """
    carrier = stream.velocity if stream.carrier is None else stream.carrier
    diffusivities, sources = (
        closure.diffusivities(logarithms, stream),
        closure.sources(logarithms, stream),
    )
    known = None if stream.size is None else closure.diffusivities(stream.known, stream)
    form = 0
    for i, diffusivity in enumerate(diffusivities):
        one, test = logarithms[i], tests[i]
        slope = ufl.grad(one)
        square = _square(slope, stream.across if i == 0 else None)
        strong = ufl.dot(carrier, slope) - (diffusivity * square + sources[i] + stream.added[i])
        if rate is not None:
            strong += rate[i]
        form += (strong * test + diffusivity * ufl.inner(slope, ufl.grad(test))) * stream.measure
        if known is not None:
            along, size = carrier, stream.size
            if stream.reach is not None:
                along = carrier - 2 * known[i] * ufl.grad(stream.known[i])
                size, strong = stream.reach(along), strong - diffusivity * ufl.div(slope)
                if stream.slopes:
                    strong -= ufl.dot(ufl.grad(known[i]), slope)
            delta = streamline_time(along, known[i], size)
            if stream.balanced:
                delta /= ufl.max_value(1, delta * abs(closure.sources(stream.known, stream)[i]))
            # Much longer than a step in time the rate would weigh more along the flow than by itself.
            delta /= ufl.max_value(1, stream.per_step * delta / LONGEST_UPWINDING)
            form += delta * strong * ufl.dot(along, ufl.grad(test)) * stream.measure
    return form


def _square(slope: Any, across: Any) -> Any:
    """|grad K|^2, bounded where K changes by more than `STEEPEST` from node to node, see `Stream`.

    div(D grad K) lowers a peak at one node in proportion to its height, D |grad K|^2 raises it in proportion to the
    square of that: a peak of ln k higher than about two would grow for ever, which k itself never does. Valleys need
    the whole of it: without, omega of a single node stays too small.
    """
    square = ufl.inner(slope, slope)
    return square if across is None else square / (1 + (across(slope) / STEEPEST**2) ** 4) ** 0.25


def at_wall(logarithms: Any, test: Any, distance: Any, viscosity: Any, closure: Closure) -> Any:
    """-D_e/y b: the flux of E where a wall is a distance y beyond the boundary, epsilon falling as 1/y there.

    Its condition is of Neumann's type, as that of k, which does not change there: Kuzmin, Mierka & Turek (2007),
    Int. J. Computing Science and Mathematics 1, 193.
    """
    return (
        -(viscosity + eddy_viscosity(logarithms, closure) / closure.sigma_epsilon) / distance * test
    )


def shear_velocity(logarithms: Any, closure: Closure) -> Any:
    """C_mu^(1/4) sqrt(k): u* of a logarithmic layer that has this k."""
    return closure.c_mu**0.25 * ufl.exp(logarithms[0] / 2)
