"""`incipient gust` and `incipient entrainment`."""

from __future__ import annotations

import argparse
from pathlib import Path

import incipient

from ..parallel import Comm
from ..progress import telling
from ..thresholds.gusts import GustSearch, runs_expected
from .drawing import tell_of_pictures


def gust(options: argparse.Namespace, comm: Comm) -> int:
    """Searches the weakest gusts that move the grain out of its pocket."""
    scene, durations = incipient.load(options.scene, options.overrides, comm), options.durations
    directory = options.out or Path("results") / f"{options.scene.stem}_gusts"
    GustSearch(scene, comm)  # what is wrong is said before anything is expected
    with telling(comm.rank) as voice:
        runs = runs_expected(len(durations), scene.numerics.error_bars)
        voice.say(f"{options.scene}: durations: {len(durations)}, about {runs} runs")
        found = incipient.gusts(scene, durations, directory, comm, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / 'gusts.csv'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0


def entrainment(options: argparse.Namespace, comm: Comm) -> int:
    """Computes the probability of motion in a fluctuating flow."""
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_entrainment"
    asked = (options.probabilities, options.strengths, options.gusts, options.data)
    with telling(comm.rank) as voice:
        found = incipient.entrainment(scene, directory, *asked, comm, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / 'entrainment.csv'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0
