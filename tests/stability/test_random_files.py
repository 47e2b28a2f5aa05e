"""Random files: a valid file, or one line that names it."""

from __future__ import annotations

import io
import os
import re
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random

import numpy as np
import pytest
import trimesh
from PIL import Image
from random_scenes import fate, limited

from incipient.errors import SceneError
from incipient.geometry.space.files import triangles_in
from incipient.scene import loads

# Files of meshes, heights and points at random: each is read, or refused in one line, without a warning.


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


def scene(use: str, name: str) -> str:
    around = AROUND.replace("width = 8.0\n", "") if use in ("line", "outline") else AROUND
    return around + USES[use].format(name=name)


# Uses of files in turn, by name or suffix.
OF_MESH = ("held", "resting", "surface")
OF_FILE = {"four.csv": ("heap",), ".csv": ("line", "outline"), ".asc": ("grid",)}
OF_FILE |= dict.fromkeys((".stl", ".ply", ".obj"), OF_MESH)


def use_of(path: Path, turn: int) -> str:
    uses = OF_FILE.get(path.name) or OF_FILE.get(path.suffix, ("heights",))
    return uses[turn % len(uses)]


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_files_of_grains_and_beds_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    """Every third that is read is laid out as well."""
    result: Counter[str] = Counter()
    for seed in range(1000):
        path = written(Random(seed), tmp_path)
        text = scene(use_of(path, seed), path.name)
        try:
            with limited(20):
                loads(text, tmp_path)
        except SceneError as error:
            said = str(error)
            assert "\n" not in said and len(said) < 500 and "Error(" not in said, said
            result["refused"] += 1
            continue
        result["read"] += 1
        if result["read"] % 3 == 0:
            result[fate(text, tmp_path, mesh=False)] += 1
    assert result["refused"] > 300 and result["read"] > 100 and result["planned"] > 16, result


# -- what is wrong with a file ------------------------------------------------------------------------


def encoded(write: Callable[[io.BytesIO], object]) -> bytes:
    write(stream := io.BytesIO())
    return stream.getvalue()


MESHES = [
    ("a.ply", PLY.format(top=1, last=99), "has a triangle of vertex 99 (counted from 0) but 4"),
    ("b.ply", PLY.format(top=1, last=-1), "has a triangle of vertex -1 (counted from 0) but 4"),
    ("c.ply", PLY.format(top="1e300", last=3), "has a vertex that is not finite"),
    ("d.obj", OBJ.format(last=0), "line 8 names vertex 0; OBJ files count from 1"),
    ("e.obj", OBJ.format(last="1_2"), "cannot be read"),
    ("f.obj", OBJ.format(last=4).replace("1", "1e300", 1), "has a coordinate of 1e+300"),
    ("g.obj", OBJ.format(last=4).replace("1", "nan", 1), "has a vertex that is not finite"),
    ("h.obj", OBJ.format(last=4).replace("v 1", "v a"), "cannot be read"),
    ("i.stl", "solid nothing\nendsolid\n", "i.stl"),
]
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
PIPE = "is a pipe or a device; give the name of"
# Use, name and content of a file (None: a pipe), more of the section, and why it is refused.
REFUSED = [
    *((use, name, text, "", f".file: .*{re.escape(why)}") for name, text, why in MESHES for use in ("held", "surface")),
    ("held", "open.obj", OBJ.partition("f 2 3")[0], "", "open.obj.*is not watertight"),
    *((use, name, None, "", PIPE) for use, name in (
        ("held", "pipe.stl"), ("surface", "pipe.obj"), ("heights", "pipe.png"), ("line", "pipe.csv"))),
    *(("line", "bed.csv", f"0,0\n4,{cell}\n8,0\n", "", r'bed\.file: .*bed\.csv line 2 is "4,')
      for cell in ("1_0", "٣", "inf", "0x1")),
    *(("heights", "map.npy", encoded(lambda file, kind=kind: np.save(file, np.zeros((9, 9), kind))), "", why)
      for kind, why in (
          (complex, "holds values of type complex128.*; save real numbers"),
          ("M8[s]", "holds values of type datetime64"))),
    # Of which Pillow warns.
    ("heights", "map.png", encoded(lambda file: Image.new("1", (10_000, 10_000)).save(file, "PNG")), "",
     r"has 1e\+08 heights; give 250000 at most"),
    *(("surface", "bed.obj", SQUARE, more, re.escape(why)) for more, why in (
        ("cell = [0.0, 1.0]", "bed.cell[0]: is 0.0; give a number greater than 0"),
        ("cell = [nan, 1.0]", "bed.cell[0]: is nan; give a finite number"),
        ("cell = [1e-9, 1e-9]", "has 6.4e+19 heights; give 250000 at most, or a larger cell"),
        ("scale = -1.0", "bed.scale: is -1.0; give a number greater than 0"),
        ('scale = "big"', 'bed.scale: is "big"; give a number'))),
]  # fmt: skip


