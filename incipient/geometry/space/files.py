"""Surfaces of triangles in STL, PLY and OBJ files."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from incipient.arrays import LARGEST, SMALLEST, Floats, Integers, decimal
from incipient.errors import SceneError, refuse_broken
from incipient.input_files import reading


def triangles_in(path: str | Path) -> tuple[Floats, Integers]:
    """Vertices (n, 3), all of them used, and triangles (m, 3) of an STL, PLY or OBJ file.

    Raises SceneError if the file cannot be read, or its vertices are missing or out of range.
    """
    path = Path(path)
    kind, remedy = (
        path.suffix.lower(),
        "give the name of an STL, PLY or OBJ file, or export it again",
    )
    with reading(path, remedy, 256, name=str(path)):  # MiB: five million triangles
        if kind not in (".stl", ".ply", ".obj"):
            raise SceneError(f"{path} is not an STL, PLY or OBJ file; convert it")
        points, triangles = _obj(path) if kind == ".obj" else _by_trimesh(path)
    return _checked(path, points, triangles)


def _by_trimesh(path: Path) -> tuple[Floats, Integers]:
    import trimesh

    mesh: Any = trimesh.load(path, force="mesh", process=False)
    points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    return points, np.array(mesh.faces).astype(np.int64).reshape(-1, 3)


def _obj(path: Path) -> tuple[Floats, Integers]:
    """Vertices are counted from 1, or back from the last one."""
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    lines = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ").splitlines()
    for number, line in enumerate(lines, 1):
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            points.append([decimal(item) for item in rest[:3]])
            if len(rest) < 3:
                raise SceneError(
                    f"{path} line {number} has no vertex of three coordinates; export it again"
                )
        elif word == "f":
            around = [_index(path, number, item, len(points)) for item in rest]
            triangles += [(around[0], b, c) for b, c in pairwise(around[1:])]
    return np.array(points).reshape(-1, 3), np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _index(path: Path, line: int, text: str, before: int) -> int:
    decimal(text.partition("/")[0])  # which refuses what Python reads otherwise
    number = int(text.partition("/")[0])
    if number == 0:
        raise SceneError(
            f"{path} line {line} names vertex 0; OBJ files count from 1, export it again"
        )
    return number - 1 if number > 0 else before + number


def _checked(path: Path, points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    if len(triangles) == 0:
        raise SceneError(f"{path} holds no triangles; export it again")
    if len(wrong := triangles[(triangles < 0) | (triangles >= len(points))]):
        raise SceneError(
            f"{path} has a triangle of vertex {wrong[0]} (counted from 0) but {len(points)} vertices; "
            "export it again"
        )
    used, triangles = np.unique(triangles, return_inverse=True)
    points = points[used]
    largest, extent = float(np.abs(points).max()), float(np.ptp(points, axis=0).max())
    refuse_broken(
        (
            not np.isfinite(points).all(),
            f"{path} has a vertex that is not finite; give finite numbers",
        ),
        (
            largest > LARGEST,
            f"{path} has a coordinate of {largest:g}; give numbers of at most {LARGEST:g} in size",
        ),
        (
            extent < SMALLEST,
            f"{path} measures {extent:g} from end to end; give it at least {SMALLEST:g}",
        ),
    )
    return points, triangles.reshape(-1, 3)
