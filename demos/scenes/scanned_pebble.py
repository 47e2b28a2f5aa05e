"""Writes a pebble as a scanner would see it: an ellipsoid with the bumps of nine spherical harmonics about random axes.

Run: python demos/scenes/scanned_pebble.py demos/scenes/pebble.stl 1280
"""

import sys
from pathlib import Path

import numpy as np
import trimesh
from numpy.polynomial.legendre import Legendre
from scipy.spatial.transform import Rotation

SEMI_AXES, ROUGHNESS, SEED = (0.6, 0.48, 0.36), 0.1, 7


def scan(file: str | Path, facets: int, turn: float = 0.0, write: bool = True) -> str:
    """Write the pebble to an STL file and give the setting of a scene that reads it. Not collective.

    facets: 20 times a power of four; their corners lie on the pebble
    turn:   other numbers put the facets elsewhere on the same pebble, as another scan would
    write:  False gives the setting alone, on ranks that do not write
    """
    ball = trimesh.creation.icosphere(round(np.log2(facets / 20) / 2))
    towards = Rotation.from_rotvec(turn * np.array([0.3, 0.2, 0.1])).apply(ball.vertices)
    random, bumps = np.random.default_rng(SEED), np.zeros(len(towards))
    for degree in (2, 3, 3, 4, 4, 5, 5, 6, 6):
        axis = random.normal(size=3)
        bumps += (
            random.normal() / degree * Legendre.basis(degree)(towards @ axis / np.linalg.norm(axis))
        )
    corners = towards * SEMI_AXES * (1.0 + ROUGHNESS * bumps[:, None])
    if write:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        trimesh.Trimesh(corners, ball.faces).export(file)
    return f'body.file="{Path(file).resolve()}"'


if __name__ == "__main__":
    scan(sys.argv[1], int(sys.argv[2]))
