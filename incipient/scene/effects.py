"""Which effects a scene asks for: left to the plan, forced on, or forced off."""

from typing import Annotated, Any, Literal

from .section import Section, allowed, key

Choice = Annotated[
    Literal["auto", True, False],
    allowed(lambda value: value == "auto" or isinstance(value, bool), 'use "auto", true or false'),
]


class Effects(Section):
    """Effects to simulate: by default the plan decides from the scene and its dimensionless numbers."""

    inertia: Choice = key("Convection; auto: where it matters for the accuracy asked", "auto")
    unsteadiness: Choice = key("Rate of change; false with [time]: quasi-steady flow", "auto")
    gravity: Choice = key("Weight and buoyancy; auto: with [gravity]", "auto")
    contact: Choice = key("Contact forces and verdict; auto: where a grain rests on a bed", "auto")
    moving_mesh: Choice = key(
        "A mesh that follows grain and surface; auto: with body.motion or a free surface", "auto"
    )
    free_body: Choice = key("A grain moved by flow and weight; auto: with body.motion", "auto")
    free_surface: Choice = key(
        'A top that moves with the fluid; auto: with domain.top = "free-surface"', "auto"
    )
    turbulence: Choice = key(
        "The model of [turbulence]; auto: none; the plan warns of flows that may be turbulent",
        "auto",
    )
    third_dimension: Choice = key("Flow in space; auto: with domain.width", "auto")


def section_of(value: Any) -> Any:
    """The section that `effects = "auto"` stands for; anything else as it is."""
    return {} if value == "auto" else value
