"""Stored data of results for pictures."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError, SceneError
from ..geometry.placement import Placement
from ..input_files import reading
from ..output.series_file import StoredStep, read_step
from ..scene import Scene, load
from .outlines import grain_outline
from .plane import Plane, plane_of, pyvista_off_screen
from .style import View

REMEDY = "give the directory of a finished run, or run the scene again"


@dataclass(frozen=True)
class StoredRun:
    """Result, resolved scene and last fields of a run; `surface` is None without a grain."""

    directory: Path
    result: dict[str, Any]
    scene: dict[str, Any]
    fields: StoredStep
    surface: StoredStep | None

    @cached_property
    def grid(self) -> Any:
        pyvista = pyvista_off_screen()
        plane, solid = pyvista.CellType.QUADRATIC_TRIANGLE, pyvista.CellType.QUADRATIC_TETRA
        kind = solid if self.in_space else plane
        grid = pyvista.UnstructuredGrid({kind: self.fields.cells}, self.fields.points)
        for name, values in self.fields.fields.items():
            grid[name] = values
        return grid

    @cached_property
    def plane(self) -> Plane:
        return plane_of(self)

    @property
    def views(self) -> list[View]:
        return self.plane.views(ground=bool(self.scene.get("bed")))

    @property
    def place(self) -> Placement | None:
        """Placement of the grain at the end of the run, at rest if it touches the bed; None without one."""
        centre = self.value("grain", "centre")
        return None if centre is None else self.placement(centre)

    def placement(self, centre: Any) -> Placement:
        turned = self.value("grain", "quaternion")
        if turned is None:
            return Placement(tuple(centre), self.value("grain", "angle", 0.0))
        return Placement(tuple(centre), quaternion=tuple(turned))

    @cached_property
    def touching_grain(self) -> np.ndarray | None:
        """Outline (n, 2) of a grain with closed contacts, which the mesh has in part; otherwise None."""
        if not self.value("gap", "closed"):
            return None
        return grain_outline(self.model.grain, self.place)

    @cached_property
    def model(self) -> Scene:
        with of_this_version(self.directory):
            return Scene(**self.scene)

    def field(self, name: str) -> np.ndarray:
        """Nodal values of a flow field, (nodes,) or (nodes, 3)."""
        if name not in self.fields.fields:
            raise OutputError(f"{self.directory / 'fields'}: holds no {name}; run the scene again")
        return self.fields.fields[name]

    def in_plane(self, name: str) -> np.ndarray:
        """Values of a field at the points of the plane, (points,) or (points, 3)."""
        self.field(name)
        return np.asarray(self.plane.sheet[name])

    def setting(self, section: str, key: str) -> Any:
        return (self.scene.get(section) or {}).get(key)

    @property
    def moves(self) -> bool:
        return self.setting("body", "motion") in ("free", "prescribed", "released")

    def value(self, section: str, key: str, otherwise: Any = None) -> Any:
        value = (self.result.get(section) or {}).get(key)
        return otherwise if value is None else value

    def vector(self, section: str, key: str) -> np.ndarray:
        return np.array(self.value(section, key, (0.0, 0.0, 0.0)), dtype=float)

    @property
    def in_space(self) -> bool:
        return self.fields.cells.shape[1] == 10

    @property
    def middle(self) -> float:
        return float(self.setting("domain", "origin")[1] + 0.5 * self.setting("domain", "width"))

    @property
    def halved(self) -> bool:
        return bool(
            self.fields.points[:, 1].min() > self.middle - 0.25 * self.setting("domain", "width")
        )

    def whole(self, points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A surface of points (n, 3) and cells, with its mirror image for half a domain."""
        if not self.halved:
            return points, cells
        other = points * [1.0, -1.0, 1.0] + [0.0, 2.0 * self.middle, 0.0]
        return np.vstack([points, other]), np.vstack([cells, cells + len(points)])

    @property
    def title(self) -> str:
        flow = f"{self.setting('flow', 'kind')} flow"
        return self.result.get("title") or self.scene.get("title") or flow

    @property
    def headline(self) -> str:
        reynolds, scale = self.setting("fluid", "reynolds"), self.setting("fluid", "scale")
        about = f"  (Re = {reynolds:g} on the scale of the {scale})" if reynolds else ""
        return f"{self.title}{about}"


def read(directory: Path) -> StoredRun:
    """Read a run's directory. Raises OutputError naming the missing or damaged file."""
    result, scene = parsed_json(directory / "result.json"), read_scene(directory)
    surface = read_step(directory / "surface") if scene.get("body") else None
    if surface is not None and "traction" not in surface.fields:
        raise OutputError(f"{directory / 'surface'}: holds no traction; run the scene again")
    return StoredRun(directory, result, scene, read_step(directory / "fields"), surface)


def read_scene(directory: Path) -> dict[str, Any]:
    """The resolved scene of a run, section by section. Raises OutputError if missing or damaged."""
    path = directory / "scene.toml"
    with reading(path, REMEDY, error=OutputError):
        return tomllib.loads(path.read_text(encoding="utf-8"))


def scene_of(directory: Path) -> Scene:
    """The resolved scene of results. Raises OutputError: missing, damaged, or of another version."""
    read_scene(directory)
    with of_this_version(directory):
        return load(directory / "scene.toml")


@contextmanager
def of_this_version(directory: Path) -> Iterator[None]:
    """Turn errors of the scene of results in the block into an OutputError with the remedy for other versions."""
    try:
        yield
    except SceneError as error:
        why = f"{directory}: holds results of another version, whose scene is refused by this one"
        remedy = "show them with that version, or run the scene again, changed so"
        raise OutputError(f"{why} ({error}); {remedy}") from None


def table(path: Path, again: str, *texts: str) -> dict[str, np.ndarray]:
    """Columns (n,) of numbers of a CSV file except those of `texts`; NaN for empty cells, headings without units.

    The last row may be incomplete. Raises OutputError with the remedy `again`.
    """
    with (
        reading(path, again, error=OutputError),
        path.open(encoding="utf-8", newline="") as file,
    ):
        header, *rows = list(csv.reader(file)) or [[]]
        if rows and len(rows[-1]) < len(header):
            rows.pop()
        names = [heading.partition(" [")[0] for heading in header]
        columns = dict(
            zip(names, zip(*rows, strict=True) if rows else [()] * len(names), strict=True)
        )
        return {
            name: np.array([float(cell or "nan") for cell in column])
            for name, column in columns.items()
            if name not in texts
        }


def _renamed(stored: Any) -> Any:
    if isinstance(stored, list):
        return [_renamed(part) for part in stored]
    if not isinstance(stored, dict):
        return stored
    return {"torque" if key == "couple" else key: _renamed(part) for key, part in stored.items()}


def parsed_json(path: Path) -> dict[str, Any]:
    """The content of a JSON file of results; raises OutputError if missing or damaged.

    The key "couple" of earlier versions becomes "torque".
    """
    with reading(path, REMEDY, error=OutputError):
        return _renamed(json.loads(path.read_text(encoding="utf-8")))
