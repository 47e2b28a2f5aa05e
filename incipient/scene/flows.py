"""The section [flow]."""

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
        "Origin of the profile: auto; effective height, crest or mean of the bed; or a height above its "
        "base line [length]",
        "auto",
    )


class Driven(Profile):
    """A flow with a given profile that a gust may multiply."""

    gust: Gust | None = key(
        "Factor on the flow over time",
        None,
        examples=[{"start": 1.0, "duration": 0.5, "strength": 2.0}],
    )


class Shear(Driven):
    """Linear shear flow, u = rate (y - y of the datum); in 3-D with z instead of y."""

    kind: Literal["shear"] = key("Kind of flow", "shear")
    rate: Positive = key("Shear rate [1/time]; V = rate L", 1.0)


class Poiseuille(Driven):
    """Parabolic flow between two walls."""

    kind: Literal["poiseuille"] = key("Kind of flow", "poiseuille")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)


class OpenChannel(Driven):
    """Half of a parabolic flow, without shear at the top."""

    kind: Literal["open-channel"] = key("Kind of flow", "open-channel")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)


class Uniform(Driven):
    """Uniform flow above the datum."""

    kind: Literal["uniform"] = key("Kind of flow", "uniform")
    velocity: Positive = key("Velocity V of the flow [length/time]", 1.0)


class LogLaw(Profile):
    """Logarithmic mean profile of channels, in a flow that is computed as laminar."""

    kind: Literal["log-law"] = key("Kind of flow", "log-law")
    shear_velocity: Positive = key("Shear velocity V = u* = sqrt(tau_b / rho) [length/time]", 1.0)
    roughness: NotNegative = key(
        "Equivalent sand roughness k_s of the bed under the mean profile [length]", 0.0
    )


class Lid(Section):
    """Box with a sliding top."""

    kind: Literal["lid"] = key("Kind of flow", "lid")
    velocity: Positive = key("Velocity V of the lid [length/time]", 1.0)


class ExpressionFlow(Section):
    """Velocity at the inflow and at the top, given by formulas."""

    kind: Literal["expression"] = key("Kind of flow", "expression")
    components: Words = key(
        "Two formulas in x, y and t for the velocity; in 3-D three in x, y, z and t [length/time]"
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
        return any("t" in Expression(text).variables for text in self.components)


class Still(Section):
    """Fluid at rest."""

    kind: Literal["still"] = key("Kind of flow", "still")
    velocity: Positive = key("Velocity V used for scaling only [length/time]", 1.0)


Flow = Annotated[
    Shear | Poiseuille | OpenChannel | Uniform | LogLaw | Lid | ExpressionFlow | Still,
    Field(discriminator="kind"),
]
