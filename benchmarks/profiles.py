"""Velocity on the centrelines of the driven cavity at one Reynolds number, with incipient from Python.

Run: python profiles.py REYNOLDS MESH_SIZE; prints one line of JSON: lines to draw, and values at Ghia's points.
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
from references import ghia

import incipient
from incipient.mesh.sampling import sample

SCENE = Path(__file__).parents[1] / "demos/scenes/cavity.toml"
COMPONENT = {"u": 0, "v": 1}


def places(line: str, s: np.ndarray) -> np.ndarray:
    """Points of the line x = 0.5 (for u) or y = 0.5 (for v)."""
    half = np.full_like(s, 0.5)
    return np.column_stack([half, s] if line == "u" else [s, half])


def main(reynolds: float, size: float) -> None:
    settings = [f"fluid.reynolds={reynolds}", f"numerics.mesh_size={size}"]
    result = incipient.run(incipient.load(SCENE, settings))

    def values(line: str, s: np.ndarray) -> np.ndarray:
        return sample(result.velocity, places(line, s))[:, COMPONENT[line]]

    # Crowded towards the walls, where the profiles turn.
    s = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 161)))
    lines = {line: values(line, s).round(6).tolist() for line in COMPONENT}
    points = [
        {**asdict(p), "found": float(values(p.line, np.array([p.position]))[0])}
        for p in ghia()
        if p.reynolds == reynolds
    ]
    extrema = {name: asdict(extremum) for name, extremum in result.centrelines.items()}
    print(
        json.dumps(
            {"positions": s.round(6).tolist(), "lines": lines, "points": points, "extrema": extrema}
        )
    )


main(float(sys.argv[1]), float(sys.argv[2]))
