"""Mass and moments of inertia of the grain of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from .grains import BodySection

if TYPE_CHECKING:
    from ..contact.verdict import MassAndInertia


def mean_density(body: BodySection) -> float | None:
    """Density relative to the fluid; None without a density or mass."""
    return body.density if body.mass is None else body.mass / body.grain.volume


def mass(body: BodySection) -> float | None:
    """Mass (fluid density 1), in 2-D per unit depth; None without a density or mass."""
    if body.mass is not None:
        return body.mass
    return None if body.density is None else body.density * body.grain.volume


def inertia_tensor(body: BodySection) -> Floats | None:
    """Inertia (3, 3) about the centroid in the body frame: given, or of a uniform grain; None without a mass.

    In 2-D the polar moment per unit depth fills the diagonal.
    """
    density = mean_density(body)
    if density is None:
        return None
    if body.inertia is not None:
        return np.asarray(np.diag(body.inertia * np.ones(3)))
    tensor = density * np.asarray(body.grain.inertia)
    return np.asarray(tensor[2, 2] * np.eye(3)) if body.gdim == 2 else tensor


def mass_and_inertia(
    body: BodySection, placement: Placement | None = None
) -> MassAndInertia | None:
    """Mass and inertia (3, 3) about the centre of mass, in 2-D per unit depth; None without either.

    Added mass is omitted: it changes neither equilibrium nor the safety factor.
    """
    heavy, inert = mass(body), inertia_tensor(body)
    if not heavy or inert is None or not inert.any():
        return None
    if body.gdim == 3 and placement is not None:
        inert = placement.rotation @ inert @ placement.rotation.T
    return heavy, inert
