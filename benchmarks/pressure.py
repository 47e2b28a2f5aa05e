"""Pressure difference across the cylinder of a run in a channel, from the fields it left.

Run: python pressure.py DIRECTORY; prints one line of JSON. The two points are nodes of the mesh.
"""

import json
import sys
from pathlib import Path

import numpy as np

from incipient.output.series_file import read_step

FRONT, BACK = (0.15, 0.2), (0.25, 0.2)


def main(directory: Path) -> None:
    step = read_step(directory / "fields")
    pressure = np.ravel(step.fields["pressure"])

    def at(place: tuple[float, float]) -> float:
        distances = np.linalg.norm(step.points[:, :2] - place, axis=1)
        if distances.min() > 1e-6:
            raise SystemExit(f"no node of the mesh lies at {place}")
        return float(pressure[distances.argmin()])

    print(json.dumps({"pressure": at(FRONT) - at(BACK)}))


main(Path(sys.argv[1]))
