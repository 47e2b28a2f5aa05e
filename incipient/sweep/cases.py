"""The cases of a sweep: checked scenes, each with an identity that depends on its content alone."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..input_files import read_text
from ..scene import Scene
from ..scene.file import dumps, parse
from .axes import Settings

_DIGITS = 20  # of an identity


@dataclass(frozen=True)
class Source:
    """A scene or case without overrides: its name, TOML text, and the directory of its files."""

    name: str
    text: str
    base: Path = Path()

    @classmethod
    def of(cls, scene: Scene | Path | str) -> Source:
        if isinstance(scene, Scene):
            return cls(scene.title or "scene", dumps(scene))
        path = Path(scene)
        return cls(path.stem, read_text(path, "give the name of a scene file"), path.parent)


@dataclass(frozen=True)
class SweepCase:
    """One case of a sweep.

    identity: independent of the title, the files written and the order of keys
    settings: its overrides; text: the complete scene, or case to be judged, as JSON
    """

    identity: str
    task: str
    source: str
    settings: Settings
    text: str

    @property
    def name(self) -> str:
        return ", ".join(self.settings) or self.source


def resolved(
    source: Source, settings: Settings, task: str, common: Sequence[str] = ()
) -> SweepCase:
    """A source with the settings of one case; `common`: those of all cases. Raises SceneError."""
    overrides = (*common, *settings)
    if task == "judge":
        from ..judging.case import Case

        case = parse(Case, source.text, source.base, overrides, source.name)
        case.require_flow(source.name)
        content = case.model_dump(mode="json", exclude_none=True, warnings=False)
        identity = _identity(task, content, "title", "source")
    else:
        scene = parse(Scene, source.text, source.base, overrides, source.name)
        content, identity = tomllib.loads(dumps(scene)), identity_of(scene, task)
    return SweepCase(identity, task, source.name, settings, json.dumps(content))


def identity_of(scene: Scene, task: str) -> str:
    """The identity of a scene as a case of a sweep."""
    units = ("units",) if scene.units is None else ()
    return _identity(task, scene.model_dump(mode="json"), "title", "output", *units)


def _identity(task: str, content: Mapping[str, Any], *left_out: str) -> str:
    identifying = {name: part for name, part in content.items() if name not in left_out}
    text = json.dumps([task, identifying], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]
