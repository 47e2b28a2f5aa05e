"""Scenes as TOML files."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
from pydantic import ValidationError
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from ..errors import SceneError, refuse_broken, shortened
from ..files import own, write_text_atomically
from ..input_files import read_text
from ..parallel import Comm, from_first
from .messages import Key, Problem, discriminator, key_text, one_line, problems_of
from .model import Scene
from .section import Section

S = TypeVar("S", bound=Section)

# Text that is not TOML may stand on the command line without quotes.
_BARE_WORD = re.compile(r"[A-Za-z_][^\n\"'=\[\]{}]*")


def load(path: Path | str, overrides: Sequence[str] = (), comm: Comm | None = None) -> Scene:
    """Read a scene from a TOML file, changed by overrides such as ``"fluid.reynolds=40"``.

    Collective over `comm`, whose first rank reads the scene and the files that it names; without one, not collective.

    Raises:
        SceneError: names the file or the override, the key, the reason and the remedy.
    """
    if comm is None:
        return read(Scene, path, overrides)
    return from_first(comm, lambda: read(Scene, path, overrides))


def loads(
    text: str, base: Path | str = ".", overrides: Sequence[str] = (), name: str = "scene"
) -> Scene:
    """Parse a scene; its files are relative to `base`, errors call it `name`. Raises as `load`."""
    return parse(Scene, text, base, overrides, name)


def read(model: type[S], path: Path | str, overrides: Sequence[str] = ()) -> S:
    """Read a scene or another model; as `load`."""
    path, kind = Path(path), model.__name__.lower()
    text = read_text(path, f"give the name of a {kind} file")
    return parse(model, text, path.parent, overrides, str(path))


def parse(model: type[S], text: str, base: Path | str, overrides: Sequence[str], name: str) -> S:
    """Parse a scene or another model; as `loads`."""
    data = parsed_toml(text, name)
    data.pop("sweep", None)  # the section of `incipient sweep` is not part of the scene
    foreign = data.keys() - model.model_fields.keys()
    refuse_broken(
        ("domain" in foreign, f"{name}: is a scene; use incipient run"),
        (
            model is Scene and {"load", "grains"} & foreign,
            f"{name}: is a case; use incipient judge",
        ),
        (
            "load" in model.model_fields and "grains" in foreign,
            f"{name}: grains: are several, a case here has a single grain; give the file to incipient judge alone",
        ),
    )
    places = _overridden(data, overrides) if overrides else {}
    try:
        return model.model_validate(data, context={"directory": str(base)})
    except ValidationError as error:
        domain = data.get("domain")
        gdim = 2 + ("width" in domain) if isinstance(domain, dict) else None
        problems = problems_of(error, model, gdim)
        raise SceneError(one_line(_source(problems[0], places, name), problems)) from None


def dumps(scene: Scene) -> str:
    """Complete scene, defaults included, as TOML that `loads` converts to an equal scene."""
    return tomli_w.dumps(scene.model_dump(exclude_none=True))


def save(scene: Scene, path: Path | str) -> None:
    """Write the complete scene, independent of other files. Raises OutputError."""
    path = Path(path)
    own(path)  # who calls this has named the file
    write_text_atomically(path, dumps(scene))


def example(in_space: bool = False) -> str:
    """Commented TOML scene: a disc on a flat bed, or a sphere on a bed of spheres, in shear flow."""
    name = "sphere_in_pocket" if in_space else "grain_on_bed"
    return (Path(__file__).parent / f"{name}.toml").read_text(encoding="utf-8")


class _OfEditors(GenerateJsonSchema):
    """Without keywords that draft 7 has not; `kind` and `shape` are required, as they choose the section."""

    schema_dialect = "http://json-schema.org/draft-07/schema#"

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        section, name = super().model_schema(schema), discriminator(schema["cls"])
        return section | ({"required": [name, *section.get("required", [])]} if name else {})

    def tuple_schema(self, schema: core_schema.TupleSchema) -> JsonSchemaValue:
        items = super().tuple_schema(schema)
        return items | {"items": items.pop("prefixItems", [items.get("items")])[0]}


def schema() -> dict[str, Any]:
    """JSON schema of scene files (draft 7, as TOML editors require)."""
    document = Scene.model_json_schema(
        ref_template="#/definitions/{model}", schema_generator=_OfEditors
    )
    return {
        "$schema": _OfEditors.schema_dialect,
        "definitions": document.pop("$defs"),
        **document,
        "title": "incipient scene",
        "description": "A rigid grain on a rigid bed in a viscous flow: what to simulate, and how",
    }


def parsed_toml(text: str, name: str) -> dict[str, Any]:
    """The keys of a TOML text. Raises SceneError, which begins with `name`."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        why, _, place = str(error).rpartition(" (at ")
        where = place.rstrip(")").partition(",")[0]
        raise SceneError(
            f"{name}: {where}: {why[:1].lower() + why[1:]}; correct the TOML there"
        ) from None
    except RecursionError:
        raise SceneError(
            f"{name}: is nested too deeply; a scene has sections and keys only"
        ) from None
    except ValueError:  # of Python's own reading of whole numbers
        raise SceneError(f"{name}: has an integer with thousands of digits; shorten it") from None


def _overridden(data: dict[str, Any], overrides: Sequence[str]) -> dict[Key, str]:
    """The keys that overrides set in `data`; a title also names those that change its subject."""
    places = {_override(data, override): override for override in overrides}
    other = ("title", "numerics", "output", "time")
    changes = [override for key, override in places.items() if key[0] not in other]
    title = data.get("title")
    if changes and ("title",) not in places and isinstance(title, str) and title:
        data["title"] = ", ".join([title, *(f"with {shortened(change, 60)}" for change in changes)])
    return places


def _override(data: dict[str, Any], override: str) -> Key:
    if override != (readable := override.encode(errors="replace").decode()):
        raise _wrong(readable, "is not UTF-8 text; write it in a terminal that is set to UTF-8")
    path, equals, text = override.partition("=")
    key = tuple(part.strip() for part in path.split("."))
    if not equals or not all(key):
        raise _wrong(
            override, 'is not an assignment; write section.key=value, as in "fluid.reynolds=40"'
        )
    section = data
    for depth, part in enumerate(key[:-1], 1):
        section = section.setdefault(part, {})
        if not isinstance(section, dict):
            name = key_text(key[:depth])
            raise _wrong(override, f"{name} is not a section; assign to {name} itself")
    section[key[-1]] = _value(text.strip(), override)
    return key


def _value(text: str, override: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
        if list(parsed) == ["value"]:
            return parsed["value"]
    except (ValueError, RecursionError):
        if _BARE_WORD.fullmatch(text):
            return text
    raise _wrong(
        override, f'"{shortened(text, 60)}" is not a value; write a number, true, [x, y] or "text"'
    )


def _wrong(override: str, why: str) -> SceneError:
    return SceneError(" ".join(f"--set {shortened(override, 60)}: {why}".split()))


def _source(problem: Problem, places: dict[Key, str], name: str) -> str:
    key = problem.key
    for place, override in places.items():
        if key[: len(place)] == place or place[: len(key)] == key:
            return f"--set {shortened(override, 60)}"
    concerned = [text for place, text in places.items() if problem.between or place[0] in key[:1]]
    return " ".join([name, *(f"--set {shortened(override, 60)}" for override in concerned)])
