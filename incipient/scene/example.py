"""Example scenes with comments on their keys."""

import json
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from .domain import Domain
from .flows import Shear
from .messages import discriminator, tag, variants
from .model import Contact, Fluid, Gravity, Scene
from .section import Section, ordered_keys
from .shapes import Disc, Flat
from .solids import Sphere
from .terrains import SphereBed

_HEADING = """\
A scene for incipient. Lengths and times are in any consistent units, [in brackets] at each key.
The fluid's density is 1; its viscosity follows from the Reynolds number.
Lines that begin with # show further keys; keys with a default are optional."""
_COLUMN = 26


def grain_on_bed() -> Scene:
    """Disc on a flat bed in linear shear; loads are within about 1% of those in an unbounded domain."""
    return Scene(
        title="A disc on a flat bed in shear flow",
        domain=Domain(kind="channel", length=24.0, height=20.0),
        fluid=Fluid(reynolds=20.0, scale="grain"),
        flow=Shear(rate=1.0),
        body=Disc(diameter=1.0, x=16.0, density=2.65),
        bed=Flat(),
        gravity=Gravity(acceleration=10.0),
        contact=Contact(friction=0.5),
    )


def grain_in_pocket() -> Scene:
    """Sphere in a pocket of a bed of equal spheres, in creeping linear shear."""
    return Scene(
        title="A sphere in a pocket of a bed of spheres in shear flow",
        domain=Domain(kind="channel", length=20.0, width=20.0, height=10.0),
        fluid=Fluid(reynolds=1.0, scale="grain", inertia=False),
        flow=Shear(rate=1.0),
        body=Sphere(diameter=1.0, x=10.0, density=2.65, settle=True),
        bed=SphereBed(radius=0.5, spacing=1.0, offset=(9.4, 10.0), angle=90.0),
        gravity=Gravity(acceleration=50.0),
        contact=Contact(friction=0.5),
    )


def commented(scene: Scene) -> str:
    """Scene as TOML with the keys' descriptions; keys without a value are commented out."""
    lines = [f"# {line}" for line in _HEADING.splitlines()]
    lines += ["", _assignment("title", scene.title)]
    for name, field in Scene.model_fields.items():
        options = variants(field.annotation)
        if options:
            fitting = tuple(
                option
                for option in options
                if scene.gdim in getattr(option, "gdims", (scene.gdim,))
            )
            lines += ["", *_section(name, field, fitting, getattr(scene, name))]
    return "\n".join(lines) + "\n"


def _section(
    name: str, field: FieldInfo, options: tuple[type[BaseModel], ...], chosen: Section | None
) -> Iterator[str]:
    model = options[0] if chosen is None else type(chosen)
    absent = "# " if chosen is None else ""
    yield _explained(f"{absent}[{name}]", str(field.description))
    for key in ordered_keys(model):
        part = model.model_fields[key]
        value = part.default if chosen is None else getattr(chosen, key)
        unset = value is None or (part.is_required() and chosen is None)
        shown = next(iter(part.examples or []), "") if unset else value
        mark = absent or ("# " if unset else "")
        yield _explained(mark + _assignment(key, shown), _comment(part, key, options))


def _explained(line: str, comment: str) -> str:
    return f"{line.ljust(_COLUMN - 1)} # {comment}"


def _assignment(key: str, value: Any) -> str:
    if isinstance(value, dict):
        return f"{key} = {{{', '.join(_assignment(*item) for item in value.items())}}}"
    return f"{key} = {json.dumps(value, ensure_ascii=False)}"


def _comment(part: FieldInfo, key: str, options: tuple[type[BaseModel], ...]) -> str:
    values = get_args(part.annotation) if get_origin(part.annotation) is Literal else ()
    choices = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
    if key == discriminator(options[0]) and len(options) > 1:
        choices = [str(tag(option)) for option in options]
    words = str(part.description)
    return f"{words} ({' | '.join(choices)})" if len(choices) > 1 else words
