"""Velocity on the centrelines of the driven cavity at one Reynolds number, with incipient from Python.

Run: python profiles.py REYNOLDS; prints one line of JSON: lines to draw, and values at Ghia's points.
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from references import ghia
from tables import ROOT

import incipient
from incipient.mesh.sampling import sample


def main(reynolds: float) -> None:
    scene = incipient.load(ROOT / "demos/scenes/cavity.toml", [f"fluid.reynolds={reynolds}"])
    velocity = incipient.run(scene).velocity

    def values(line: str, positions: np.ndarray) -> np.ndarray:
        """u along x = 0.5, or v along y = 0.5."""
        half = np.full_like(positions, 0.5)
        if line == "u":
            return sample(velocity, np.column_stack([half, positions]))[:, 0]
        return sample(velocity, np.column_stack([positions, half]))[:, 1]

    # Crowded towards the walls, where the profiles turn.
    positions = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 161)))
    profiles = {
        "positions": positions.round(6).tolist(),
        "lines": {line: values(line, positions).round(6).tolist() for line in ("u", "v")},
        "points": [
            {**point, "found": float(values(point["line"], np.array([point["position"]]))[0])}
            for point in ghia(reynolds)
        ],
    }
    print(json.dumps(profiles))


main(float(sys.argv[1]))
