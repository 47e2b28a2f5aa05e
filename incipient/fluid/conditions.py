"""Boundary conditions of the flow, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Velocity = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Prescribed:
    """Velocity given on a boundary: a function of x (3, n) and t that returns (gdim, n)."""

    boundary: str
    velocity: Velocity


@dataclass(frozen=True)
class Slip:
    """No flow through a boundary whose normal is a coordinate axis, and no shear on it."""

    boundary: str
    axis: int


@dataclass(frozen=True)
class Friction:
    """A boundary along which a flow is resisted by a wall a distance beyond it, by a law; nothing crosses it.

    distance: of the wall
    drag:     friction over the velocity: a function of the speed, of the shear velocity that k there
              stands for, of 1/Re and of the distance (UFL)
    axis:     that of the normal of a plane boundary, which the mesh really has at that distance from the wall; None: a
              boundary of any shape, at the wall itself, where the distance is one of the law's alone
    moves:    whether the wall, of any shape, moves as a rigid body: `friction.WallLoad.carry` sets its velocity
    """

    boundary: str
    distance: float
    drag: Callable[[Any, Any, Any, Any], Any]
    axis: int | None = None
    moves: bool = False


@dataclass(frozen=True)
class Open:
    """A boundary through which fluid leaves freely: -p n + nu dv/dn = 0.

    velocity: of the flow whose momentum returning fluid brings, as that of `Prescribed`; None: its own
    """

    boundary: str
    velocity: Velocity | None = None


@dataclass(frozen=True)
class IncomingWave:
    """A wave that comes in at an end with the base flow.

    velocity:  of both, a function of x (3, n), places as they are, and t that returns (gdim, n)
    elevation: a function of x (3, n), of which only places along the level matter, and t that returns (n,)
    """

    velocity: Velocity
    elevation: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Entering:
    """An end below a free surface through which fluid enters, or leaves, at a given rate (see `constraints.Entry`).

    axis:     that of its normal
    velocity: along the axis; a function of x (3, n), places as the mesh was made, and t that returns (n,)
    level:    length of the zone next to the end in which the surface is made level
    given:    whether the level there is the still one: for flows faster than long waves
    wave:     what of `velocity` is a wave, which also has a velocity across and an elevation; None: there is none
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
    """A zone before the end of a channel in which the flow is relaxed to the base flow, so that waves die out there.

    start: x at which it begins
    end: x of the end of the channel
    rate: at the end; it grows as the square of the distance from the start
    base_flow: velocity (gdim, n) at places x (3, n) and time t, here zero
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
    pressure: of what is above, over the fluid's density: a function of x (3, n) and t that returns (n,); None: zero
    pinned:   names of the boundaries at which its elevation stays; the fluid sticks to them
    sponge:   zone at the end of a channel in which waves die out; None: there is none
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
