"""Which keys of [body] a grain reads that is held, free or follows a course, and its mass, which has one source."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats

if TYPE_CHECKING:
    from .grains import BodySection

# Keys that only a grain with this motion reads.
READ_ONLY_BY = {
    "velocity": "free",
    "spin": "free",
    "locked": "free",
    "on_contact": "free",
    "course": "prescribed",
}


def unfit(body: BodySection) -> Iterator[tuple[str, str, str]]:
    """Keys of a grain that its motion needs and has not, or has and ignores: key, why, remedy."""
    yield from _missing(body)
    yield from _ignored(body)
    yield from _of_mass(body)


def _missing(body: BodySection) -> Iterator[tuple[str, str, str]]:
    if body.motion == "prescribed" and body.course is None:
        yield "course", "is missing though the motion is prescribed", "add it, or hold the grain"
    if body.motion != "fixed" and body.centre is None:
        yield "x", "a moving grain starts away from the bed", "give centre instead of x"


def _ignored(body: BodySection) -> Iterator[tuple[str, str, str]]:
    for key, motion in READ_ONLY_BY.items():
        if body.motion != motion and getattr(body, key) != type(body).model_fields[key].default:
            why = f'is read only with motion = "{motion}", but the motion is "{body.motion}"'
            yield key, why, f'leave it out, or set motion = "{motion}"'


def _of_mass(body: BodySection) -> Iterator[tuple[str, str, str]]:
    if body.density is not None and body.mass is not None:
        yield "mass", "is given beside density, from which it follows", "leave one of them out"
    if body.density is not None or body.mass is not None:
        return
    if body.motion == "free":
        why = "a free grain needs a mass and a moment of inertia, which may be zero"
        yield "density", why, "give density, or mass and inertia"
    elif body.inertia is not None:
        yield "inertia", "is given without a mass", "give density or mass as well, or leave it out"


def mean_density(body: BodySection) -> float | None:
    """Mass over area relative to the fluid's density, None where neither density nor mass is given."""
    return body.density if body.mass is None else body.mass / body.grain().volume


def mass(body: BodySection) -> float | None:
    """Mass (fluid density one), in the plane per unit depth; None where neither it nor a density is given."""
    if body.mass is not None:
        return body.mass
    return None if body.density is None else body.density * body.grain().volume


def moment(body: BodySection) -> float | None:
    """Moment of inertia about the centroid per unit depth, in the plane; None without a mass. See `inertia_tensor`."""
    tensor = inertia_tensor(body)
    return None if tensor is None else float(tensor[2, 2])


def inertia_tensor(body: BodySection) -> Floats | None:
    """Inertia (3, 3) about the centroid in the body frame: as given, else of a uniform grain; None without a mass.

    In the plane, per unit depth, only turns about the third axis matter, and the polar moment stands for all.
    """
    density = mean_density(body)
    if density is None:
        return None
    if body.inertia is not None:
        return np.asarray(np.diag(body.inertia * np.ones(3)))
    tensor = density * np.asarray(body.grain().inertia)
    return np.asarray(tensor[2, 2] * np.eye(3)) if body.gdim == 2 else tensor
