"""Pressure in the closed interstices at a grain's contacts, which the flow does not reach."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx.fem import assemble_scalar

from .. import compat
from ..arrays import Floats, quarter_turned, spatial
from ..fluid import Fluid
from ..geometry.plane.closing import Closing


class EnclosedPressure:
    """Pressure below a resting grain, left of the first and right of the last contact that at the
    closing line. Collective.

    In between it varies in equal steps, since contacts leak alike. `names`: boundaries of the left
    and right line.
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
        """Change of force and torque (3,) if the pressure between contacts equals that on either side."""
        low, high = self._ends()
        contacts = self._closing.contacts
        force, torque = load_of(
            contacts - about[:2], np.full(len(contacts) - 1, 0.5 * (high - low))
        )
        return np.abs(force), np.abs(torque)

    def _ends(self) -> tuple[float, float]:
        """Pressures at the left and right lines."""
        low, high = (float(self._comm.allreduce(assemble_scalar(one))) for one in self._means)
        return low, high


def load_of(arms: Floats, pressures: Floats) -> tuple[Floats, Floats]:
    """Force and torque (3,) about the origin of pressures (k,) between counter-clockwise outline points (k + 1, 2).

    A uniform pressure acts on a piece as on its chord, with the torque p/2 times the difference of
    the squared distances of its ends. Not collective.
    """
    force = (pressures[:, None] * quarter_turned(np.diff(arms, axis=0))).sum(axis=0)
    torque = 0.5 * float(pressures @ np.diff((arms**2).sum(axis=1)))
    return spatial(force), np.array([0.0, 0.0, torque])
