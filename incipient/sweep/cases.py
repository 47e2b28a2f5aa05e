"""The cases of a sweep: scenes resolved and checked, each with an identity that depends on its content alone."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..input_files import read_text
from ..planning.flow_setup import Setup
from ..scene import Scene
from ..scene.file import dumps, parse
from .axes import Settings

TASKS = ("run", "threshold", "gust", "entrainment", "judge")
SECTION = "sweep"
_DIGITS = 20  # of an identity


@dataclass(frozen=True)
class Source:
    """A scene or case as it is before a sweep changes it: its name, TOML text, and where its files are."""

    name: str
    text: str
    base: Path = Path()

    @classmethod
    def of(cls, given: Scene | Path | str) -> Source:
        """A scene of Python, or a file. Raises SceneError: the file cannot be read."""
        if isinstance(given, Scene):
            return cls(given.title or "scene", dumps(given))
        path = Path(given)
        return cls(path.stem, read_text(path, "give the name of a scene file"), path.parent)

    @property
    def section(self) -> dict[str, Any]:
        """Section [sweep] as plain data; empty without one, or if the file is not TOML, which is reported later."""
        try:
            found = tomllib.loads(self.text).get(SECTION, {})
        except (ValueError, RecursionError):
            return {}
        if not isinstance(found, dict):
            raise SceneError(f"{self.name}: sweep: is not a section; write [sweep]")
        return found


@dataclass(frozen=True)
class SweepCase:
    """One case of a sweep.

    identity: the same for the same task and content, whatever the title, the files written and the order of keys
    settings: the overrides that made it; text: the resolved scene as TOML, of a case to be judged as JSON
    forms:    what decides which forms are compiled: cases that share it find them in the cache
    """

    identity: str
    task: str
    source: str
    settings: Settings
    text: str
    forms: str
    scene: Scene | None = field(default=None, repr=False, compare=False)

    @property
    def name(self) -> str:
        """The case by what was set in it."""
        return ", ".join(self.settings) or self.source


def resolved(
    source: Source, settings: Settings, task: str, common: Sequence[str] = ()
) -> SweepCase:
    """The case that settings make of a source; `common` are settings of all cases. Raises SceneError."""
    overrides = (*common, *settings)
    if task == "judge":
        return _judged(source, settings, overrides)
    scene = parse(Scene, source.text, source.base, overrides, source.name)
    forms = _forms(Setup(scene), task)
    return SweepCase(
        identity_of(scene, task), task, source.name, settings, dumps(scene), forms, scene
    )


def identity_of(scene: Scene, task: str) -> str:
    """The identity of a scene as a case of a sweep."""
    left_out = {"title", "output"} | ({"units"} if scene.units is None else set())
    return _identity(task, scene.model_dump(mode="json", exclude=left_out))


def _judged(source: Source, settings: Settings, overrides: Sequence[str]) -> SweepCase:
    from ..simulation.judge_case import Case

    case = parse(Case, source.text, source.base, overrides, source.name)
    content = case.model_dump(mode="json", exclude_none=True, warnings=False)
    identifying = {name: part for name, part in content.items() if name not in ("title", "source")}
    return SweepCase(
        _identity("judge", identifying), "judge", source.name, settings, json.dumps(content), ""
    )


def _identity(task: str, content: dict[str, Any]) -> str:
    text = json.dumps([task, content], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def _forms(setup: Setup, task: str) -> str:
    """Dimension, elements, effects and what is computed besides the flow."""
    from ..effects.plan import plan_of

    scene, plan = setup.scene, plan_of(setup)
    present = sorted(effect.name for effect in plan.effects if effect.present)
    elements = (
        scene.gdim,
        plan.order,
        plan.geometry_order,
        plan.convection,
        plan.scheme,
        plan.solver.name,
    )
    numerics = (scene.numerics.error_bars, scene.numerics.accuracy is not None)
    steadied = (plan.stabilisation.present, plan.stabilisation.upwind)
    return " ".join(map(str, (task, *elements, *numerics, *steadied, *present)))
