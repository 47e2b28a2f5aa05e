"""What runs on this machine have taken, kept in the user's cache directory, and what a scene will take by it.

`incipient cost` adds to it, `incipient calibrate` makes one from small built-in scenes.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import reported, write_json
from .counts import COUNTS, Counts
from .errorlaw import ErrorLaw
from .prices import MOVING, STEADY, UNSTEADY, Known, Work

if TYPE_CHECKING:
    from ..scene import Scene

SCHEMA_VERSION = 1
NAME = "calibration.json"


@dataclass(frozen=True)
class KnownErrors:
    """How the errors of a scene's goals fall, and what the scene is like."""

    title: str
    kind: str
    laws: Mapping[str, ErrorLaw]


@dataclass(frozen=True)
class Calibration:
    """Runs measured on this machine, and laws of errors by the digests of their scenes."""

    runs: tuple[Known, ...] = ()
    errors: Mapping[str, KnownErrors] = field(default_factory=dict)

    def with_scene(self, digest: str, runs: Sequence[Known], errors: KnownErrors | None) -> Calibration:
        """The same with the runs and laws of a scene, in place of older ones."""
        kept = tuple(run for run in self.runs if run.scene != digest)
        laws = {key: known for key, known in self.errors.items() if key != digest}
        return Calibration((*kept, *runs), {**laws, **({digest: errors} if errors else {})})

    def of(self, digest: str) -> list[Known]:
        """Runs of one scene."""
        return [run for run in self.runs if run.scene == digest]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        laws = {
            digest: {
                "title": known.title,
                "kind": known.kind,
                "laws": {goal: law.to_dict() for goal, law in known.laws.items()},
            }
            for digest, known in self.errors.items()
        }
        return {"runs": [_flat(run) for run in self.runs], "errors": laws}

    @staticmethod
    def of_dict(data: Mapping[str, Any]) -> Calibration:
        """From plain data."""
        runs = tuple(Known(**{**run, "work": _work(run["work"])}) for run in data["runs"])
        errors = {
            digest: KnownErrors(
                known["title"],
                known["kind"],
                {goal: ErrorLaw.of_dict(law) for goal, law in known["laws"].items()},
            )
            for digest, known in data["errors"].items()
        }
        return Calibration(runs, errors)


def _flat(run: Known) -> dict[str, Any]:
    """A run as plain data, the counts of its work beside what else there is of it."""
    data = asdict(run)
    data["work"] |= data["work"].pop("counts")
    return data


def _work(data: Mapping[str, Any]) -> Work:
    rest = {key: value for key, value in data.items() if key not in COUNTS}
    return Work(**rest, counts=Counts.of(data))


# -- where it is kept ---------------------------------------------------------------------------------------


def path() -> Path:
    """The file that holds the calibrations of this user's machines."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "incipient" / NAME


def machine() -> str:
    """What tells machines apart that share a home directory."""
    from importlib.metadata import version

    cores = os.cpu_count() or 1
    return f"{_processor()}, {cores} cores, {platform.node()}, incipient {version('incipient')}"


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def read() -> Calibration:
    """The calibration of this machine; empty without a file, or if it is damaged or of another version."""
    try:
        return Calibration.of_dict(_stored()[machine()])
    except (KeyError, TypeError, ValueError):
        return Calibration()


def write(calibration: Calibration) -> None:
    """Keep the calibration of this machine; those of others stay.

    Raises:
        OutputError: it cannot be written.
    """
    target = path()
    with reported(target):
        target.parent.mkdir(parents=True, exist_ok=True)
    machines = {**_stored(), machine(): calibration.to_dict()}
    write_json(target, {"schema_version": SCHEMA_VERSION, "machines": machines})


def _stored() -> dict[str, Any]:
    try:
        data = json.loads(path().read_text(encoding="utf-8"))
        return data["machines"] if data["schema_version"] == SCHEMA_VERSION else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


# -- what tells scenes apart --------------------------------------------------------------------------------


def digest(scene: Scene) -> str:
    """What runs of one scene share: all of it but how finely it is computed and what is written."""
    told = scene.model_dump(mode="json", exclude={"title", "numerics", "output"})
    if scene.time is not None:
        told["time"] = {key: told["time"][key] for key in ("end", "scheme", "start")}
    told["numerics"] = {"convection": scene.numerics.convection, "form": scene.numerics.form}
    text = json.dumps(told, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def kind(scene: Scene) -> str:
    """Steady, unsteady, or with a grain that moves."""
    if scene.time is None:
        return STEADY
    return MOVING if scene.body is not None and scene.body.moves else UNSTEADY


def step_of_flow(scene: Scene, step: float | None) -> float:
    """A time step in units of the flow's time L/V; zero for steady flow."""
    return 0.0 if step is None else step * scene.reference_velocity / scene.reference_length


def known(scene: Scene, work: Work, mesh_size: float, step: float | None, **measured: float) -> Known:
    """A run of a scene as it is kept; `measured`: start, cpu and peak_mib."""
    return Known(
        scene=digest(scene),
        work=work,
        mesh_size=mesh_size,
        step=step_of_flow(scene, step),
        reynolds=scene.reference_velocity * scene.domain.height / scene.viscosity,
        convection=scene.numerics.convection,
        **measured,
    )


def spread_of(errors: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The middle of errors that are each known to a factor, and the factor that covers them."""
    logs = np.log([max(error, 1e-300) for error, _ in errors])
    own = max(factor for _, factor in errors)
    between = math.exp(2.0 * float(np.std(logs))) if len(errors) > 1 else 1.0
    return math.exp(float(np.mean(logs))), own * between
