"""Boundary conditions of the flow, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Velocity = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Prescribed:
    """Prescribed velocity (gdim, n), a function of x (3, n) and t."""

    boundary: str
    velocity: Velocity


@dataclass(frozen=True)
class Slip:
    """Impermeable, shear-free boundary normal to a coordinate axis."""

    boundary: str
    axis: int


@dataclass(frozen=True)
class Friction:
    """Impermeable boundary with a law of the wall.

    distance: of the wall beyond the boundary. drag: friction over velocity, of speed, shear velocity from
    k, 1/Re and distance (UFL). axis: normal of a plane boundary at that distance; None: any boundary at the wall
    itself. moves: as a rigid body (`friction.WallLoad.carry`).
    """

    boundary: str
    distance: float
    drag: Callable[[Any, Any, Any, Any], Any]
    axis: int | None = None
    moves: bool = False


@dataclass(frozen=True)
class Open:
    """Outflow boundary, -p n + nu dv/dn = 0.

    velocity: of backflow, as in `Prescribed`; None: that of the flow.
    """

    boundary: str
    velocity: Velocity | None = None


@dataclass(frozen=True)
class IncomingWave:
    """Incoming wave with the base flow: velocity (gdim, n) and elevation (n,), functions of x (3, n) and t."""

    velocity: Velocity
    elevation: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Entering:
    """End below a free surface with prescribed discharge (see `constraints.Entry`).

    velocity: along the normal `axis`, (n,), a function of undeformed positions (3, n) and t. level:
    length of the zone in which the surface is levelled. given: whether the still level is imposed,
    for supercritical flow. wave: part of `velocity`.
    """

    boundary: str
    axis: int
    velocity: Callable[[np.ndarray, float], np.ndarray]
    level: float
    given: bool = False
    wave: IncomingWave | None = None


@dataclass(frozen=True)
class Carried:
    """Surface of a moving body, whose velocity `Constraints.carry` sets."""

    boundary: str


@dataclass(frozen=True)
class Sponge:
    """Zone from `start` to `end` (x) in which the flow relaxes to the base flow.

    rate: at the end, growing quadratically from zero. base_flow: velocity (gdim, n) of x (3, n) and t.
    """

    start: float
    end: float
    rate: float
    base_flow: Velocity


@dataclass(frozen=True)
class FreeSurface:
    """Top boundary that moves with the fluid, a graph over the plane.

    gravity: acceleration (gdim,), whose hydrostatic pressure acts where the surface departs from the still
    level. origin: position (gdim,) of the still level, at which the flow's pressure equals that above the
    surface. pinned: no-slip boundaries at which the elevation is fixed.
    """

    boundary: str
    gravity: tuple[float, ...]
    origin: tuple[float, ...]
    pinned: tuple[str, ...] = ()
    sponge: Sponge | None = None


Condition = Prescribed | Slip | Friction | Open | Entering | Carried | FreeSurface


def no_slip(boundary: str) -> Prescribed:
    """Wall at rest."""
    return Prescribed(boundary, lambda x, t: np.zeros_like(x))
