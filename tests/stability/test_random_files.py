"""Random files: a valid file, or one line that names it."""

from __future__ import annotations

import io
import math
import os
import re
import warnings
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image
from random_scenes import fate, limited

from incipient.errors import SceneError
from incipient.geometry.space.files import triangles_in
from incipient.scene import loads

# Files of meshes, heights and points at random: each is read, or refused in one line, without a warning.


USUAL = settings(
    derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)
AROUND = """
[domain]
length = 8.0
height = 4.0
width = 8.0
[fluid]
reynolds = 1.0
scale = "flow"
[flow]
kind = "shear"
"""
GRAIN = '[body]\nshape = "mesh"\nsize = 1.0\nfile = "{name}"\n'
USES = {
    "held": GRAIN + "centre = [4.0, 4.0, 2.0]\n",
    "resting": GRAIN + 'x = 4.0\n[bed]\nkind = "flat"\n',
    "surface": '[bed]\nkind = "mesh"\nscale = 8.0\nfile = "{name}"\n',
    "heights": '[bed]\nkind = "height-map"\nrelief = 0.5\ncell = [1.0, 1.0]\nfile = "{name}"\n',
    "line": '[bed]\nkind = "polyline"\nfile = "{name}"\n',
    "outline": '[body]\nshape = "polygon"\nfile = "{name}"\ncentre = [4.0, 2.0]\n',
    "heap": '[bed]\nkind = "heap"\nfile = "{name}"\n',
    "grid": '[bed]\nkind = "height-map"\nrelief = 0.5\nfile = "{name}"\n',
}
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 {last}\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n0 0 {top}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 {last}\n"
)


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


def scene(use: str, name: str) -> str:
    around = AROUND.replace("width = 8.0\n", "") if use in ("line", "outline") else AROUND
    return around + USES[use].format(name=name)


def use_of(path: Path, turn: int) -> str:
    """What a file is used for, in turn where there are several uses."""
    if path.suffix == ".asc":
        return "grid"
    if path.suffix == ".csv":
        return "heap" if path.name == "four.csv" else ("line", "outline")[turn % 2]
    return (
        ("held", "resting", "surface")[turn % 3]
        if path.suffix in (".stl", ".ply", ".obj")
        else "heights"
    )


def tried(number: int, directory: Path) -> Counter[str]:
    """What becomes of so many files, chosen by hypothesis; every third that is read is laid out as well."""
    found: Counter[str] = Counter()

    @settings(USUAL, max_examples=number)
    # Seeds alone are drawn: hypothesis otherwise prefers numbers that stand in the package's source, and the counts
    # below change with every edit of it.
    @given(st.randoms(use_true_random=True), st.integers(0, 14))
    def one(random: object, turn: int) -> None:
        path = written(random, directory)
        text = scene(use_of(path, turn), path.name)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                with limited(20):
                    loads(text, directory)
                found["read"] += 1
            except SceneError as error:
                said = str(error)
                assert "\n" not in said and len(said) < 500 and "Error(" not in said, said
                found["refused"] += 1
                return
            if found["read"] % 3 == 0:
                found[fate(text, directory, mesh=False)] += 1

    one()
    return found


@pytest.mark.slow
def test_mesh_files_and_height_maps_are_read_or_refused_in_one_line(directory: Path) -> None:
    found = tried(300, directory)
    assert found["refused"] > 100 and found["read"] > 30 and found["planned"] > 5, found