@pytest.mark.parametrize(("use", "name", "content", "more", "why"), REFUSED)
@pytest.mark.filterwarnings("error")
def test_what_is_wrong_with_a_file_is_said(
    use: str, name: str, content: str | bytes | None, more: str, why: str, tmp_path: Path
) -> None:
    """Nobody writes to pipes: to read one would wait for ever."""
    if content is None:
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    kept = [
        line for line in scene(use, name).splitlines() if line.split(" ")[0] != more.split(" ")[0]
    ]
    with pytest.raises(SceneError, match=why):
        loads("\n".join([*kept, more]), tmp_path)


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


# Files of meshes, heights and points at random, around valid ones: odd numbers, wrong indices, changed bytes.


ODD = (  # numbers
    "nan",
    "inf",
    "-inf",
    "1e300",
    "-1e300",
    "1e31",
    "1e-300",
    "0",
    "-0",
    "-1",
    "99",
    "1_2",
    "٣",
    "x",
    "",
    "1e",
    "7" * 400,
)
FORMATS = {
    "ascii.stl": {"file_type": "stl_ascii"},
    "binary.stl": {"file_type": "stl"},
    "ascii.ply": {"file_type": "ply", "encoding": "ascii"},
    "binary.ply": {"file_type": "ply"},
    "plain.obj": {"file_type": "obj"},
}  # fmt: skip
RASTER = "\n".join(
    " ".join(f"{0.1 * ((3 * i + 5 * j) % 7):.4g}" for i in range(9)) for j in range(9)
)
TABLES = {
    "map.asc": "ncols 9\nnrows 9\nxllcenter 0\nyllcenter 0\ncellsize 1.0\nNODATA_value -9999\n"
    + RASTER,
    "two.csv": "".join(f"{k},{0.1 * (k % 3):.1f}\n" for k in range(-1, 10)),
    "four.csv": "x,y,z,radius\n" + "".join(f"{k},0.1,0.2,0.5\n" for k in range(-1, 10)),
}
KINDS = (*FORMATS, *TABLES, "map.npy", "map.png", "map.tif")


def written(random: Random, directory: Path) -> Path:
    """A file of a kind by chance, rarely without a mistake; its name tells the kind."""
    kind = random.choice(KINDS)
    data = _valid(kind)
    with suppress(UnicodeDecodeError):
        data = _with_odd_numbers(random, data.decode()).encode()
    if random.random() < 0.3:
        data = _spoilt(random, data)
    path = directory / kind
    path.write_bytes(data)
    return path


def _valid(kind: str) -> bytes:
    if kind in FORMATS:
        box = trimesh.creation.box((1.0, 1.0, 1.0)).export(**FORMATS[kind])
        return box if isinstance(box, bytes) else box.encode()
    if kind in TABLES:
        return TABLES[kind].encode()
    grey = np.random.default_rng(0).integers(0, 256, (9, 9)).astype(np.uint8)
    if kind == "map.npy":
        return encoded(lambda file: np.save(file, grey / 256))
    name = "PNG" if kind == "map.png" else "TIFF"
    return encoded(lambda file: Image.fromarray(grey).save(file, name))


def _with_odd_numbers(random: Random, text: str) -> str:
    """The text, some of whose words are odd numbers, by chance with other ends or separators."""
    parts = re.split(r"([\s,]+)", text)
    for _ in range(random.choice((0, 0, 1, 2))):
        parts[2 * random.randrange((len(parts) + 1) // 2)] = random.choice(ODD)
    old, new = random.choice(
        (("", ""),) * 4 + ((",", ";"), (",", "\t"), ("\n", "\r\n"), ("\n", "\n\n# a note\n"))
    )
    return "".join(parts).replace(old, new) if old else "".join(parts)


def _spoilt(random: Random, data: bytes) -> bytes:
    """The data cut short, or with some bytes changed."""
    if not data or random.random() < 0.3:
        return data[: random.randrange(len(data) + 1)]
    changed = bytearray(data)
    for _ in range(random.choice((1, 3, 30))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)
