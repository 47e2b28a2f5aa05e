"""Tanks with a free surface, and the exact normal modes of a viscous layer with a free-slip bottom and walls."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.coupled.coupling import Coupling
from incipient.coupled.surface import SurfacePart
from incipient.fluid import FlowModel, Fluid, Slip, no_slip
from incipient.fluid.conditions import Condition, FreeSurface
from incipient.fluid.derived import kinetic_energy
from incipient.fluid.transient import Transient
from incipient.mesh.domain import Domain
from incipient.mesh.elevation import RisingDisplacement
from incipient.mesh.motion import MeshMotion


@dataclass(frozen=True)
class Mode:
    """exp(s t) cos k x on a layer of depth one, with gravity g, fluid density one.

    v is the sum of grad(phi) and curl(psi), phi = A cosh(k y) cos(k x), psi = B sinh(m y)/sinh(m) sin(k x),
    m^2 = k^2 + s/nu, y counted from the bottom: Lamb (1932), Hydrodynamics, section 349, for a finite depth.
    """

    nu: float
    k: float
    g: float = 1.0

    @property
    def s(self) -> complex:
        """The root of (s + 2 nu k^2)^2 + w^2 = 4 nu^2 k^3 m coth(m) tanh(k), w^2 = g k tanh(k)."""
        nu, k, T = self.nu, self.k, np.tanh(self.k)
        square = self.g * k * T
        s = -2.0 * nu * k**2 + 1j * np.sqrt(square)
        for _ in range(200):  # a fixed point, which contracts for small nu
            m = np.sqrt(k**2 + s / nu)
            s = -2.0 * nu * k**2 + 1j * np.sqrt(square - 4.0 * nu**2 * k**3 * m * T / np.tanh(m))
        return complex(s)

    @property
    def period(self) -> float:
        """Of the oscillation."""
        return 2.0 * np.pi / self.s.imag

    def velocity(self, x: Floats, y: Floats) -> tuple[Any, Any]:
        """Complex amplitudes of the velocity, along k over sin(k x) or its gradient, and upwards, for elevation one."""
        nu, k, s = self.nu, self.k, self.s
        m = np.sqrt(k**2 + s / nu)
        rows = [[-2 * k**2 * np.sinh(k), m**2 + k**2], [k * np.sinh(k), -k]]
        a, b = np.linalg.solve(np.array(rows), np.array([0.0, s]))
        up, down, whole = np.exp(m * (y - 1)), np.exp(-m * (y + 1)), 1.0 - np.exp(-2 * m)
        along = -a * k * np.cosh(k * y) + b * m * (up + down) / whole
        upwards = a * k * np.sinh(k * y) - b * k * (up - down) / whole
        return along, upwards


def prosperetti(times: Floats, viscosity: float, k: float, g: float = 1.0) -> Floats:
    """The elevation over its first one of a deep layer released from rest (Prosperetti 1981, Phys. Fluids 24, 1217)."""
    from scipy.special import wofz

    n, square = viscosity * k**2, g * k
    roots = np.roots([1.0, 0.0, 2 * n, 4 * n**1.5, n**2 + square])

    def scaled(x: Any) -> Any:
        """exp(x^2) erfc(x)."""
        return wofz(1j * x)

    total = 4 * n**2 / (8 * n**2 + square) * scaled(np.sqrt(n * times)) * np.exp(-n * times)
    for i, one in enumerate(roots):
        others = np.prod(np.delete(roots, i) - one)
        total = total + one / others * square / (one**2 - n) * scaled(
            one * np.sqrt(times)
        ) * np.exp(-n * times)
    return np.real(total)


class Tank:
    """A box with a free surface on top, free-slip elsewhere, and its integration in time.

    If `pinned` the fluid sticks to the sides left and right, where the elevation stays.
    """

    def __init__(
        self,
        domain: Domain,
        viscosity: float,
        elevation: Callable[[Floats], Floats],
        order: int = 2,
        scheme: int = 2,
        gravity: tuple[float, ...] = (0.0, -1.0),
        kind: type[Fluid] = Fluid,
        tolerance: float = 1e-10,
        interface: float | None = None,
        pinned: bool = False,
        solver: str = "direct",
    ):
        gdim = domain.gdim
        ends = ("left", "right")
        # As `domains.SIDES` names them: in 3-D bottom and top are at least and largest y.
        others = {2: {"bottom": 1}, 3: {"bottom": 1, "top": 1, "front": 2}}[gdim]
        walls: list[Condition] = [no_slip(name) if pinned else Slip(name, 0) for name in ends]
        walls += [Slip(name, axis) for name, axis in others.items()]
        self.boundary = "top" if gdim == 2 else "back"
        held = ("bottom",) if gdim == 2 else ("front",)
        origin = tuple(1.0 for _ in range(gdim))
        stays = ends if pinned else ()
        surface = FreeSurface(self.boundary, gravity, origin, pinned=stays)
        model = FlowModel(order=order, unsteady=True, moving_mesh=True, solver=solver)
        self.fluid = kind(domain, model, [surface, *walls], 1.0 / viscosity)
        load = self.fluid.surface
        rising = RisingDisplacement(domain, load.space, self.boundary, held, stays)
        self.nodes = rising.nodes
        self.points = load.space.tabulate_dof_coordinates()[rising.nodes].copy()
        first, depths = np.zeros((2, len(load.known.x.array)))
        first[rising.nodes], depths[rising.nodes] = elevation(self.points), 1.0
        motion = MeshMotion(domain)
        self.surface = SurfacePart(self.fluid, rising, first, depths)
        self.coupling = Coupling(self.fluid, [self.surface], motion, interface)
        self.fluid.move_mesh(self.coupling.places[0])
        self.transient = Transient(self.fluid, scheme, tolerance, None, self.coupling)

    def flow(self, velocity: Callable[[Floats], Floats]) -> None:
        """Give the fluid velocities (n, gdim) at its nodes (n, 3)."""
        space = self.fluid.space
        values = velocity(space.velocity_points())
        self.fluid.state.x.array[space.velocity_map.reshape(-1, space.gdim)] = values

    def elevation(self) -> Floats:
        """At the surface's nodes."""
        return self.surface.past[0][self.nodes]

    def energy(self) -> float:
        """Kinetic and potential."""
        return kinetic_energy(self.fluid) + self.surface.energy()


@contextmanager
def tank(*given: Any, **options: Any) -> Any:
    """A tank, freed at the end."""
    made = Tank(*given, **options)
    try:
        yield made
    finally:
        made.fluid.destroy()
