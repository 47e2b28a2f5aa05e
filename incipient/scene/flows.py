"""The flows of a scene: the kinds of the section [flow]."""

import sys
from typing import Annotated, Literal

from pydantic import Field, field_validator

from .expression import Expression
from .gust import Gust
from .section import (
    NotNegative,
    Positive,
    Section,
    allowed,
    is_number,
    key,
    of_length,
    require_formula,
)

Words = Annotated[
    tuple[str, ...],
    Field(strict=False),
    of_length((2, 3), "give two, as in [x, y]; in 3-D three"),
]
LEVELS = ("auto", "effective", "crest", "mean")
_LEVELS = ", ".join(f'"{level}"' for level in LEVELS)
Datum = Annotated[
    float | Literal["auto", "effective", "crest", "mean"],
    allowed(
        lambda value: value in LEVELS or (is_number(value) and abs(value) <= sys.float_info.max),
        f"use {_LEVELS} or a height above the bed's base line",
    ),
]


class Profile(Section):
    """Common keys of flows with a given profile."""

    datum: Datum = key(
        "Where the profile starts: auto; effective height, crest or mean of the bed; or a height above its "
        "base line [length]",
        "auto",
    )


class Driven(Profile):
    """A flow of a given profile that a gust may multiply."""

    gust: Gust | None = key(
        "A factor that multiplies the flow in time",
        None,
        examples=[{"start": 1.0, "duration": 0.5, "strength": 2.0}],
    )


class Shear(Driven):
    """Linear shear, u = rate (y - y of the datum); in 3-D with z instead of y."""

    kind: Literal["shear"] = key("Kind of flow", "shear")
    rate: Positive = key("Shear rate [1/time]; V = rate L", 1.0)


class Poiseuille(Driven):
    """Parabolic flow between two walls."""

    kind: Literal["poiseuille"] = key("Kind of flow", "poiseuille")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)


class OpenChannel(Driven):
    """Half a parabola, without shear on top."""

    kind: Literal["open-channel"] = key("Kind of flow", "open-channel")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)


class Uniform(Driven):
    """A uniform flow above the datum."""

    kind: Literal["uniform"] = key("Kind of flow", "uniform")
    velocity: Positive = key("Velocity V of the flow [length/time]", 1.0)


class LogLaw(Profile):
    """The logarithmic mean profile of channels, in a flow that is computed as a laminar one."""

    kind: Literal["log-law"] = key("Kind of flow", "log-law")
    shear_velocity: Positive = key(
        "V = u*, the root of the bed's shear stress over the density [length/time]", 1.0
    )
    roughness: NotNegative = key(
        "Equivalent sand roughness k_s of the bed that the mean profile is over [length]", 0.0
    )


class Lid(Section):
    """A box whose top slides."""

    kind: Literal["lid"] = key("Kind of flow", "lid")
    velocity: Positive = key("Velocity V of the lid [length/time]", 1.0)


class ExpressionFlow(Section):
    """A velocity given by formulas, on the inflow and on the top."""

    kind: Literal["expression"] = key("Kind of flow", "expression")
    components: Words = key(
        "Two formulas in x, y and t for the velocity; in 3-D three, in z as well [length/time]"
    )
    velocity: Positive = key("Reference velocity V [length/time]", 1.0)

    @field_validator("components")
    @classmethod
    def _are_formulas(cls, components: tuple[str, ...]) -> tuple[str, ...]:
        for text in components:
            require_formula(
                text, "xyt" if len(components) == 2 else "xyzt", " but the scene is two-dimensional"
            )
        return components

    @property
    def unsteady(self) -> bool:
        """Whether a component depends on time."""
        return any("t" in Expression(text).variables for text in self.components)


class Still(Section):
    """Fluid at rest."""

    kind: Literal["still"] = key("Kind of flow", "still")
    velocity: Positive = key("Velocity V used for scaling only [length/time]", 1.0)


Flow = Annotated[
    Shear | Poiseuille | OpenChannel | Uniform | LogLaw | Lid | ExpressionFlow | Still,
    Field(discriminator="kind"),
]
