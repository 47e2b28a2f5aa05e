"""`incipient judge`: forces and contacts from elsewhere."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from ..errors import SceneError
from ..judging.batch import SUMMARY, VERDICTS, judge_table
from ..judging.case import judge_case, load_case, save, text
from ..judging.forces import judge_forces, read_forces
from ..judging.pile import RECORD, is_pile, judge_pile_case
from ..judging.pile import save as save_pile
from ..judging.series import FlowThreshold, judge_series, read_series, save_series
from ..output.ownership import refuse_foreign
from ..progress import telling
from ..results.kinds import JUDGEMENT, SERIES, ResultKind
from .drawing import draw_and_tell
from .options import BESIDE


def judge(options: argparse.Namespace) -> None:
    """Judge a case and print the verdict; write it with `--out`."""
    if options.forces is not None:
        _judge_forces(options)
    elif options.batch is not None:
        _judge_batch(options)
    elif options.case is None:
        remedy = "give a case file, --batch FILE, or --forces with --grain"
        raise SceneError(f"judge: there is no case; {remedy}")
    elif options.series is not None:
        _judge_series(options)
    elif is_pile(options.case):
        _judge_pile(options)
    else:
        _judge_case(options)


def _judge_forces(options: argparse.Namespace) -> None:
    if options.density is None:
        why = "--forces: needs --density, the fluid's density over the rhoInf of the forces; give 1 if they are equal"
        raise SceneError(why)
    if options.case is None:
        from ..judging.in_place import grain_in_place  # its libraries take 0.3 s to import

        case = grain_in_place(options.grain, options.bed, options.overrides)
    elif options.grain or options.bed:
        why = f"{options.case} has the contacts; leave one of them out"
        raise SceneError(f"--grain and --bed: {why}")
    else:
        case = load_case(options.case, options.overrides, needs_flow=False)
    forces = read_forces(options.forces)
    judged = judge_forces(case, forces, options.density, options.since, options.law)
    print(judged.text())

    def keep(directory: Path) -> None:
        save(judged.judgement, directory)
        save_series(judged.series, directory)

    _keep(options, options.case or options.forces, (JUDGEMENT, SERIES), keep)


def _judge_case(options: argparse.Namespace) -> None:
    case = load_case(options.case, options.overrides)
    judgement = judge_case(case)
    print(text(case, judgement))
    _keep(options, options.case, (JUDGEMENT,), partial(save, judgement))


def _judge_pile(options: argparse.Namespace) -> None:
    judgement = judge_pile_case(options.case, options.overrides)
    print("\n".join(filter(None, [judgement["title"], *judgement["sentences"]])))
    if options.out is not None:
        directory = _directory(options, options.case)
        refuse_foreign(directory, {RECORD}, [options.case])
        save_pile(judgement, directory)
        _tell(f"{directory / RECORD}")


def _judge_series(options: argparse.Namespace) -> None:
    case = load_case(options.case, options.overrides, needs_flow=False)
    series = judge_series(case, read_series(options.series, options.since))
    print(series.text())
    if options.law is not None:
        start = series.motion.since
        print(FlowThreshold.of(options.law, series.times, series.batch, start, None).text())
    _keep(options, options.series, (SERIES,), partial(save_series, series))


def _judge_batch(options: argparse.Namespace) -> None:
    path = options.batch
    if options.case is not None:
        raise SceneError(f"--batch: {path} holds complete cases; leave out {options.case}")
    jobs = len(os.sched_getaffinity(0)) if options.jobs is None else options.jobs
    if jobs < 1:
        raise SceneError(f"--jobs: is {jobs}; give 1 or more")
    usual = Path("results") / f"{path.stem}_verdicts"
    directory = usual if options.out is None else _directory(options, path)
    names = (VERDICTS, SUMMARY)
    refuse_foreign(directory, names, [path])
    with telling(0) as voice:
        print(judge_table(path, options.overrides, directory, jobs, voice).text())
    _tell(f"{directory}/: {', '.join(names)}")


def _keep(
    options: argparse.Namespace,
    source: Path,
    kinds: Sequence[ResultKind],
    save: Callable[[Path], object],
) -> None:
    if options.out is None:
        return
    directory = _directory(options, source)
    read = [path for path in (options.case, options.grain, options.series) if path is not None]
    refuse_foreign(directory, set().union(*(kind.files for kind in kinds)), read)
    save(directory)
    names = [name for kind in kinds for name in (*kind.tables, kind.record)]
    _tell(f"{directory}/: {', '.join(names)}" if names[1:] else f"{directory / names[0]}")
    draw_and_tell(directory)


def _directory(options: argparse.Namespace, source: Path) -> Path:
    return source.parent if options.out is BESIDE else Path(options.out)


def _tell(files: str) -> None:
    print(f"numbers             {files}", flush=True)
