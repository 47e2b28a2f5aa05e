"""The free surface of a scene: what a user writes about it, and what contradicts it elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ..errors import SceneError
from .messages import Key, Problem, counted, split
from .open_channel import of_box, of_channel
from .points import read_points
from .section import NotNegative, Pair, Positive, Section, contradiction

if TYPE_CHECKING:
    import numpy as np

    from .model import Scene

Station = float | Annotated[tuple[float, float], Field(strict=False)]
_VARIABLES = {"elevation": "xy", "pressure": "xyt", "inflow": "yzt", "seepage": "xyt"}
_SAMPLES = 201  # along each side of the surface, where its first elevation is looked at
FREE = "free-surface"


class Wave(Section):
    """A wave that a wave maker lets into a channel: Stokes's, of second order, on the stream."""

    amplitude: Positive = Field(
        description="Of the first harmonic of the elevation, half of the wave's height [length]",
        examples=[0.01],
    )
    period: Positive = Field(description="As seen from the bed [time]", examples=[5.0])
    zone: NotNegative = Field(
        0.0,
        description="Length after the inflow in which the flow is relaxed to stream and wave, so that waves that come "
        "back die out [length]",
    )


class Surface(Section):
    """The free surface, which at rest lies at the top of the domain."""

    elevation: str = Field(
        "0", description="Formula in x, in space y too: height above the still level [length]"
    )
    file: str | None = Field(
        None,
        description="CSV file of x, elevation relative to the scene; the resolved scene has points instead",
        examples=["elevation.csv"],
    )
    points: Annotated[tuple[Pair, ...], Field(strict=False)] = Field(
        (), description="In the plane, in place of the formula: x and elevation, straight between [length]"
    )
    stations: Annotated[tuple[Station, ...], Field(strict=False)] = Field(
        (),
        description="Places x, in space [x, y], whose elevations are columns of the history; without: a few",
    )
    bottom: Literal["no-slip", "slip"] = Field("no-slip", description="A level bottom without [bed]")
    ends: Literal["wall", "no-slip"] = Field(
        "wall",
        description="wall: the fluid slides along both ends; no-slip: it sticks, the surface is pinned",
    )
    inflow: str = Field(
        "0",
        description="Formula in t and y, in space y and z: speed at the inflow beside the stream's [length/time]",
    )
    wave: Wave | None = Field(
        None,
        description="A wave that comes in with the stream, in place of `inflow`",
        examples=[{"amplitude": 0.01, "period": 5.0, "zone": 0.0}],
    )
    seepage: str = Field(
        "0",
        description="Formula in x, in space y, and t: what enters through the bed per level area [length/time]",
    )
    outflow: Literal["open", "wall"] = Field(
        "open", description="Right end of a channel; open: the still level lies beyond it; wall: it is closed"
    )
    sponge: NotNegative = Field(
        0.0, description="Length before the right end of a channel in which waves die out [length]"
    )
    pressure: str = Field(
        "0", description="Formula in x, y and t: pressure above, over the fluid's density [length^2/time^2]"
    )
    tension: NotNegative = Field(
        0.0, description="Surface tension over the fluid's density [length^3/time^2]"
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        """Replace a file by its points, so that the scene no longer depends on where it was read."""
        if not isinstance(data, dict) or not isinstance(data.get("file"), str):
            return data
        path = Path((info.context or {}).get("directory", "."), data["file"])
        return {k: v for k, v in data.items() if k != "file"} | {"points": read_points(path, 2, "Surface")}

    @field_validator("elevation", "pressure", "inflow", "seepage")
    @classmethod
    def _is_a_formula(cls, text: str, info: ValidationInfo) -> str:
        from .expression import Expression

        try:
            variables = Expression(text).variables
        except SceneError as error:
            raise contradiction(*split(str(error))) from None
        known = set(_VARIABLES[str(info.field_name)])
        if unknown := variables - known:
            raise contradiction(f'"{text}" depends on {min(unknown)}', f"use {', '.join(sorted(known))} only")
        return text

    @model_validator(mode="after")
    def _is_given_once(self) -> Surface:
        if self.points and self.elevation != "0":
            raise self.refused(
                "points", "are given beside a formula for the elevation", "leave one of them out"
            )
        rising = all(a[0] < b[0] for a, b in zip(self.points[:-1], self.points[1:], strict=True))
        if len(self.points) == 1 or not rising:
            raise self.refused(
                "points", "do not ascend in x", "give two or more points sorted by x, each x once"
            )
        return self

    def height(self, x: np.ndarray) -> np.ndarray:
        """Elevations (n,) above the still level at time zero, at places (3, n). Not collective."""
        import numpy as np

        from .expression import Expression

        if self.points:
            return np.interp(x[0], *np.transpose(self.points))
        return Expression(self.elevation)(x)

    def places(self) -> list[tuple[float, ...]]:
        """The stations' horizontal coordinates."""
        return [one if isinstance(one, tuple) else (one,) for one in self.stations]


def has_surface(scene: Scene) -> bool:
    """Whether the top of a scene is a free surface."""
    return scene.domain.top == FREE


def stations_of(scene: Scene) -> list[tuple[float, ...]]:
    """Where elevations are told of: the stations, or without any five from end to end, in space three by three."""
    given = () if scene.surface is None else scene.surface.places()
    domain, along = scene.domain, 5 if scene.gdim == 2 else 3
    sides = [(domain.left, domain.right)] + ([domain.across] if scene.gdim == 3 else [])
    evenly = ([low + (high - low) * i / (along - 1) for i in range(along)] for low, high in sides)
    return list(given) or list(product(*evenly))


def contradictory(scene: Scene) -> Iterator[Problem]:
    """What keeps a scene from having the free surface that it asks for."""
    asked = scene.effects.free_surface
    if not has_surface(scene):
        if scene.surface is not None:
            why = f'describes a free surface, but the top is "{scene.top}"'
            yield Problem(("surface",), why, f'set domain.top = "{FREE}" or leave the section out')
        if asked is True:
            yield Problem(
                ("effects", "free_surface"), "is true but there is none", f'set domain.top = "{FREE}"'
            )
        return
    if asked is False:
        why = f'is false but domain.top = "{FREE}"'
        yield Problem(
            ("effects", "free_surface"), why, 'leave one of them out, as a lid is domain.top = "slip"'
        )
    for key, why, remedy in (*_of_time(scene), *_of_forces(scene), *_of_sides(scene)):
        yield Problem(key, why, remedy)


def _of_time(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    top = ("domain", "top")
    if scene.time is None:
        yield top, "a free surface moves in time", "add a section [time]"
    elif scene.time.start != "rest" and scene.domain.kind == "box":
        yield ("time", "start"), "below a free surface the fluid of a box starts from rest", 'use "rest"'
    if scene.effects.unsteadiness is False:
        yield ("effects", "unsteadiness"), "is false but a free surface moves in time", 'use "auto"'


def _of_forces(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    if scene.gravity is None or scene.effects.gravity is False or scene.gravity.acceleration == 0.0:
        yield ("domain", "top"), "gravity is what keeps a free surface level", "add a section [gravity]"


def _of_sides(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    surface, domain = scene.surface or Surface(), scene.domain
    if domain.kind == "channel":
        yield from of_channel(scene, surface)
    elif scene.flow.kind != "still":
        why = "a free surface is simulated in a box whose fluid starts from rest"
        yield ("flow", "kind"), why, 'use "still", or domain.kind = "channel"'
    else:
        yield from of_box(surface)
    if surface.bottom == "slip" and scene.bed is not None:
        yield ("surface", "bottom"), "is that of a domain without [bed]", "leave one of them out"
    if surface.bottom == "slip" and surface.seepage != "0":
        why = "enters straight up, which a bottom that slips does not ask for"
        yield ("surface", "seepage"), why, "leave surface.bottom out"
    if surface.points and scene.gdim == 3:
        yield ("surface", "points"), "are those of a scene in the plane", "give the elevation as a formula"
    for name, remedy in (("elevation", "use x only"), ("seepage", "use x and t only")):
        if scene.gdim == 2 and "y" in _variables(getattr(surface, name)):
            yield ("surface", name), "depends on y but the scene lies in the plane", remedy


def _variables(text: str) -> frozenset[str]:
    from .expression import Expression

    return Expression(text).variables


def misplaced(scene: Scene) -> Iterator[Problem]:
    """Stations outside of the domain, and a first elevation that is not above bed and grain."""
    if not has_surface(scene):
        return
    surface, domain = scene.surface or Surface(), scene.domain
    sides = [("x", domain.left, domain.right)] + ([("y", *domain.across)] if scene.gdim == 3 else [])
    for number, place in enumerate(surface.places()):
        key = ("surface", "stations", number)
        if len(place) != len(sides):
            remedy = "give its x" if scene.gdim == 2 else "give [x, y]"
            yield Problem(key, f"has {counted(len(place), 'coordinate')}", remedy)
            return
        for (axis, low, high), value in zip(sides, place, strict=True):
            if not low <= value <= high:
                yield Problem(key, f"{axis} = {value:g} is outside the domain", f"give {low:g} to {high:g}")
                return
    yield from _too_low(scene, surface)


def _too_low(scene: Scene, surface: Surface) -> Iterator[Problem]:
    import numpy as np

    domain, bed = scene.domain, scene.bed_shape
    axes = [np.linspace(domain.left, domain.right, _SAMPLES)]
    if scene.gdim == 3:
        axes.append(np.linspace(*domain.across, _SAMPLES))
    across = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, scene.gdim - 1)
    places = np.zeros((3, len(across)))
    places[: scene.gdim - 1] = across.T
    try:
        heights = domain.ceiling + surface.height(places)
    except SceneError as error:
        yield Problem(("surface", "elevation"), *split(str(error)))
        return
    floor = np.full(len(across), domain.bottom)
    if bed is not None:
        floor = bed.height(across[:, 0] if scene.gdim == 2 else across)
    lowest = int(np.argmin(heights - floor))
    if heights[lowest] <= floor[lowest]:
        where = ", ".join(f"{axis} = {value:g}" for axis, value in zip("xy", across[lowest], strict=False))
        key = ("surface", "points" if surface.points else "elevation")
        yield Problem(key, f"brings the surface down to the bed at {where}", "give a smaller elevation")
