"""Common keys and rules of grains in 2-D and 3-D, their mass and their rest on a bed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..geometry.placement import Placement
from ..geometry.settle import settle
from ..geometry.shape import Shape
from .section import NotNegative, Rule, Section, allowed, formula, key

if TYPE_CHECKING:
    from ..contact.verdict import MassAndInertia

DEFAULT_FRICTION = 1.0  # where the scene has no contact: rough enough for slopes of 45 degrees
FRICTIONLESS = "frictionless"
LEVEL = "level"
# Keys that only a grain with this motion reads.
READ_ONLY_BY = {
    "velocity": "free",
    "spin": "free",
    "locked": "free",
    "on_contact": "free",
    "course": "prescribed",
}
OfTime = Annotated[str, formula("t")]
Settle = Annotated[
    bool | Literal["frictionless", "level"],
    allowed(
        lambda value: isinstance(value, bool) or value in (FRICTIONLESS, LEVEL),
        f'give true, false, "{FRICTIONLESS}" or "{LEVEL}"',
    ),
]


class BodySection(Section):
    """A grain, in 2-D or in 3-D.

    Attributes:
        shape_key: the key that is refused if the grain is not possible.
        made_of: class of the geometry, and the keys that are its arguments; otherwise override `new_grain`.
    """

    gdim: ClassVar[int]
    gdims: ClassVar[tuple[int, ...]]
    shape_key: ClassVar[str] = "shape"
    made_of: ClassVar[tuple[Any, ...]]
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("course", lambda s: s.motion == "prescribed" and s.course is None,
             "is missing though the motion is prescribed", "add it, or set motion = \"fixed\""),
        Rule("x", lambda s: s.motion in ("free", "prescribed") and s.centre is None,
             "a moving grain starts away from the bed",
             'give centre instead of x, or motion = "released" for a grain that starts from rest on the bed'),
        Rule("centre", lambda s: s.motion == "released" and s.x is None,
             "a released grain starts from its rest on the bed", "give x instead of centre"),
        Rule("{v[0]}", lambda s: [(k, m) for k, m in READ_ONLY_BY.items() if s.motion != m and s.changed(k)],
             'is read only with motion = "{v[1]}", but the motion is "{s.motion}"',
             'leave it out, or set motion = "{v[1]}"'),
        Rule("mass", lambda s: s.density is not None and s.mass is not None,
             "is given with density, from which it follows", "leave one of them out"),
        Rule("x", lambda s: s.x is None and s.centre is None,
             "neither x nor centre is given", "give x to rest on the bed, or centre"),
        Rule("x", lambda s: s.x is not None and s.centre is not None, "both x and centre are given", "leave one out"),
        Rule("settle", lambda s: s.settle and s.x is None, "a grain with a given centre does not settle",
             "give x instead of centre, or leave settle out"),
        Rule("{s.shape_key}", lambda s: s.grain is None),  # which its geometry may refuse
    )  # fmt: skip

    x: float | None = key(
        "x of a grain that rests on the bed [length]; give x or centre", None, examples=[4.0]
    )
    density: NotNegative | None = key(
        "Density relative to the fluid [-]; without it or a mass there is no weight and no verdict",
        None,
        examples=[2.65],
    )
    settle: Settle = key(
        "Let the grain roll and tip until it is in equilibrium on the bed, with contact.friction; "
        '"frictionless": without; "level": as if bed.slope were zero',
        False,
    )
    motion: Literal["fixed", "free", "prescribed", "released"] = key(
        "Motion of the grain; free: by flow and weight; prescribed: by `course`; released: from rest on "
        "the bed, by flow, weight and contact",
        "fixed",
    )
    on_contact: Literal["stop", "touch"] = key(
        "stop: the run ends when a moving grain is within contact.gap of a wall; touch: a free grain may "
        "roll, slide or rest on the bed",
        "stop",
    )

    if TYPE_CHECKING:
        centre: Any
        mass: float | None
        inertia: Any

    @property
    def place(self) -> str:
        """The key of the grain's position."""
        return "x" if self.centre is None else "centre"

    @property
    def moves(self) -> bool:
        return self.motion != "fixed"

    @property
    def is_free(self) -> bool:
        return self.motion in ("free", "released")

    @property
    def touches(self) -> bool:
        """Whether contact is simulated; otherwise it ends the run."""
        return self.motion == "released" or self.on_contact == "touch"

    def placed(self, centre: Sequence[float]) -> Placement:
        raise NotImplementedError

    @cached_property  # an outline of many points takes time to check
    def grain(self) -> Any:
        return self.new_grain()

    def new_grain(self) -> Shape:
        shape, *keys = self.made_of
        return shape(*(getattr(self, key) for key in keys))


def mean_density(body: BodySection) -> float | None:
    """Density relative to the fluid; None without a density or mass."""
    return body.density if body.mass is None else body.mass / body.grain.volume


def mass(body: BodySection) -> float | None:
    """Mass (fluid density 1), in 2-D per unit depth; None without a density or mass."""
    density = mean_density(body)
    return None if density is None else density * body.grain.volume


def inertia_tensor(body: BodySection) -> Floats:
    """Inertia (3, 3) about the centroid in the body frame, zero without a mass: given, or of a uniform grain.

    In 2-D the polar moment per unit depth fills the diagonal.
    """
    if body.inertia is not None:
        return np.asarray(np.diag(body.inertia * np.ones(3)))
    tensor = (mean_density(body) or 0.0) * np.asarray(body.grain.inertia)
    return np.asarray(tensor[2, 2] * np.eye(3)) if body.gdim == 2 else tensor


def mass_and_inertia(
    body: BodySection, placement: Placement | None = None
) -> MassAndInertia | None:
    """Mass and inertia (3, 3) about the centre of mass, in 2-D per unit depth; None without either.

    Added mass is omitted: it changes neither equilibrium nor the safety factor.
    """
    heavy, inert = mass(body), inertia_tensor(body)
    if not heavy or not inert.any():
        return None
    if body.gdim == 3 and placement is not None:
        inert = placement.rotation @ inert @ placement.rotation.T
    return heavy, inert


# The placement of a scene is read many times; computing it takes one or two seconds.
@lru_cache(maxsize=16)
def rested(
    grain: Any,
    bed: Any,
    above: Placement,
    down: tuple[float, ...],
    friction: float | None,
    reach: float,
) -> Placement:
    """Equilibrium of a grain released above a placement, in 2-D or in 3-D.

    down: direction of gravity; reach: distance over which the grain may roll. Raises SceneError without a stable rest.
    """
    hold = DEFAULT_FRICTION if friction is None else friction
    start = replace(above, centre=(*above.centre[:-1], bed.crest + grain.size))
    settled = settle(grain, bed, start, down, hold, reach / grain.size)
    if not settled.stable:
        turn = "angle" if above.gdim == 2 else "y or orientation"
        raise SceneError(
            f"the grain {settled.outcome.value}; change x or {turn}, or leave settle out"
        )
    return settled.placement
