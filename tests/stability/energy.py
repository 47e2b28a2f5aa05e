"""A swirl in a closed box whose mesh jumps about: its energies, for docs/explanation/flow.md.

Six cells a side, every vertex thrown anew in each step within a third of the cells' spacing, the boundary's
along the sides. What the printed form makes of the energy: PYTHONPATH=tests python tests/stability/energy.py
"""

from __future__ import annotations

from itertools import product

import numpy as np
from domains import SIDES, curved_box
from energy_stable import EnergyStable
from moving import Energy, RandomMotion, Swaying

from incipient.fluid import FlowModel, Fluid, no_slip
from incipient.fluid.transient import Transient

CELLS = 6
# Share of the spacing that vertices and mid-side nodes are thrown by; a third is where straight cells nearly fold.
THROWS = {1: (1 / 3, 0.0), 2: (1 / 4, 1 / 20)}


def swirl(x: np.ndarray) -> np.ndarray:
    """From psi = 100 (x (1 - x) y (1 - y))^2 (1 + x): no flow at the walls."""
    f, g = (lambda s: (s * (1 - s)) ** 2), (lambda s: 2 * s * (1 - s) * (1 - 2 * s))
    along, across = f(x[0]) * (1 + x[0]), g(x[0]) * (1 + x[0]) + f(x[0])
    return 100 * np.vstack([along * g(x[1]), -across * f(x[1])])


def thrown(mesh: object, cells: int, geometry_order: int, boundary: str = "slides") -> RandomMotion:
    """The random motion of a box with so many cells a side."""
    vertices, mid_sides = THROWS[geometry_order]
    return RandomMotion(mesh, vertices / cells, mid_sides / cells, boundary)


def energies(
    reynolds: float,
    model: FlowModel,
    order: int,
    step: float,
    count: int,
    geometry_order: int = 1,
    kind: type[Fluid] = EnergyStable,
) -> tuple[np.ndarray, np.ndarray]:
    """(count + 1,) kinetic energies, and (count,) what each step spent of them, were it energy-stable BDF1.

    Of the swirl in the box with walls at rest.
    """
    domain = curved_box(2, CELLS, geometry_order)
    walls = [no_slip(name) for name in SIDES[:4]]
    with kind(domain, model, walls, reynolds) as fluid:
        fluid.state.sub(0).interpolate(swirl)
        motion = thrown(fluid.domain.mesh, CELLS, geometry_order)
        interface = Swaying(fluid, lambda time: motion.places())
        transient, energy = Transient(fluid, order, 1e-12, interface=interface), Energy(fluid)
        kinetic, spent = [energy.kinetic()], []
        for _ in range(count):
            assert not transient.advance(step).rejected
            kinetic.append(energy.kinetic())
            spent.append(energy.spent(step))
    return np.array(kinetic), np.array(spent)


if __name__ == "__main__":
    extrapolated = FlowModel(unsteady=True, convection="extrapolated", moving_mesh=True)
    for scheme, length in product((1, 2), (1e-3, 1e-1, 10.0)):
        result, _ = energies(1e6, extrapolated, scheme, length, 1000, kind=Fluid)
        print(f"BDF{scheme}, steps of {length:g}: {result.max() / result[0]:.3g} times", flush=True)
