"""The k-omega SST model of turbulence in the logarithms K = ln k and W = ln omega, as weak forms.

Each equation is that of k or omega over k or omega itself:

    dK/dt + v . grad K = div(D_k grad K) + D_k |grad K|^2 + P/k - beta* omega,
    dW/dt + v . grad W = div(D_w grad W) + D_w |grad W|^2 + gamma S^2/omega - beta omega
                         + 2 (1 - F_1) sigma_w2 (k/omega) grad K . grad W

with nu_t = k/max(omega, S F_2/a_1), S^2 = 2 D : D, P = min(nu_t S^2, 10 beta* k omega). Next to a smooth wall, where
only molecules matter, omega = 6 nu/(beta_1 y^2) and k goes as y^n, n (n - 1) = 6 beta*/beta_1. Sources: Menter (1994),
AIAA J. 32, 1598; constants and S instead of the vorticity: Menter, Kuntz & Langtry (2003), Turbulence, Heat and Mass
Transfer 4, 625; logarithms: Ilinca & Pelletier (1998), Int. J. Thermal Sciences 38, 560.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import ufl

from .turbulence import MOST_PRODUCED, Stream

BETA_STAR, A_1, SIGMA_CROSS = 0.09, 0.31, 0.856
# Constants of the inner model, next to walls, and of the outer one: sigma_k, sigma_omega, beta, gamma.
INNER, OUTER = (0.85, 0.5, 0.075, 5.0 / 9.0), (1.0, SIGMA_CROSS, 0.0828, 0.44)
EXPONENT = 0.5 + math.sqrt(
    0.25 + 6.0 * BETA_STAR / INNER[2]
)  # n of k = c y^n next to a smooth wall
LARGEST_ARGUMENT = 5.0  # of a blending function, from which on it is one to round-off
LEAST_CROSS = 1e-10  # of d^2 grad K . grad W, as a divisor
LEAST_SHARE = 1e-6  # of k in what its unknown holds, as a divisor
LEAST_RATE = 1e-30  # of S^2, so that its root has a derivative
SMOOTHEST_SAND = 4.0  # u* k_s/nu below which a rough wall is as at this one, nearly smooth
LITTLE_K = (
    0.01  # k over u*^2, which is added at rough walls: it does nothing there, and keeps ln k finite
)
ROOTS = 4  # of a quadratic equation, to u* on a rough wall
UFL = SimpleNamespace(exp=ufl.exp, tanh=ufl.tanh, log=ufl.ln, sqrt=ufl.sqrt, larger=ufl.max_value)


@dataclass(frozen=True)
class Closure:
    """The model with its constants.

    distance: of a place from the next wall (UFL), above zero
    least:    k at which no more of it is destroyed: far below any that matters
    added:    what K holds beside k, K = ln(k + added), so that it has no fronts where k vanishes; terms are those of k
    """

    distance: Any
    least: Any = 0
    added: Any = None

    def eddy_viscosity(self, logarithms: Any, stream: Stream) -> Any:
        """nu_t = k/max(omega, S F_2/a_1)."""
        return self.energy(logarithms[0]) * self._time(logarithms, stream)

    def diffusivities(self, logarithms: Any, stream: Stream) -> tuple[Any, Any]:
        """Diffusivities of k and of omega, molecules and eddies together."""
        eddies, inner = (
            self.eddy_viscosity(logarithms, stream),
            self.inner_share(logarithms, stream.viscosity),
        )
        sigma_k, sigma_omega = (_mixed(inner, i) for i in (0, 1))
        return stream.viscosity + sigma_k * eddies, stream.viscosity + sigma_omega * eddies

    def sources(self, logarithms: Any, stream: Stream) -> tuple[Any, Any]:
        """What makes k and omega less what destroys them, over k and omega."""
        omega, square = ufl.exp(logarithms[1]), _square(stream.velocity)
        inner = self.inner_share(logarithms, stream.viscosity)
        made = ufl.min_value(
            square * self._time(logarithms, stream), MOST_PRODUCED * BETA_STAR * omega
        )
        made *= self._share(logarithms[0], 0.0)
        along = ufl.inner(ufl.grad(logarithms[0]), ufl.grad(logarithms[1]))
        cross = 2 * (1 - inner) * SIGMA_CROSS * ufl.exp(logarithms[0] - logarithms[1]) * along
        kept = self.least if self.added is None else self.added
        lost = BETA_STAR * omega * (1 - kept * ufl.exp(-logarithms[0]))
        return made - lost, _mixed(inner, 3) * square / omega - _mixed(inner, 2) * omega + cross

    def _time(self, logarithms: Any, stream: Stream) -> Any:
        """nu_t/k."""
        strain = ufl.sqrt(_square(stream.velocity) + LEAST_RATE)
        return 1 / ufl.max_value(
            ufl.exp(logarithms[1]), strain * self.limited_share(logarithms, stream.viscosity) / A_1
        )

    def inner_share(self, logarithms: Any, viscosity: Any) -> Any:
        """F_1: one next to walls, where the inner model holds, zero away from them."""
        k, w = logarithms
        d = self.distance
        cross = ufl.max_value(d**2 * ufl.inner(ufl.grad(k), ufl.grad(w)), LEAST_CROSS)
        cross /= self._share(k, LEAST_SHARE)
        found = ufl.min_value(
            ufl.max_value(self._turbulent(k, w), self._viscous(w, viscosity)), 2 / cross
        )
        return ufl.tanh(ufl.min_value(found, LARGEST_ARGUMENT) ** 4)

    def limited_share(self, logarithms: Any, viscosity: Any) -> Any:
        """F_2: one in boundary layers, where the shear stress is at most a_1 k."""
        k, w = logarithms
        found = ufl.max_value(2 * self._turbulent(k, w), self._viscous(w, viscosity))
        return ufl.tanh(ufl.min_value(found, LARGEST_ARGUMENT) ** 2)

    def _turbulent(self, k: Any, w: Any) -> Any:
        """sqrt(k)/(beta* omega d)."""
        root = ufl.exp(k / 2) if self.added is None else ufl.sqrt(self.energy(k) + LEAST_RATE)
        return root * ufl.exp(-w) / (BETA_STAR * self.distance)

    def energy(self, logarithm: Any) -> Any:
        """k by its unknown."""
        k = ufl.exp(logarithm)
        return k if self.added is None else ufl.max_value(k - self.added, 0)

    def _share(self, logarithm: Any, least: float) -> Any:
        """The share of k in what its unknown holds, not below a least one."""
        return (
            1 if self.added is None else ufl.max_value(1 - self.added * ufl.exp(-logarithm), least)
        )

    def _viscous(self, w: Any, viscosity: Any) -> Any:
        """500 nu/(d^2 omega)."""
        return 500 * viscosity * ufl.exp(-w) / self.distance**2


def from_wall(logarithms: Any, test: Any, normal: Any, stream: Stream, closure: Closure) -> Any:
    """-D_k (n/d) grad d . n b: flux of K through facets next to a wall, k going as the n-th power of the distance."""
    diffusivity = closure.diffusivities(logarithms, stream)[0]
    if closure.added is not None:
        diffusivity *= 1 - closure.added * ufl.exp(-logarithms[0])
    return (
        -diffusivity
        * EXPONENT
        / closure.distance
        * ufl.dot(ufl.grad(closure.distance), normal)
        * test
    )


def at_smooth_wall(viscosity: float, distance: Any, functions: Any) -> Any:
    """ln(6 nu/(beta_1 d^2)), which is ln omega next to a smooth wall, by the functions of numpy or of UFL."""
    return functions.log(6 * viscosity / INNER[2] / distance**2)


@dataclass(frozen=True)
class RoughWall:
    """Walls of an equivalent sand roughness, in UFL.

    normal: out of the fluid; penalty: of weak values, one over a length of the cell
    calm:   shear stress that is always there, where the flow separates; little: k that is added
    """

    roughness: Any
    normal: Any
    penalty: Any
    calm: Any
    little: Any


def on_rough_wall(logarithms: Any, tests: Any, wall: RoughWall, stream: Stream) -> Any:
    """Both equations' terms on rough walls: weakly what `at_rough_wall` says (Nitsche 1971).

    u* is that of the shear stress on the wall, by the slope of the velocity and the eddy viscosity that goes with u*.
    """
    slope = ufl.dot(ufl.grad(stream.velocity), wall.normal)
    along = slope - ufl.dot(slope, wall.normal) * wall.normal
    calm = wall.calm / stream.viscosity
    found = shear_velocity_at(
        ufl.sqrt(ufl.inner(along, along) + calm**2), wall.roughness, stream.viscosity
    )
    k, omega = at_rough_wall(wall.roughness * found / stream.viscosity)
    given = ufl.ln(k * found**2 + wall.little), ufl.ln(omega * stream.viscosity / wall.roughness**2)
    # Those of the values given, which do not change with what they are to bring about.
    eddies = ufl.exp(given[0] - given[1])
    form = 0
    for one, value, test, sigma in zip(logarithms, given, tests, INNER, strict=False):
        away = wall.penalty * (one - value) - ufl.dot(ufl.grad(one), wall.normal)
        form += (stream.viscosity + sigma * eddies) * away * test
    return form


def little_k(sand: float) -> float:
    """k over u*^2 that is added at rough walls where u* k_s/nu is typical: less where they are smooth."""
    return LITTLE_K * min(1.0, sand / SMOOTHEST_SAND) ** 2


def shear_velocity_at(slope: Any, roughness: Any, viscosity: Any, functions: Any = UFL) -> Any:
    """u* on a rough wall where the velocity has a slope: u*^2 = (nu + k/omega) dU/dy, k and omega by u*."""
    found = functions.sqrt(viscosity * slope)
    for _ in range(ROOTS):
        # The eddy viscosity grows about as u*, which leaves a quadratic equation.
        sand = roughness * found / viscosity
        k, omega = at_rough_wall(sand, functions)
        half = 0.5 * k * sand / omega * roughness * slope
        found = half + functions.sqrt(half**2 + viscosity * slope)
    return found


def at_rough_wall(sand: Any, functions: Any = UFL) -> tuple[Any, Any]:
    """k over u*^2, and omega over nu/k_s^2, at a wall of the equivalent sand roughness k_s.

    By them the logarithmic layer is shifted as Nikuradse measured: Aupoix (2015), J. Fluids Eng. 137, 021202, the
    pair for his law.

    Args:
        sand: roughness Reynolds number u* k_s/nu.
        functions: `exp`, `tanh`, `log`, `sqrt`, `larger` for what it is: UFL, or numbers and arrays.
    """
    s, tanh = functions.larger(sand, SMOOTHEST_SAND), functions.tanh
    rise = functions.log(s / 30) / math.log(8.0) + 0.5 * (1 - tanh(s / 100))
    k = functions.larger(tanh(rise * tanh(s / 75)) / math.sqrt(BETA_STAR), 0.0)
    omega = 4e5 / (s**4 * tanh(1e4 / (3 * s**3))) + 70 / s * (1 - functions.exp(-s / 300))
    return k, s**2 * omega


def _square(velocity: Any) -> Any:
    """S^2 = 2 D : D."""
    strain = ufl.sym(ufl.grad(velocity))
    return 2 * ufl.inner(strain, strain)


def _mixed(inner: Any, number: int) -> Any:
    """A constant of both models by its number, blended."""
    return inner * INNER[number] + (1 - inner) * OUTER[number]
