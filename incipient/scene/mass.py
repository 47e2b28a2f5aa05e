"""Mass and moments of the grain of a scene, which have one source."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from .grains import BodySection

if TYPE_CHECKING:
    from ..contact.verdict import MassAndInertia


def mean_density(body: BodySection) -> float | None:
    """Mass over area relative to the fluid's density, None where neither density nor mass is given."""
    return body.density if body.mass is None else body.mass / body.grain().volume


def mass(body: BodySection) -> float | None:
    """Mass (fluid density one), in 2-D per unit depth; None where neither it nor a density is given."""
    if body.mass is not None:
        return body.mass
    return None if body.density is None else body.density * body.grain().volume


def moment(body: BodySection) -> float | None:
    """Moment of inertia about the centroid per unit depth, in 2-D; None without a mass. See `inertia_tensor`."""
    tensor = inertia_tensor(body)
    return None if tensor is None else float(tensor[2, 2])


def inertia_tensor(body: BodySection) -> Floats | None:
    """Inertia (3, 3) about the centroid in the body frame: as given, otherwise of a uniform grain; None without a mass.

    In 2-D, per unit depth, only turns about the third axis matter, and the polar moment stands for all.
    """
    density = mean_density(body)
    if density is None:
        return None
    if body.inertia is not None:
        return np.asarray(np.diag(body.inertia * np.ones(3)))
    tensor = density * np.asarray(body.grain().inertia)
    return np.asarray(tensor[2, 2] * np.eye(3)) if body.gdim == 2 else tensor


def mass_and_inertia(
    body: BodySection, placement: Placement | None = None
) -> MassAndInertia | None:
    """Mass and inertia (3, 3) about the centre of mass of a placed grain, in 2-D per unit depth.

    None for a grain without one of them. The fluid that moves along (added mass) is left out: it changes neither
    rest nor the safety factor.
    """
    heavy, inert = mass(body), inertia_tensor(body)
    if not heavy or inert is None or not inert.any():
        return None
    if body.gdim == 3 and placement is not None:
        inert = placement.rotation @ inert @ placement.rotation.T
    return heavy, inert
