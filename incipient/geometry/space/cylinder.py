"""A round cylinder across the flow that reaches from one side of its domain to the other."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.geometry.shape import require_positive
from incipient.geometry.space.solid import Core, Solid
from incipient.geometry.space.surfaces import Surface

ACROSS = np.array([1.0, 0.0, 1.0])  # the directions normal to the axis


@dataclass(frozen=True)
class Cylinder(Solid):
    """The tube of a diameter and a length about the second axis, without ends: these lie in the sides of a domain."""

    spans_width = True
    diameter: float
    length: float

    def __post_init__(self) -> None:
        require_positive("diameter", self.diameter)
        require_positive("length", self.length)

    @property
    def size(self) -> float:
        """The diameter: the extent across the flow."""
        return self.diameter

    @property
    def volume(self) -> float:
        """pi d^2 l / 4."""
        return 0.25 * pi * self.diameter**2 * self.length

    @property
    def inertia(self) -> Floats:
        """V d^2 / 8 about the axis, V (d^2/16 + l^2/12) across it."""
        across = self.diameter**2 / 16.0 + self.length**2 / 12.0
        return np.asarray(self.volume * np.diag([across, self.diameter**2 / 8.0, across]))

    @property
    def cores(self) -> tuple[Core, ...]:
        """The axis."""
        ends = np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]) * self.length
        return (Core(ends, np.array([[0, 1, 1]]), 0.5 * self.diameter),)

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 3) from the tube, taken to be endless."""
        return np.asarray(np.linalg.norm(rows(x) * ACROSS, axis=1) - 0.5 * self.diameter)

    def normal(self, x: ArrayLike) -> Floats:
        """Away from the axis, (n, 3)."""
        return unit(rows(x) * ACROSS)

    def surface(self, spacing: float) -> Surface:
        """A grid around the tube and along it, its quadrangles cut in two."""
        around = max(8, int(np.ceil(pi * self.diameter / spacing)))
        along = max(2, int(np.ceil(self.length / spacing)))
        angle = 2.0 * pi * np.arange(around) / around
        place = 0.5 * self.length * np.linspace(-1.0, 1.0, along + 1)
        circle = 0.5 * self.diameter * np.column_stack([np.cos(angle), np.sin(angle)])
        x, z = (np.tile(column, along + 1) for column in circle.T)
        number = np.arange(around * (along + 1)).reshape(along + 1, around)
        a, b = number[:-1], np.roll(number[:-1], -1, axis=1)
        c, d = number[1:], np.roll(number[1:], -1, axis=1)
        corners = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, c, b), (b, c, d))]
        return Surface(np.column_stack([x, np.repeat(place, around), z]), np.vstack(corners))
