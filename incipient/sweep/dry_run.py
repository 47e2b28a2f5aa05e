"""Forecast of a sweep, by all of its cases or by as many as can be looked at in a few seconds."""

from __future__ import annotations

import random
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..cost.frontier import seconds as in_words
from ..progress import Silent
from .call import Means
from .cases import SweepCase
from .expectation import Expected, Foresight, total
from .request import Request
from .store import DONE, FAILED, Store

LOOKING = "sampling cases, per cent"
LONGEST = 10.0  # seconds that cases are looked at


@dataclass(frozen=True)
class Sample:
    """Cases of a request, by identity, with what they take; `of_all`: how many there are."""

    cases: Mapping[str, SweepCase]
    expected: Mapping[str, Expected]
    of_all: int

    @property
    def is_whole(self) -> bool:
        """Whether these are all."""
        return len(self.cases) == self.of_all


def sampled(request: Request, voice: Silent | None = None, longest: float = LONGEST) -> Sample:
    """Cases drawn at random, always the same, until all are there or `longest` seconds passed. Raises SceneError."""
    settings, foresight, began = request.settings(), Foresight(), time.monotonic()
    voice, every = voice or Silent(), len(settings) * len(request.sources)
    cases: dict[str, SweepCase] = {}
    expected: dict[str, Expected] = {}
    twice = 0
    for done, number in enumerate(random.Random(0).sample(range(every), every)):
        spent = time.monotonic() - began
        if done and spent > longest:
            break
        voice.count(LOOKING, round(100 * max(done / every, min(spent / longest, 1.0))), 100)
        case = request.case(number, settings)
        twice += case.identity in cases
        cases[case.identity] = case
        expected |= foresight.of([case])
    return Sample(cases, expected, every - twice)


def foretold(
    request: Request, file: Path, means: Means, places: int, voice: Silent | None = None
) -> str:
    """Forecast of a sweep in words: how many cases to compute, time and memory. Raises SceneError and OutputError."""
    sample, states = sampled(request, voice), dict[str, str]()
    if file.is_file():
        with Store(file) as store:
            states = store.states(list(sample.cases))
    over = (DONE,) if means.retry else (DONE, FAILED)
    left = {name: sample.expected[name] for name in sample.cases if states.get(name) not in over}
    more = sample.of_all / len(sample.cases)
    known, about = (
        sample.of_all - round(more * len(left)),
        "" if sample.is_whole or not states else "about ",
    )
    at_a_time = f"{places} at a time" if places else "by the workers of the executor"
    to_compute = f"{about}{sample.of_all - known} to compute, {at_a_time}"
    lines = [f"{'cases':<20}{sample.of_all}: {about}{known} already in {file}, {to_compute}"]
    if not sample.is_whole:
        said = (
            f"{len(sample.cases)} cases drawn at random are checked, time and memory are by these"
        )
        lines.append(f"{'sample':<20}{said}; a sweep checks all before it begins")
    refinement = request.refinement(list(sample.cases.values()))
    if refinement is not None:
        lines.append(
            f"{'refinement':<20}up to {refinement.most} cases in all; what follows is without it"
        )
    return "\n".join([*lines, _time(left, more, places), _memory(left, more, means, places)])


def _time(expected: Mapping[str, Expected], more: float, places: int) -> str:
    sum_of_all = total(expected)
    text = "not known"
    if sum_of_all is not None:
        whole = more * sum_of_all
        text = f"{f'about {in_words(whole / places)}, ' if places else ''}{in_words(whole)} of processor time"
    return f"{'time':<20}{text}"


def _memory(expected: Mapping[str, Expected], more: float, means: Means, places: int) -> str:
    sizes = sorted((one.memory_mib or 0.0 for one in expected.values()), reverse=True)
    most, limit = sizes[:1] or [0.0], means.limits.memory_mib
    together = sum(sizes[:places])
    text = f"up to {most[0]:.0f} MiB a case"
    if places:
        text += f", {together:.0f} MiB at a time; {limit:.0f} MiB may be taken"
    if any(one.memory_mib is None for one in expected.values()):
        text += "; that of some cases is not known"
    too_large = round(more * sum(size > limit for size in sizes))
    if too_large:
        text += f"; {too_large} cases are too large"
    elif together > limit:
        text += ": fewer go at a time"
    return f"{'memory':<20}{text}"
