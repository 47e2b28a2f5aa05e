"""Terms of walls with a law of the wall."""

from __future__ import annotations

from typing import Any

import ufl

SLOWEST = 1e-12  # speed at which friction still has a derivative


def speed(v: Any) -> Any:
    """|v|, with a derivative where the fluid is at rest."""
    return ufl.sqrt(ufl.inner(v, v) + SLOWEST**2)


def friction(v: Any, w: Any, drag: Any) -> Any:
    """c v . w: the shear stress of a wall, c times the velocity along it."""
    return drag * ufl.inner(v, w)


def layer(p: Any, rate: Any, w: Any, distance: Any) -> Any:
    """y (dv/dt + grad p) . w: the layer between the boundary and a wall y beyond accelerates as its edge does.

    `rate` stands for dv/dt; None in a steady flow.
    """
    pushed = ufl.grad(p) if rate is None else ufl.grad(p) + rate
    return distance * ufl.inner(pushed, w)
