"""A small scene with each kind of grain, bed and flow, as plain data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

Section = dict[str, Any]
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0.5 0.9 0\nv 0.5 0.3 0.8\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
SURFACE = "v -1 -1 0.1\nv 9 -1 0.1\nv 9 9 0.3\nv -1 9 0.3\nf 1 2 3\nf 1 3 4\n"

GRAINS: list[Section] = [
    {"shape": "disc", "diameter": 1.0},
    {"shape": "ellipse", "semi_axes": [0.6, 0.4]},
    {"shape": "rectangle", "width": 1.0, "height": 0.6, "corner_radius": 0.1},
    {"shape": "polygon", "vertices": [[0, 0], [1, 0.1], [0.9, 0.8], [0.2, 0.7]]},
    {"shape": "superellipse", "semi_axes": [0.5, 0.4], "exponent": 4.0},
    {"shape": "star", "radius": 0.5, "cosines": [0.0, 0.2]},
    {"shape": "discs", "discs": [[0, 0, 0.5], [0.6, 0.1, 0.4]]},
]
BEDS: list[Section] = [
    {"kind": "flat"},
    {"kind": "inclined", "slope": 10.0},
    {"kind": "sinusoidal", "amplitude": 0.1, "wavelength": 1.5, "phase": 30.0},
    {"kind": "half-discs", "radius": 0.3, "spacing": 0.7},
    {"kind": "polyline", "points": [[-1, 0], [3, 0.2], [5, 0.0], [9, 0.1]]},
]
SOLIDS: list[Section] = [
    {"shape": "sphere", "diameter": 1.0},
    {"shape": "ellipsoid", "semi_axes": [0.6, 0.5, 0.4]},
    {"shape": "superquadric", "semi_axes": [0.6, 0.5, 0.4], "exponents": [4.0, 3.0]},
    {"shape": "box", "sides": [1.0, 0.8, 0.6], "edge_radius": 0.1},
    {"shape": "polyhedron", "vertices": [[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 0.8]]},
    {"shape": "spheres", "spheres": [[0, 0, 0, 0.5], [0.5, 0.1, 0.1, 0.4]]},
    {"shape": "mesh", "file": "grain.obj", "size": 1.0},
    {"shape": "capsule", "diameter": 0.6, "length": 1.0},
    {"shape": "cylinder", "diameter": 1.0, "length": 8.0},
]
TERRAINS: list[Section] = [
    {"kind": "flat"},
    {"kind": "inclined", "slope": 10.0},
    {"kind": "spheres", "radius": 1.0, "spacing": 2.4},
    {"kind": "heap", "spheres": [[3.6, 4.0, -0.3, 0.5]]},
    {"kind": "ridges", "amplitude": 0.1, "wavelength": 2.0},
    {"kind": "height-map", "file": "map.npy", "cell": [0.5, 0.5]},
    {"kind": "mesh", "file": "bed.obj", "cell": [1.0, 1.0]},
]
# A cylinder cannot rest; to follow a superquadric that rocks takes minutes.
HELD = {"cylinder": 0.6, "superquadric": 0.46}
FLOWS: list[Section] = [
    {"kind": "shear", "rate": 1.0},
    {"kind": "poiseuille", "velocity": 2.0},
    {"kind": "open-channel"},
    {"kind": "uniform"},
    {"kind": "still"},
    {"kind": "expression", "components": ["y*(4 - y)", "0"]},
]


def every_grain_and_bed() -> dict[str, Section]:
    """By its name a scene with each kind of grain on a flat bed, and a disc or sphere on each kind of bed."""
    result = {f"{grain['shape']} on flat": resting(grain, BEDS[0]) for grain in GRAINS + SOLIDS}
    result |= {f"disc on {bed['kind']}": resting(GRAINS[0], bed) for bed in BEDS}
    result |= {f"sphere on {bed['kind']}": resting(SOLIDS[0], bed) for bed in TERRAINS}
    return result


def resting(grain: Section, bed: Section) -> Section:
    """A grain that rests in shear, some held there, on the coarsest cells."""
    domain, place = {"length": 8.0, "height": 4.0}, {"x": 4.0, "density": 2.65}
    if grain in SOLIDS:
        domain["width"] = 8.0
        place |= {"y": 4.0}
    if height := HELD.get(grain["shape"]):
        place = {"centre": [4.0, 4.0, height]}
    return {
        "domain": domain,
        "fluid": {"reynolds": 1.0, "scale": "grain"},
        "flow": {"kind": "shear"},
        "body": {**grain, **place},
        "bed": bed,
        "gravity": {"acceleration": 100.0},
        "contact": {"friction": 0.5, "gap": 0.05},
        "numerics": {"mesh_size": 5.0, "order": 2, "error_bars": False},
        "output": {"fields": False},
    }


def write_files(directory: Path) -> None:
    """Write the files that these scenes name."""
    (directory / "grain.obj").write_text(TETRAHEDRON)
    (directory / "bed.obj").write_text(SURFACE)
    x, y = np.meshgrid(np.linspace(0.0, 8.0, 17), np.linspace(0.0, 8.0, 17))
    np.save(directory / "map.npy", 0.2 + 0.1 * np.sin(x) * np.cos(y))