@pytest.mark.slow
def test_many_mesh_files_and_height_maps_are_read_or_refused_in_one_line(directory: Path) -> None:
    found = tried(3000, directory)
    assert found["refused"] > 1000 and found["read"] > 300 and found["planned"] > 50, found


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        (
            "a.ply",
            PLY.format(top=1, last=99),
            "has a triangle of vertex 99 (counted from 0) but 4 vertices",
        ),
        (
            "b.ply",
            PLY.format(top=1, last=-1),
            "has a triangle of vertex -1 (counted from 0) but 4 vertices",
        ),
        ("c.ply", PLY.format(top="1e300", last=3), "has a vertex that is not finite"),
        ("d.obj", OBJ.format(last=0), "line 8 names vertex 0; OBJ files count from 1"),
        ("e.obj", OBJ.format(last="1_2"), "cannot be read"),
        ("f.obj", OBJ.format(last=4).replace("1", "1e300", 1), "has a coordinate of 1e+300"),
        ("g.obj", OBJ.format(last=4).replace("1", "nan", 1), "has a vertex that is not finite"),
        ("h.obj", OBJ.format(last=4).replace("v 1", "v a"), "cannot be read"),
    ],
)
@pytest.mark.parametrize("use", ["held", "surface"])
def test_what_is_wrong_with_a_mesh_file_is_said(
    name: str, text: str, why: str, use: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(SceneError, match=re.escape(why)) as told:
        loads(scene(use, name), tmp_path)
    assert f"{'bed' if use == 'surface' else 'body'}.file: " in str(told.value)


def test_obj_files_may_count_back_from_the_last_vertex_before_a_face(tmp_path: Path) -> None:
    """A face between the vertices, one of four corners; vertices that nothing uses are left out."""
    path = tmp_path / "grain.obj"
    path.write_text(
        "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3/1 -2/2 -1/3\nv 0 0 1\nv 5 5 5\nf 2//1 3//1 4//1 5//1\n"
    )
    points, triangles = triangles_in(path)
    assert points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert triangles.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]


def test_a_point_that_no_triangle_uses_does_not_make_a_grain_larger(tmp_path: Path) -> None:
    (tmp_path / "plain.obj").write_text(OBJ.format(last=4) + "v 90 0 0\n")
    text = scene("held", "plain.obj").replace("size = 1.0\n", "")
    assert loads(text, tmp_path).grain.size == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize(
    ("kind", "use"), [("pipe.stl", "held"), ("pipe.obj", "surface"), ("pipe.png", "heights")]
)
def test_pipes_are_refused_at_once(kind: str, use: str, tmp_path: Path) -> None:
    """Nobody writes to them: to read one would wait for ever."""
    os.mkfifo(tmp_path / kind)
    with pytest.raises(SceneError, match="is a pipe or a device; give the name of"):
        loads(scene(use, kind), tmp_path)


@pytest.mark.parametrize("cell", ["1_0", "٣", "inf", "0x1"])
def test_cells_of_tables_are_plain_numbers(cell: str, tmp_path: Path) -> None:
    (tmp_path / "bed.csv").write_text(f"0,0\n4,{cell}\n8,0\n", encoding="utf-8")
    text = AROUND.replace("width = 8.0\n", "") + '[bed]\nkind = "polyline"\nfile = "bed.csv"\n'
    with pytest.raises(SceneError, match=r'bed\.file: .*bed\.csv line 2 is "4,'):
        loads(text, tmp_path)
    (tmp_path / "bed.csv").unlink()
    os.mkfifo(tmp_path / "bed.csv")
    with pytest.raises(SceneError, match=r"bed\.csv is a pipe or a device"):
        loads(text, tmp_path)


def test_height_maps_hold_real_numbers_and_few(tmp_path: Path) -> None:
    for table, why in (
        (np.zeros((9, 9), complex), "complex128"),
        (np.zeros((9, 9), "M8[s]"), "datetime64"),
    ):
        np.save(tmp_path / "map.npy", table)
        with pytest.raises(SceneError, match=f"holds values of type {why}.*; save real numbers"):
            loads(scene("heights", "map.npy"), tmp_path)
    Image.new("1", (10_000, 10_000)).save(tmp_path / "map.png")  # of which Pillow warns
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SceneError, match="has 1e\\+08 heights; give 250000 at most"):
            loads(scene("heights", "map.png"), tmp_path)


@pytest.mark.parametrize(
    ("key", "value", "remedy"),
    [
        ("cell", "[0.0, 1.0]", "bed.cell[0]: is 0.0; give a number greater than 0"),
        ("cell", "[nan, 1.0]", "bed.cell[0]: is nan; give a finite number"),
        ("cell", "[1e-9, 1e-9]", "has 6.4e+19 heights; give 250000 at most, or a larger cell"),
        ("scale", "-1.0", "bed.scale: is -1.0; give a number greater than 0"),
        ("scale", '"big"', 'bed.scale: is "big"; give a number'),
    ],
)
def test_a_surface_is_read_by_sensible_numbers(
    key: str, value: str, remedy: str, tmp_path: Path
) -> None:
    (tmp_path / "bed.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    text = scene("surface", "bed.obj")
    text = (
        text.replace("scale = 8.0", f"scale = {value}")
        if key == "scale"
        else f"{text}{key} = {value}\n"
    )
    with pytest.raises(SceneError, match=re.escape(remedy)):
        loads(text, tmp_path)


# Files of meshes, heights and points at random, around valid ones: odd numbers, wrong indices, changed bytes.


ODD = (
    "nan",
    "inf",
    "-inf",
    "1e300",
    "-1e300",
    "1e31",
    "1e-300",
    "0",
    "-0",
    "1_2",
    "٣",
    "x",
    "",
    "1e",
    "7" * 400,
)
CORNERS = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
SIDES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]
KINDS = (
    "ascii.stl",
    "binary.stl",
    "ascii.ply",
    "binary.ply",
    "plain.obj",
    "map.npy",
    "map.png",
    "map.tif",
    "map.asc",
    "two.csv",
    "four.csv",
)


