"""What contradicts a channel whose top is a free surface."""

from __future__ import annotations

from collections.abc import Iterator

from .messages import Key
from .model import SceneSections
from .surface import Surface, Wave

# What streams below a free surface: profiles without shear on it, or none.
STREAMS = ("open-channel", "uniform", "still")
_OF_CHANNELS = {"inflow": "0", "wave": None, "outflow": "open", "sponge": 0.0}


def of_box(surface: Surface) -> Iterator[tuple[Key, str, str]]:
    """Keys of [surface] that a box has not."""
    for name, usual in _OF_CHANNELS.items():
        if getattr(surface, name) != usual:
            remedy = 'leave it out or use domain.kind = "channel"'
            yield ("surface", name), "is that of a channel but the domain is a box", remedy


def of_channel(scene: SceneSections, surface: Surface) -> Iterator[tuple[Key, str, str]]:
    """What keeps a channel from having a free surface."""
    kind, closed = scene.flow.kind, surface.outflow == "wall"
    if kind not in STREAMS:
        choices = " or ".join(f'"{one}"' for one in STREAMS)
        why = f'"{kind}" is no stream below a free surface, on which there is no shear'
        yield ("flow", "kind"), why, f"use {choices}, and surface.inflow for what changes in time"
        return
    if surface.ends != "wall":
        yield ("surface", "ends"), "is that of a box but the domain is a channel", "leave it out"
    if scene.gdim == 3 and scene.sides == "stream":
        why = 'is "stream": the surface of a channel would have no place there'
        yield ("domain", "sides"), why, 'use "slip", or "wall" where the fluid sticks and the surface stays'
    if scene.gdim == 2 and "z" in _variables(surface.inflow):
        yield ("surface", "inflow"), "depends on z but the scene lies in the plane", "use y and t only"
    if closed and kind != "still":
        why = f'"{kind}" flows through but surface.outflow is "wall"'
        yield ("flow", "kind"), why, 'use "still", and surface.inflow for what enters'
    if surface.sponge > 0.5 * scene.domain.length:
        why = f"is {surface.sponge:g}, more than half of the channel"
        yield ("surface", "sponge"), why, f"give at most {0.5 * scene.domain.length:g}"
    if surface.wave is not None:
        yield from _of_wave(scene, surface, surface.wave)
    if scene.time is not None and scene.time.start != "rest" and closed:
        yield ("time", "start"), "is a flow through but the channel has an end", 'use "rest"'


def _of_wave(scene: SceneSections, surface: Surface, wave: Wave) -> Iterator[tuple[Key, str, str]]:
    if surface.inflow != "0":
        yield ("surface", "inflow"), "is given beside surface.wave", "leave one of them out"
    if surface.tension:
        why = "is that of gravity alone but surface.tension is not zero"
        yield ("surface", "wave"), why, "leave one of them out, or give the velocity as surface.inflow"
    if scene.gdim == 3 and scene.sides == "wall":
        why = "is the same across the channel but the fluid sticks to its sides"
        yield ("surface", "wave"), why, 'use domain.sides = "slip", or give the velocity as surface.inflow'
    left = scene.domain.length - surface.sponge
    if wave.zone > 0.5 * left:
        why = f"is {wave.zone:g}, more than half of the channel before its sponge"
        yield ("surface", "wave", "zone"), why, f"give at most {0.5 * left:g}"


def _variables(text: str) -> frozenset[str]:
    from .expression import Expression

    return Expression(text).variables
