"""What the grain of a scene is in 2-D and in 3-D alike: how dense it is, whether it moves, what must fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from ..geometry.placement import Placement
from ..geometry.shape import Shape
from .messages import Problem, problem, refusal, shown
from .section import NotNegative, Section, contradiction, require_formula

# Keys that grains have in 2-D and in 3-D.
Density = Annotated[
    NotNegative | None,
    Field(
        description="Density relative to the fluid [-]; without it or a mass no weight and no verdict",
        examples=[2.65],
    ),
]
Motion = Annotated[
    Literal["fixed", "free", "prescribed", "released"],
    Field(
        description="How the grain moves: not, as flow and weight move it, as `course` says, or from its rest on the "
        "bed as flow, weight and contact move it"
    ),
]
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
SETTLES = (
    'on the bed, by contact.friction; "frictionless": without; "level": as if bed.slope were zero'
)


def _settles(value: Any) -> Any:
    if not isinstance(value, bool) and value not in (FRICTIONLESS, LEVEL):
        raise contradiction(
            f"is {shown(value)}", f'give true, false, "{FRICTIONLESS}" or "{LEVEL}"'
        )
    return value


Settle = Annotated[bool | Literal["frictionless", "level"], BeforeValidator(_settles)]
OnContact = Annotated[
    Literal["stop", "touch"],
    Field(
        description="A grain that moves within contact.gap of a wall ends the run; a free one may touch the bed "
        "and roll, slide or rest on it"
    ),
]


class BodySection(Section):
    """A grain, in 2-D or in 3-D."""

    gdim: ClassVar[int]  # dimension of the space it lives in
    gdims: ClassVar[tuple[int, ...]]

    if TYPE_CHECKING:
        x: float | None
        centre: Any
        density: float | None
        settle: Settle
        motion: str
        mass: float | None
        inertia: Any
        velocity: Any
        spin: Any
        locked: tuple[str, ...]
        course: tuple[str, ...] | None
        on_contact: str

    @field_validator("course", check_fields=False)
    @classmethod
    def _are_formulas_of_time(cls, course: tuple[str, ...] | None) -> tuple[str, ...] | None:
        for text in course or ():
            require_formula(text, "t")
        return course

    @model_validator(mode="after")
    def _moves_consistently(self) -> BodySection:
        if found := [*_missing(self), *_ignored(self), *_of_mass(self)]:
            raise refusal(type(self).__name__, found)
        return self

    @model_validator(mode="after")
    def _placed_once(self) -> BodySection:
        if self.x is None and self.centre is None:
            raise self.refused(
                "x", "neither x nor centre is given", "give x to rest on the bed, or centre"
            )
        if self.x is not None and self.centre is not None:
            raise self.refused("x", "both x and centre are given", "leave one out")
        if self.settle and self.x is None:
            why = "a grain held at its centre does not settle"
            raise self.refused("settle", why, "give x instead of centre, or leave settle out")
        return self

    @property
    def moves(self) -> bool:
        """Whether the grain moves while the flow is computed."""
        return self.motion != "fixed"

    @property
    def is_free(self) -> bool:
        """Whether flow and weight move the grain, from a place in the flow or from its rest."""
        return self.motion in ("free", "released")

    @property
    def touches(self) -> bool:
        """Whether the grain rolls, slides and rests where it touches the bed, instead of ending the run."""
        return self.motion == "released" or self.on_contact == "touch"

    @property
    def aside(self) -> float | None:
        """The y over which a 3-D grain comes to rest; None: the middle of the width."""
        return None

    def placed(self, centre: Sequence[float]) -> Placement:
        """The grain turned as the scene says, its centroid at a point (gdim,)."""
        raise NotImplementedError

    def grain(self) -> Any:
        """The grain's shape in its body frame, lengths in scene units: a Grain of the plane, or a Solid."""
        return self._grain

    @cached_property  # an outline of many points takes time to check
    def _grain(self) -> Shape:
        return self.new_grain()

    def new_grain(self) -> Shape:
        """A new grain of this shape."""
        raise NotImplementedError


def _missing(body: BodySection) -> Iterator[Problem]:
    if body.motion == "prescribed" and body.course is None:
        yield problem(
            "course", "is missing though the motion is prescribed", "add it, or hold the grain"
        )
    if body.motion in ("free", "prescribed") and body.centre is None:
        why = "a moving grain starts away from the bed"
        yield problem(
            "x",
            why,
            'give centre instead of x, or motion = "released" for one that starts from its rest',
        )
    if body.motion == "released" and body.x is None:
        yield problem(
            "centre", "a released grain starts from its rest on the bed", "give x instead of centre"
        )


def _ignored(body: BodySection) -> Iterator[Problem]:
    for key, motion in READ_ONLY_BY.items():
        if body.motion != motion and getattr(body, key) != type(body).model_fields[key].default:
            why = f'is read only with motion = "{motion}", but the motion is "{body.motion}"'
            yield problem(key, why, f'leave it out, or set motion = "{motion}"')


def _of_mass(body: BodySection) -> Iterator[Problem]:
    if body.density is not None and body.mass is not None:
        yield problem(
            "mass", "is given beside density, from which it follows", "leave one of them out"
        )
    if body.density is not None or body.mass is not None:
        return
    if body.is_free:
        why = f"a {body.motion} grain needs a mass and a moment of inertia, which may be zero"
        yield problem("density", why, "give density, or mass and inertia")
    elif body.inertia is not None:
        yield problem(
            "inertia", "is given without a mass", "give density or mass as well, or leave it out"
        )