def written(random: Random, directory: Path) -> Path:
    """A file of a kind by chance, rarely without a mistake; its name tells the kind."""
    kind = random.choice(KINDS)
    made = {
        "stl": _stl,
        "ply": _ply,
        "obj": _obj,
        "npy": _npy,
        "png": _image,
        "tif": _image,
        "asc": _asc,
        "csv": _csv,
    }
    data = made[kind[-3:]](random, kind)
    if random.random() < 0.3:
        data = _spoilt(random, data)
    path = directory / kind
    path.write_bytes(data)
    return path


def _vertices(random: Random) -> list[list[str]]:
    """The corners of a box as text, some of them odd."""
    scale = random.choice((1e-25, 1e-6, 1.0, 1.0, 1.0, 10.0, 1e6, 1e20))
    sides = [
        scale * random.choice((1.0, 1.0, 1e-3, 0.0)) if random.random() < 0.3 else scale
        for _ in range(3)
    ]
    found = [[repr(x * side) for x, side in zip(corner, sides, strict=True)] for corner in CORNERS]
    for _ in range(random.choice((0, 0, 1, 2))):
        random.choice(found)[random.randrange(3)] = random.choice(ODD)
    return found


def _faces(random: Random) -> list[list[int]]:
    """The triangles of a box, some of them odd."""
    found = [list(side) for side in SIDES]
    for _ in range(random.choice((0, 0, 1))):
        random.choice(found)[random.randrange(3)] = random.choice(
            (-1, 8, 99, -(2**31), 2**31 - 1, 0)
        )
    if random.random() < 0.1:
        del found[random.randrange(len(found)) :]
    return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _stl(random: Random, kind: str) -> bytes:
    points, faces = (
        _vertices(random),
        [face for face in _faces(random) if min(face) >= 0 and max(face) < 8],
    )
    if kind.startswith("binary"):
        table = np.zeros(
            len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("end", "<u2")]
        )
        with np.errstate(over="ignore"):
            table["corners"] = np.array(
                [[[_number(x) for x in points[i]] for i in f] for f in faces]
            ).reshape(-1, 3, 3)
        count = random.choice((len(faces),) * 4 + (0, 10**9))
        return bytes(80) + np.uint32(count).tobytes() + table.tobytes()
    facets = ("\n".join(f"vertex {' '.join(points[i])}" for i in face) for face in faces)
    body = "\n".join(
        f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet" for corners in facets
    )
    return f"solid box\n{body}\nendsolid box\n".encode()


def _ply(random: Random, kind: str) -> bytes:
    points, faces = _vertices(random), _faces(random)
    form = "binary_little_endian" if kind.startswith("binary") else "ascii"
    counts = (
        random.choice((len(points),) * 6 + (0, 9, 10**9)),
        random.choice((len(faces),) * 6 + (0, 10**9)),
    )
    head = f"ply\nformat {form} 1.0\nelement vertex {counts[0]}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += f"element face {counts[1]}\nproperty list uchar int vertex_indices\nend_header\n"
    if form == "ascii":
        lines = [" ".join(point) for point in points] + [
            f"3 {' '.join(map(str, face))}" for face in faces
        ]
        return (head + "\n".join(lines) + "\n").encode()
    places = np.array([[_number(x) for x in point] for point in points]).tobytes()
    return (
        head.encode()
        + places
        + b"".join(b"\x03" + np.array(face, dtype="<i4").tobytes() for face in faces)
    )


