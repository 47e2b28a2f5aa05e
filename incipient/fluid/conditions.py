"""Boundary conditions of the flow, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Velocity = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Prescribed:
    """Prescribed velocity on a boundary: a function of x (3, n) and t that returns (gdim, n)."""

    boundary: str
    velocity: Velocity


@dataclass(frozen=True)
class Slip:
    """No flow through a boundary whose normal is a coordinate axis, and no shear on it."""

    boundary: str
    axis: int


@dataclass(frozen=True)
class Friction:
    """An impermeable boundary with the friction of a wall at a distance beyond it, from a law of the wall.

    distance: of the wall
    drag:     friction over the velocity: a function of the speed, of the shear velocity from k there,
              of 1/Re and of the distance (UFL)
    axis:     that of the normal of a plane boundary, which lies at that distance from the wall; None: a boundary
              of any shape at the wall itself, where only the law has the distance
    moves:    whether the wall, of any shape, moves as a rigid body: `friction.WallLoad.carry` sets its velocity
    """

    boundary: str
    distance: float
    drag: Callable[[Any, Any, Any, Any], Any]
    axis: int | None = None
    moves: bool = False


@dataclass(frozen=True)
class Open:
    """An outflow boundary: -p n + nu dv/dn = 0.

    velocity: of backflow, as that of `Prescribed`; None: that of the flow
    """

    boundary: str
    velocity: Velocity | None = None


@dataclass(frozen=True)
class IncomingWave:
    """An incoming wave at an end with the base flow.

    velocity:  of both, a function of present positions x (3, n) and t that returns (gdim, n)
    elevation: a function of x (3, n), of which only horizontal coordinates matter, and t that returns (n,)
    """

    velocity: Velocity
    elevation: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Entering:
    """An end below a free surface with a prescribed discharge, in or out (see `constraints.Entry`).

    axis:     that of its normal
    velocity: along the axis; a function of positions x (3, n) when the mesh was made, and t, that returns (n,)
    level:    length of the zone next to the end in which the surface is made level
    given:    whether the level there is the still level: for supercritical flow
    wave:     the wave in `velocity`, with its velocity across and elevation; None: no wave
    """

    boundary: str
    axis: int
    velocity: Callable[[np.ndarray, float], np.ndarray]
    level: float
    given: bool = False
    wave: IncomingWave | None = None


@dataclass(frozen=True)
class Carried:
    """The surface of a moving body; `Constraints.carry` sets its velocity in every coupling iteration."""

    boundary: str


@dataclass(frozen=True)
class Sponge:
    """A zone before the end of a channel in which the flow is relaxed to the base flow, so that waves decay there.

    start: x at which it begins
    end: x of the end of the channel
    rate: at the end; it grows as the square of the distance from the start
    base_flow: velocity (gdim, n) at positions x (3, n) and time t, here zero
    """

    start: float
    end: float
    rate: float
    base_flow: Velocity


@dataclass(frozen=True)
class FreeSurface:
    """A boundary on top that moves with the fluid and is a graph over the plane; velocities there are free.

    gravity:  acceleration (gdim,); its hydrostatic pressure acts on the surface where this is above the still level
    origin:   a position (gdim,) of the still level, at which the flow's pressure is that above the surface
    pressure: above the surface, over the fluid's density: a function of x (3, n) and t that returns (n,); None: zero
    pinned:   names of the boundaries at which its elevation stays; the fluid sticks to them
    sponge:   zone at the end of a channel in which waves decay; None: there is none
    """

    boundary: str
    gravity: tuple[float, ...]
    origin: tuple[float, ...]
    pressure: Callable[[np.ndarray, float], np.ndarray] | None = None
    pinned: tuple[str, ...] = ()
    sponge: Sponge | None = None


Condition = Prescribed | Slip | Friction | Open | Entering | Carried | FreeSurface


def no_slip(boundary: str) -> Prescribed:
    """A wall at rest."""
    return Prescribed(boundary, lambda x, t: np.zeros_like(x))
