"""The flows of a scene: what a user writes about what drives the fluid."""

import sys
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, field_validator

from .expression import Expression
from .gust import Gust
from .messages import counted, shown
from .section import NotNegative, Positive, Section, contradiction, is_number, require_formula


def _components(value: Any) -> Any:
    """Refuse what is neither two nor three formulas."""
    if isinstance(value, list | tuple) and len(value) not in (2, 3):
        raise contradiction(f"has {counted(len(value), 'item')}", "give two, as in [x, y]; in space three")
    return value


Words = Annotated[tuple[str, ...], Field(strict=False), BeforeValidator(_components)]


LEVELS = ("auto", "effective", "crest", "mean")
_LEVELS = ", ".join(f'"{level}"' for level in LEVELS)


class Profile(Section):
    """What flows of a given profile have in common."""

    datum: float | Literal["auto", "effective", "crest", "mean"] = Field(
        "auto",
        description="Where the profile starts: auto; effective height, crest or mean of the bed; or a height above its "
        "base line [length]",
    )

    @field_validator("datum", mode="before")
    @classmethod
    def _is_a_level(cls, value: Any) -> Any:
        if value in LEVELS or (is_number(value) and abs(value) <= sys.float_info.max):
            return value
        raise contradiction(f"is {shown(value)}", f"use {_LEVELS} or a height above the bed's base line")


class Driven(Profile):
    """A flow of a given profile that a gust may multiply."""

    gust: Gust | None = Field(
        None,
        description="A factor that multiplies the flow in time",
        examples=[{"start": 1.0, "duration": 0.5, "strength": 2.0}],
    )


class Shear(Driven):
    """Linear shear, u = rate (y - y of the datum); in space with z in place of y."""

    kind: Literal["shear"] = Field("shear", description="Kind of flow")
    rate: Positive = Field(1.0, description="Shear rate [1/time]; V = rate L")


class Poiseuille(Driven):
    """Parabolic flow between two walls."""

    kind: Literal["poiseuille"] = Field("poiseuille", description="Kind of flow")
    velocity: Positive = Field(1.0, description="Mean velocity V [length/time]")


class OpenChannel(Driven):
    """Half a parabola, without shear on top."""

    kind: Literal["open-channel"] = Field("open-channel", description="Kind of flow")
    velocity: Positive = Field(1.0, description="Mean velocity V [length/time]")


class Uniform(Driven):
    """A uniform flow above the datum."""

    kind: Literal["uniform"] = Field("uniform", description="Kind of flow")
    velocity: Positive = Field(1.0, description="Velocity V of the flow [length/time]")


class LogLaw(Profile):
    """The mean profile of a turbulent flow, in a flow that is computed as a laminar one."""

    kind: Literal["log-law"] = Field("log-law", description="Kind of flow")
    shear_velocity: Positive = Field(
        1.0, description="V = u*, the root of the bed's shear stress over the density [length/time]"
    )
    roughness: NotNegative = Field(
        0.0, description="Equivalent sand roughness k_s of the bed that the mean profile is over [length]"
    )


class Lid(Section):
    """A box whose top slides."""

    kind: Literal["lid"] = Field("lid", description="Kind of flow")
    velocity: Positive = Field(1.0, description="Velocity V of the lid [length/time]")


class ExpressionFlow(Section):
    """A velocity given by formulas, on the inflow and on the top."""

    kind: Literal["expression"] = Field("expression", description="Kind of flow")
    components: Words = Field(
        description="Two formulas in x, y and t for the velocity; in space three, in z as well [length/time]"
    )
    velocity: Positive = Field(1.0, description="Reference velocity V [length/time]")

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

    kind: Literal["still"] = Field("still", description="Kind of flow")
    velocity: Positive = Field(1.0, description="Velocity V used for scaling only [length/time]")


Flow = Annotated[
    Shear | Poiseuille | OpenChannel | Uniform | LogLaw | Lid | ExpressionFlow | Still,
    Field(discriminator="kind"),
]
