"""The pressure on what no flow reaches of a grain: next to its contacts, where the space is closed."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx.fem import assemble_scalar

from .. import compat
from ..arrays import Floats, quarter_turned, spatial
from ..fluid import Fluid
from ..geometry.plane.closing import Closing


class EnclosedPressure:
    """The pressure below a resting grain of one fluid. Every method is collective.

    Up to the first contact it is that at the line that closes the space there, beyond the last one likewise. What is
    enclosed between two contacts leaks through both alike: its pressure is halfway between, with more contacts in equal
    steps from one to the other.

    Args:
        names: of the boundaries on the left and on the right line.
    """

    def __init__(self, fluid: Fluid, closing: Closing, names: tuple[str, str]):
        self._closing, self._comm = closing, fluid.domain.comm
        _, pressure = ufl.split(fluid.state)
        self._means = [
            compat.form(pressure / closing.width * fluid.domain.measure(name)) for name in names
        ]

    def load(self, about: Floats) -> tuple[Floats, Floats]:
        """Force and torque (3,) about a point (3,)."""
        low, high = self._ends()
        contacts = self._closing.contacts
        places = np.vstack([self._closing.left.end, contacts, self._closing.right.end])
        return load_of(places - about[:2], np.linspace(low, high, len(contacts) + 1))

    def unknown(self, about: Floats) -> tuple[Floats, Floats]:
        """Change of force and torque (3,) if the pressure between contacts equals that on either side of them."""
        low, high = self._ends()
        contacts = self._closing.contacts
        force, torque = load_of(
            contacts - about[:2], np.full(len(contacts) - 1, 0.5 * (high - low))
        )
        return np.abs(force), np.abs(torque)

    def _ends(self) -> tuple[float, float]:
        """The pressures at the left and at the right line."""
        low, high = (float(self._comm.allreduce(assemble_scalar(one))) for one in self._means)
        return low, high


def load_of(arms: Floats, pressures: Floats) -> tuple[Floats, Floats]:
    """Force and torque (3,) of pressures (k,) between places (k + 1, 2) of an outline, counter-clockwise.

    The force of a uniform pressure on a piece of any shape is that on its chord; the torque about the origin is half
    the pressure times the difference of the squares of its ends' distances from there. Not collective.
    """
    force = (pressures[:, None] * quarter_turned(np.diff(arms, axis=0))).sum(axis=0)
    torque = 0.5 * float(pressures @ np.diff((arms**2).sum(axis=1)))
    return spatial(force), np.array([0.0, 0.0, torque])
