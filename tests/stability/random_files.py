"""Thousands of scene files at random, each in a process that is ended when it hangs: what became of them.

`python random_files.py FIRST LAST` prints what becomes of each, a line a scene.
"""

from __future__ import annotations

import logging
import os
import selectors
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from random_scenes import HANGING, fate, odd_scene_text, scene_text

MESHED, RUN = 20, 50  # of so many scenes one is meshed as well, of so many one is run
LOADING = 60  # seconds more for the first scene of a process


@dataclass
class Fates:
    """How many scenes came to which end, and the numbers of those that failed with what they failed with."""

    counts: Counter[str] = field(default_factory=Counter)
    failed: dict[int, str] = field(default_factory=dict)

    def add(self, number: int, end: str) -> None:
        """Count one scene."""
        if end.startswith("FAILED"):
            self.failed[number] = end
        else:
            self.counts[end] += 1


def one(number: int) -> str:
    """What becomes of a scene file, by its number; its failure in a line."""
    random, nowhere = Random(number), Path(os.devnull).parent
    run = number % RUN == 0
    text = odd_scene_text(random) if run else scene_text(random)
    try:
        return fate(text, nowhere, mesh=number % MESHED == 1, run=run)
    except BaseException as error:
        return " ".join(f"FAILED {type(error).__name__} {error}".split())[:200]


def fates(count: int) -> Fates:
    """What becomes of the first `count` scene files."""
    found, first = Fates(), 0
    while first < count:
        first = _some(first, count, found)
    return found


def _some(first: int, last: int, found: Fates) -> int:
    """Look at scenes in a new process until it ends or hangs; the first that is left."""
    command = [sys.executable, __file__, str(first), str(last)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1)
    assert child.stdout is not None
    number, patience = first, float(2 * HANGING + LOADING)
    with selectors.DefaultSelector() as selector:
        selector.register(child.stdout, selectors.EVENT_READ)
        while number < last:
            line = child.stdout.readline() if selector.select(patience) else None
            if not line:
                why = "hangs" if line is None else "ended its process"
                child.kill()
                child.wait()
                found.add(number, f"FAILED {why}")
                return number + 1
            found.add(number, line.rstrip("\n"))
            number, patience = number + 1, 2.0 * HANGING
    child.wait()
    return number


def main() -> int:
    logging.disable(logging.CRITICAL)
    spoken = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what libraries print must not be taken for an answer
    for number in range(int(sys.argv[1]), int(sys.argv[2])):
        print(one(number), file=spoken, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
