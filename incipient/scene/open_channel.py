"""What contradicts a channel whose top is a free surface."""

from collections.abc import Iterator

from .domain import Domain
from .flows import Flow
from .messages import Problem, either, problem
from .model import Time
from .surface import Surface

# Base flows below a free surface: profiles without shear on it, or none.
STREAMS = ("open-channel", "uniform", "still")
_OF_CHANNELS = {"wave": None, "outflow": "open", "sponge": 0.0}


def of_box(surface: Surface) -> Iterator[Problem]:
    """Keys of [surface] that a box has not."""
    for name, usual in _OF_CHANNELS.items():
        if getattr(surface, name) != usual:
            remedy = 'leave it out or use domain.kind = "channel"'
            yield problem(
                f"surface.{name}", "is read only in a channel but the domain is a box", remedy
            )


def of_channel(
    flow: Flow, domain: Domain, surface: Surface, time: Time | None
) -> Iterator[Problem]:
    """What keeps a channel from having a free surface."""
    kind, half = flow.kind, 0.5 * domain.length
    if kind not in STREAMS:
        why = f'"{kind}" is no flow below a free surface, on which there is no shear'
        remedy = f"use {either(STREAMS)}"
        yield problem("flow.kind", why, remedy)
        return
    if surface.ends != "wall":
        yield problem(
            "surface.ends", "is read only in a box but the domain is a channel", "leave it out"
        )
    if domain.sides == "stream":
        why = 'is "stream": the surface of a channel would have no place there'
        yield problem(
            "domain.sides",
            why,
            'use "slip", or "wall" where the fluid sticks and the surface stays',
        )
    if surface.outflow == "wall" and kind != "still":
        why = f'"{kind}" flows through but surface.outflow is "wall"'
        yield problem("flow.kind", why, 'use "still"')
    if surface.sponge > half:
        why = f"is {surface.sponge:g}, more than half of the channel"
        yield problem("surface.sponge", why, f"give at most {half:g}")
    if surface.wave is not None:
        yield from _of_wave(domain)
    if time is not None and time.start != "rest" and surface.outflow == "wall":
        yield problem("time.start", "is a flow through but the channel has an end", 'use "rest"')


def _of_wave(domain: Domain) -> Iterator[Problem]:
    if domain.sides == "wall":
        why = "is the same across the channel but the fluid sticks to its sides"
        yield problem("surface.wave", why, 'use domain.sides = "slip"')
