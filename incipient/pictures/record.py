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
from .plane import Plane, plane_of, pyvista_off_screen
from .style import View

REMEDY = "give the directory of a finished run, or run the scene again"


@dataclass(frozen=True)
class StoredRun:
    """Result, scene and fields of a run; `surface` is None without a grain."""

    directory: Path
    result: dict[str, Any]
    scene: Scene
    fields: StoredStep
    surface: StoredStep | None

    @cached_property
    def grid(self) -> Any:
        return grid_of(self.fields, "QUADRATIC_TETRA" if self.in_space else "QUADRATIC_TRIANGLE")

    @cached_property
    def plane(self) -> Plane:
        return plane_of(self)

    @property
    def views(self) -> list[View]:
        return self.plane.views(ground=self.scene.bed is not None)

    def placement(self, key: str = "computed_centre") -> Placement | None:
        """Placement of the grain in the fields, or by the key "centre" in contact with the bed; None without one."""
        if "grain" not in self.result:  # a run under way
            return self.scene.placement
        stored = self.result["grain"]
        if stored is None:
            return None
        turned = stored.get("quaternion") and tuple(stored["quaternion"])
        return Placement(tuple(stored[key]), stored.get("angle") or 0.0, turned)

    def field(self, name: str) -> np.ndarray:
        """Nodal values of a flow field, (nodes,) or (nodes, 3)."""
        if name not in self.fields.fields:
            raise OutputError(f"{self.directory / 'fields'}: holds no {name}; run the scene again")
        return self.fields.fields[name]

    def in_plane(self, name: str) -> np.ndarray:
        """Values of a field at the points of the plane, (points,) or (points, 3)."""
        self.field(name)
        return np.asarray(self.plane.sheet[name])

    @property
    def in_space(self) -> bool:
        return self.scene.gdim == 3

    @property
    def title(self) -> str:
        return self.scene.title or f"{self.scene.flow.kind} flow"

    @property
    def headline(self) -> str:
        fluid = self.scene.fluid
        return f"{self.title}  (Re = {fluid.reynolds:g} on the scale of the {fluid.scale})"

    @property
    def moment(self) -> str:
        """The time of the fields, in words; empty in steady flow."""
        return "" if self.scene.time is None else f" at t = {self.fields.time:.4g}"


def grid_of(step: StoredStep, kind: str) -> Any:
    """Cells of a kind of VTK with their fields."""
    pyvista = pyvista_off_screen()
    grid = pyvista.UnstructuredGrid({pyvista.CellType[kind]: step.cells}, step.points)
    grid.point_data.update(step.fields)
    return grid


def read(directory: Path) -> StoredRun:
    """Read a run's directory. Raises OutputError naming the missing or damaged file."""
    result, scene = parsed_json(directory / "result.json"), scene_of(directory)
    surface = None if scene.body is None else read_step(directory / "surface")
    if surface is not None and "traction" not in surface.fields:
        raise OutputError(f"{directory / 'surface'}: holds no traction; run the scene again")
    return StoredRun(directory, result, scene, read_step(directory / "fields"), surface)


def scene_of(directory: Path) -> Scene:
    """The resolved scene of results. Raises OutputError: missing, damaged, or of another version."""
    path = directory / "scene.toml"
    with reading(path, REMEDY, error=OutputError):
        tomllib.loads(path.read_text(encoding="utf-8"))
    with of_this_version(directory):
        return load(path)


@contextmanager
def of_this_version(directory: Path) -> Iterator[None]:
    """Turn errors of the scene of results in the block into an OutputError with the remedy for other versions."""
    try:
        yield
    except SceneError as error:
        why = f"{directory}: holds results of another version, whose scene is refused by this one"
        raise OutputError(
            f"{why} ({error}); show them with that version, or run the scene again, changed so"
        ) from None


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


def parsed_json(path: Path) -> dict[str, Any]:
    """The content of a JSON file of results; raises OutputError if missing or damaged."""
    with reading(path, REMEDY, error=OutputError):
        return dict(json.loads(path.read_text(encoding="utf-8")))
