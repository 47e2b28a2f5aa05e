"""The boundary conditions of a flow. Fluids, and with them the large libraries, are loaded when they are called for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .flow_setup import Setup

if TYPE_CHECKING:
    from ..fluid import Condition


def conditions(
    setup: Setup, held: bool = False, lid: bool = False, speed: float = 1.0
) -> list[Condition]:
    """Boundary conditions in the order in which they override each other: walls last, so corners are watertight.

    With `lid` a rigid lid takes the place of a free surface. With `speed` they are those of a flow faster by that
    factor, in its own units.
    The velocity of a moving grain's surface is given within each step, or is that of time zero if it is `held`.
    """
    if setup.is_averaged:
        from . import wall_conditions

        return wall_conditions.conditions(setup)
    from . import flow_conditions

    return flow_conditions.conditions(setup, held, lid, speed)
