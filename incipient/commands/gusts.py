"""`incipient gust`."""

from __future__ import annotations

import argparse
from pathlib import Path

import incipient

from ..critical.gusts import runs_expected
from ..parallel import Comm
from ..progress import telling
from .drawing import tell_of_pictures


def gust(options: argparse.Namespace, comm: Comm) -> int:
    """Searches the weakest gusts that move the grain out of its pocket."""
    scene, durations = incipient.load(options.scene, options.overrides, comm), options.durations
    directory = options.out or Path("results") / f"{options.scene.stem}_gusts"
    with telling(comm.rank) as voice:
        runs = runs_expected(durations, scene.numerics.error_bars)
        voice.say(f"{options.scene}: {len(durations)} durations, about {runs} runs, each as `incipient run`")
        found = incipient.gusts(scene, durations, directory, comm, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / 'gusts.csv'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0
