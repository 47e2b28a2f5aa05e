"""Processor seconds that outlines of very many vertices take: a scene planned, a scanned pebble laid on a plane.

Usage: outline_times.py VERTICES FREQUENCY. The outline is that of tests/unit/test_outline.py, the pebble of
20 FREQUENCY^2 triangles that of tests/unit/test_triangulations.py. Prints one line of JSON.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "unit"))

from test_outline import written_scene
from test_triangulations import scanned

from incipient import load
from incipient.accuracy.first_mesh import counted
from incipient.geometry import Plane, rest


def main() -> None:
    """Print one line of JSON."""
    vertices, frequency = map(int, sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        lowered = written_scene(Path(folder), vertices, settle=False)
        times = {"lowered": _seconds(lambda: counted(load(lowered)))}
        settled = written_scene(Path(folder), vertices, settle=True)
        times["settled"] = _seconds(lambda: counted(load(settled)))
    times["scanned"] = _seconds(lambda: rest(scanned(frequency), Plane(), (0.07, 0.13)))
    print(json.dumps({"seconds": times}))


def _seconds(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return round(time.process_time() - began, 3)


main()
