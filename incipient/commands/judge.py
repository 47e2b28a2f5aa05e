"""`incipient judge`: forces and contacts from elsewhere."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..files import make_directory, write_json, write_text_atomically
from ..judging.batch import SUMMARY, VERDICTS, judge_table
from ..judging.case import judge_case, load_case, text
from ..judging.forces import judge_forces, read_forces
from ..judging.pile import is_pile, judge_pile_case
from ..judging.series import FlowThreshold, Series, judge_series, read_series
from ..output.ownership import refuse_foreign
from ..progress import telling
from ..results.kinds import JUDGEMENT, PILE, SERIES, ResultKind
from .drawing import draw_and_tell
from .options import BESIDE


def judge(options: argparse.Namespace) -> None:
    """Judge a case and print the verdict; write it with `--out`."""
    if options.forces is not None:
        _judge_forces(options)
    elif options.batch is not None:
        _judge_batch(options)
    elif options.case is None:
        raise SceneError(
            "judge: there is no case; give a case file, --batch FILE, or --forces with --grain"
        )
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
        raise SceneError(
            f"--grain and --bed: {options.case} has the contacts; leave one of them out"
        )
    else:
        case = load_case(options.case, options.overrides, needs_flow=False)
    forces = read_forces(options.forces)
    judged = judge_forces(case, forces, options.density, options.since, options.law)
    print(judged.text())

    records = {JUDGEMENT: judged.judgement, SERIES: judged.series.to_dict()}
    _keep(options, options.case or options.forces, records, judged.series)


def _judge_case(options: argparse.Namespace) -> None:
    case = load_case(options.case, options.overrides)
    judgement = judge_case(case)
    print(text(case, judgement))
    _keep(options, options.case, {JUDGEMENT: judgement})


def _judge_pile(options: argparse.Namespace) -> None:
    judgement = judge_pile_case(options.case, options.overrides)
    print("\n".join(filter(None, [judgement["title"], *judgement["sentences"]])))
    _keep(options, options.case, {PILE: judgement})


def _judge_series(options: argparse.Namespace) -> None:
    case = load_case(options.case, options.overrides, needs_flow=False)
    series = judge_series(case, read_series(options.series, options.since))
    print(series.text())
    if options.law is not None:
        start = series.motion.since
        print(FlowThreshold.of(options.law, series.times, series.batch, start, None).text())
    _keep(options, options.series, {SERIES: series.to_dict()}, series)


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
    records: Mapping[ResultKind, Mapping[str, Any]],
    series: Series | None = None,
) -> None:
    if options.out is None:
        return
    directory = _directory(options, source)
    read = [path for path in (options.case, options.grain, options.series) if path is not None]
    refuse_foreign(directory, set().union(*(kind.files for kind in records)), read)
    make_directory(directory)
    for kind, record in records.items():
        write_json(directory / kind.record, record)
    if series is not None:
        write_text_atomically(directory / SERIES.tables[0], series.table())
    names = [name for kind in records for name in (*kind.tables, kind.record)]
    _tell(f"{directory}/: {', '.join(names)}" if names[1:] else f"{directory / names[0]}")
    if any(kind.pictures for kind in records):
        draw_and_tell(directory)


def _directory(options: argparse.Namespace, source: Path) -> Path:
    return source.parent if options.out is BESIDE else Path(options.out)


def _tell(files: str) -> None:
    print(f"numbers             {files}", flush=True)