def _obj(random: Random, kind: str) -> bytes:
    first = random.choice((1, 1, 1, 0))
    lines = [f"v {' '.join(point)}" for point in _vertices(random)]
    lines += [f"f {' '.join(str(i + first) for i in face)}" for face in _faces(random)]
    return ("\n".join(lines) + "\n").encode()


def _heights(random: Random) -> NDArray[Any]:
    """A table of heights, by chance of an odd shape, type or value."""
    shape = random.choice(((9, 9),) * 5 + ((2, 2), (1, 9), (0, 4), (9,), (3, 3, 3), (600, 600)))
    table: NDArray[Any] = np.random.default_rng(random.randrange(9)).normal(
        0.0, random.choice((0.01, 0.3)), shape
    )
    if table.size and random.random() < 0.3:
        table.flat[random.randrange(table.size)] = _number(random.choice(ODD))
    return table


def _npy(random: Random, kind: str) -> bytes:
    table, stream = _heights(random), io.BytesIO()
    types = (float,) * 5 + (
        np.float32,
        np.longdouble,
        complex,
        np.int8,
        bool,
        "U8",
        "M8[s]",
        object,
    )
    with np.errstate(all="ignore"):
        numbers = (
            table if table.dtype == float and np.isfinite(table).all() else np.nan_to_num(table)
        )
        kind_of = random.choice(types)
        np.save(
            stream,
            (table if kind_of in (float, complex, np.longdouble) else numbers.clip(-9, 9)).astype(
                kind_of
            ),
        )
    return stream.getvalue()


def _image(random: Random, kind: str) -> bytes:
    stream, grey = io.BytesIO(), np.random.default_rng(random.randrange(9)).integers(0, 256, (9, 9))
    mode = random.choice(
        (
            "L",
            "L",
            "RGB",
            "RGBA",
            "LA",
            "P",
            "1",
            "I;16",
            *(("F", "CMYK") if kind == "map.tif" else ()),
        )
    )
    image = Image.fromarray(grey.astype(np.uint16 if mode == "I;16" else np.uint8))
    (image if mode == "I;16" else image.convert(mode)).save(
        stream, "PNG" if kind == "map.png" else "TIFF"
    )
    return stream.getvalue()


def _asc(random: Random, kind: str) -> bytes:
    table = np.random.default_rng(random.randrange(9)).normal(0.0, 0.1, (9, 9))
    rows = [[f"{height:.4g}" for height in row] for row in table]
    head = {
        "ncols": "9",
        "nrows": "9",
        "xllcenter": "0",
        "yllcenter": "0",
        "cellsize": "1.0",
        "NODATA_value": "-9999",
    }
    for _ in range(random.choice((0, 1, 2))):
        if random.random() < 0.5:
            head[random.choice(list(head))] = random.choice((*ODD, "-9", "8", "1.5", "1e9"))
        else:
            random.choice(rows)[random.randrange(9)] = random.choice(ODD)
    if random.random() < 0.1:
        del head[random.choice(list(head))]
    lines = [f"{word} {number}" for word, number in head.items()] + [" ".join(row) for row in rows]
    return ("\n".join(lines) + "\n").encode()


def _csv(random: Random, kind: str) -> bytes:
    """Points of a bed or an outline, or spheres: some rows odd, short or long, at times with a head or a blank line."""
    columns = 2 if kind == "two.csv" else 4
    rows = [[str(k), str(0.1 * (k % 3)), "0.2", "0.5"][:columns] for k in range(-1, 10)]
    for _ in range(random.choice((0, 0, 1, 2))):
        row = random.choice(rows)
        row[random.randrange(columns) if len(row) == columns else 0] = random.choice(ODD)
        if random.random() < 0.3:
            row += [random.choice(ODD)]
        elif random.random() < 0.3:
            row.pop()
    between = random.choice((",", ",", ",", ";", " ", "\t"))
    lines = [between.join(row) for row in rows]
    if random.random() < 0.3:
        lines.insert(0, ",".join("xyzr"[:columns]))
    if random.random() < 0.2:
        lines.insert(random.randrange(len(lines)), random.choice(("", "# a note", "\ufeff")))
    return random.choice(("\n", "\n", "\r\n", "\r")).join(lines).encode("utf-8")


def _spoilt(random: Random, data: bytes) -> bytes:
    """The data cut short, or with some bytes changed."""
    if not data or random.random() < 0.3:
        return data[: random.randrange(len(data) + 1)]
    changed = bytearray(data)
    for _ in range(random.choice((1, 3, 30))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)
