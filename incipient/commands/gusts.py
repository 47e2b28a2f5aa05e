"""`incipient gust` and `incipient entrainment`."""

from __future__ import annotations

import argparse
from pathlib import Path

import incipient

from ..cost.command import predicted_plan
from ..cost.prediction import Prediction
from ..parallel import Comm
from ..progress import telling
from ..threshold.gusts import GustSearch, runs_expected
from .drawing import tell_of_pictures


def gust(options: argparse.Namespace, comm: Comm) -> int:
    """Searches the weakest gusts that move the grain out of its pocket."""
    scene, durations = incipient.load(options.scene, options.overrides, comm), options.durations
    directory = options.out or Path("results") / f"{options.scene.stem}_gusts"
    GustSearch(scene, comm)  # what is wrong is said before anything is expected
    with telling(comm.rank) as voice:
        runs = runs_expected(len(durations), scene.numerics.error_bars)
        price = _price(predicted_plan(scene).prediction, runs)
        voice.say(f"{options.scene}: durations: {len(durations)}, about {runs} runs{price}")
        found = incipient.gusts(scene, durations, directory, comm, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / 'gusts.csv'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0


def entrainment(options: argparse.Namespace, comm: Comm) -> int:
    """Finds how probable motion is in a fluctuating stream."""
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


def _price(known: Prediction | str, runs: int) -> str:
    """What a number of runs is expected to cost by what is known of one; a reason where nothing is."""
    if isinstance(known, str):
        return ", each as `incipient run`"
    each = f"each {known.cpu:.2g} s of processor time within a factor of {known.factor:.2g}"
    return f", {each}, in all about {runs * known.cpu / 60:.2g} min"
