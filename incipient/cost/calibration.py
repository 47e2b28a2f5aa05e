"""Findings of studies: laws of time and error, and solver options that are cheaper, scene by scene.

`incipient cost` adds to this machine's calibration, in the user's cache directory; `incipient calibrate` makes one from
small built-in scenes. One made elsewhere, `shipped.json`, serves where there is none.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

from pydantic import TypeAdapter

from ..effects.known import EFFECTS
from ..errors import OutputError
from ..files import make_directory, own, write_json
from ..planning.flow_setup import Setup
from ..scene import Scene
from .laws import KNOWN_KEYS, ErrorLaw, TimeLaw

SCHEMA_VERSION = 2
NAME, SHIPPED = "calibration.json", Path(__file__).with_name("shipped.json")
STUDY = "cost.json"
STEADY, UNSTEADY, MOVING = "steady", "unsteady", "moving"
IN_SPACE = " in space"


@dataclass(frozen=True)
class Findings:
    """Findings of a study of a scene.

    time:    law of processor time; memory: measured over that of `expense.memory`
    errors:  laws by goal and order of the velocity
    cheaper: solver options that take less time at the same error, with the share of the time of the scene's own
    """

    __pydantic_config__: ClassVar = KNOWN_KEYS

    title: str
    kind: str
    time: TimeLaw
    memory: float
    errors: Mapping[str, Mapping[int, ErrorLaw]]
    cheaper: Mapping[str, float] = field(default_factory=dict)


# By the digests of their scenes, the last study last.
Calibration = Mapping[str, Findings]


def machine() -> str:
    """Name of this machine among those that share a home directory."""
    cores = os.cpu_count() or 1
    return f"{_processor()}, {cores} cores, {platform.node()}, incipient {version('incipient')}"


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def path() -> Path:
    """The file that holds the calibrations of this user's machines."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "incipient" / NAME


def read() -> Calibration:
    """The calibration of this machine; empty without a file, or if it is damaged or of another version."""
    try:
        return _parsed(_stored()[machine()])
    except (KeyError, TypeError, ValueError, AttributeError):
        return {}


def shipped() -> Calibration:
    """The calibration that comes with the program."""
    return _parsed(json.loads(SHIPPED.read_text(encoding="utf-8")))


def of_study(directory: Path) -> Calibration:
    """Findings of the study in a directory. Raises OutputError: there is none, or it is of another version."""
    path = directory / STUDY
    try:
        return _parsed(json.loads(path.read_text(encoding="utf-8"))["findings"])
    except (OSError, KeyError, TypeError, ValueError, AttributeError) as error:
        remedy = "make it with `incipient cost`"
        raise OutputError(f"{path}: holds no study that can be understood; {remedy}") from error


def _parsed(data: Mapping[str, Any]) -> Calibration:
    """Findings from plain data, as `plain` makes them."""
    return TypeAdapter(dict[str, Findings]).validate_python(data)


def plain(calibration: Calibration) -> dict[str, Any]:
    """Plain data of a calibration."""
    return {digest: asdict(found) for digest, found in calibration.items()}


def add(found: Calibration) -> None:
    """Add findings to the calibration of this machine, in place of older ones of their scenes; raises OutputError."""
    target, known = path(), read()
    make_directory(target.parent, target)
    own(target)  # of an earlier version, which left no mark
    kept = {digest: older for digest, older in known.items() if digest not in found}
    machines = {**_stored(), machine(): plain({**kept, **found})}
    write_json(target, {"schema_version": SCHEMA_VERSION, "machines": machines})


def _stored() -> dict[str, Any]:
    try:
        data = json.loads(path().read_text(encoding="utf-8"))
        return data["machines"] if data["schema_version"] == SCHEMA_VERSION else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def digest(scene: Scene) -> str:
    """Digest of a scene without its resolution and what is written, which is the same for all runs of a study."""
    content = scene.model_dump(mode="json", exclude={"title", "numerics", "output", "gusts"})
    # A scene in the plane says nothing of these, and is what it was before there were others.
    content["domain"] = {
        key: value for key, value in content["domain"].items() if value is not None
    }
    if scene.time is not None:
        content["time"] = {key: content["time"][key] for key in ("end", "scheme", "start")}
    content["numerics"] = {"convection": scene.numerics.convection}
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def kind(scene: Scene) -> str:
    """Kind of a scene: steady, unsteady or with a moving mesh, in the plane or in space, with what effects add."""
    of_effects = "".join(effect.kind_of_cost(Setup(scene)) for effect in EFFECTS)
    more = ("" if scene.gdim == 2 else IN_SPACE) + of_effects
    if scene.time is None:
        return STEADY + more
    moving = scene.has_surface or scene.moves
    return (MOVING if moving else UNSTEADY) + more


def step_of_flow(step: float | None, velocity: float, length: float) -> float:
    """A time step in units of the flow's time L/V by its reference velocity and length; zero for steady flow."""
    return 0.0 if step is None else step * velocity / length
