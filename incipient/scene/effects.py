"""Which effects a scene asks for: left to the plan, forced on, or forced off."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from .section import Section, contradiction


def one_of_three(value: Any) -> Any:
    """Refuses in one line what is neither "auto" nor a truth value."""
    if value == "auto" or isinstance(value, bool):
        return value
    raise contradiction(f"is {value!r}".replace("'", '"'), 'use "auto", true or false')


Choice = Annotated[Literal["auto", True, False], BeforeValidator(one_of_three)]


class Effects(Section):
    """Effects to simulate: by default the plan decides from the scene and its dimensionless numbers."""

    inertia: Choice = Field("auto", description="Convection; auto: where it matters for the accuracy asked")
    unsteadiness: Choice = Field("auto", description="Rate of change; false with [time]: quasi-steady flow")
    gravity: Choice = Field("auto", description="Weight and buoyancy; auto: with [gravity]")
    contact: Choice = Field(
        "auto", description="Contact forces and verdict; auto: where a grain rests on a bed"
    )
    moving_mesh: Choice = Field(
        "auto", description="A mesh that follows grain and surface; auto: with body.motion or a free surface"
    )
    free_body: Choice = Field("auto", description="A grain moved by flow and weight; auto: with body.motion")
    free_surface: Choice = Field(
        "auto", description='A top that moves with the fluid; auto: with domain.top = "free-surface"'
    )
    turbulence: Choice = Field(
        "auto",
        description="The k-epsilon model of [turbulence]; auto: none; the plan warns of flows that may be turbulent",
    )
    third_dimension: Choice = Field("auto", description="Flow in space; auto: with domain.width")


def section_of(value: Any) -> Any:
    """The section that `effects = "auto"` stands for; anything else as it is."""
    return {} if value == "auto" else value
