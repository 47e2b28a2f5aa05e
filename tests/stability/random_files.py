"""Files of meshes, heights and points at random, around valid ones: odd numbers, wrong indices, changed bytes."""

from __future__ import annotations

import io
import math
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

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
