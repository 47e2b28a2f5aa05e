"""`incipient judge`: forces and contacts from elsewhere."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import SceneError, refuse_broken
from ..files import owned, write_results
from ..judging.batch import SUMMARY, VERDICTS, judge_table, verdicts_text
from ..judging.case import judge_case, load_case, text
from ..judging.forces import judge_forces, read_forces
from ..judging.pile import is_pile, judge_pile_case
from ..judging.series import (
    critical_velocities,
    judge_series,
    read_series,
    velocities_text,
)
from ..output.ownership import refuse_foreign, remove
from ..progress import telling
from ..results.kinds import JUDGEMENT, PILE, SERIES, ResultKind
from .options import BESIDE
from .showing import draw_and_tell

# Kind, record and table ("" without one) of each result.
Records = list[tuple[ResultKind, Mapping[str, Any], str]]


def judge(options: argparse.Namespace) -> None:
    """Judge a case and print the verdict; write it with `--out`."""
    if options.batch is not None:
        _judge_batch(options)
        return
    if options.forces is not None:
        words, records = _forces(options)
    elif options.case is None:
        raise SceneError(
            "judge: there is no case; give a case file, --batch FILE, or --forces with --grain"
        )
    elif options.series is not None:
        words, records = _series(options)
    elif is_pile(options.case):
        judgement = judge_pile_case(options.case, options.overrides)
        words = "\n".join(filter(None, [judgement["title"], *judgement["sentences"]]))
        records = [(PILE, judgement, "")]
    else:
        judgement = judge_case(load_case(options.case, options.overrides))
        words, records = text(judgement), [(JUDGEMENT, judgement, "")]
    print(words)
    if options.out is not None:
        _write(options, records)


def _forces(options: argparse.Namespace) -> tuple[str, Records]:
    refuse_broken(
        (
            options.density is None,
            "--forces: needs --density, the fluid's density over the rhoInf of the forces; give 1 if they are equal",
        ),
        (
            options.case and (options.grain or options.bed),
            f"--grain and --bed: {options.case} has the contacts; leave one of them out",
        ),
    )
    if options.case is None:
        from ..judging.in_place import grain_in_place  # its libraries take 0.3 s to import

        case = grain_in_place(options.grain, options.bed, options.overrides)
    else:
        case = load_case(options.case, options.overrides, needs_flow=False)
    forces = read_forces(options.forces)
    judged = judge_forces(case, forces, options.density, options.since, options.law)
    series = (SERIES, judged.series.record, judged.series.table())
    return judged.text(), [(JUDGEMENT, judged.judgement, ""), series]


def _series(options: argparse.Namespace) -> tuple[str, Records]:
    case = load_case(options.case, options.overrides, needs_flow=False)
    series = judge_series(case, read_series(options.series, options.since))
    words = series.text()
    if options.law is not None:
        words = f"{words}\n{velocities_text(critical_velocities(options.law, series))}"
    load = {name: getattr(case.load, name) for name in ("flow_force", "flow_couple")}
    unread = [f"load.{name}" for name, value in load.items() if value is not None]
    unread += [] if case.errors is None else ["[errors]"]
    if unread:
        words = f"{words}\n{'not read':<20}{', '.join(unread)} of {options.case}"
    return words, [(SERIES, series.record, series.table())]


def _judge_batch(options: argparse.Namespace) -> None:
    path = options.batch
    jobs = len(os.sched_getaffinity(0)) if options.jobs is None else options.jobs
    refuse_broken(
        (options.case, f"--batch: {path} holds complete cases; leave out {options.case}"),
        (jobs < 1, f"--jobs: is {jobs}; give 1 or more"),
    )
    usual = Path("results") / f"{path.stem}_verdicts"
    directory = usual if options.out is None else _directory(options, path)
    names = (VERDICTS, SUMMARY)
    refuse_foreign(directory, names, [path])
    with telling(0) as voice:
        verdicts = judge_table(path, options.overrides, directory, jobs, voice)
        print(verdicts_text(verdicts))
    print(f"numbers             {directory}/: {', '.join(names)}", flush=True)
    if verdicts["failed"] == verdicts["cases"]:
        raise SceneError(f"{path}: no case could be judged; correct its rows as said above")


def _write(options: argparse.Namespace, records: Records) -> None:
    directory = _directory(options, options.series or options.case or options.forces)
    read = [path for path in (options.case, options.grain, options.series) if path is not None]
    written = set[str]().union(*(kind.files for kind, *_ in records))
    refuse_foreign(directory, written, read)
    # Of an earlier case: a page has all records of its directory.
    earlier = set[str]().union(*(kind.files for kind in (JUDGEMENT, PILE, SERIES))) - written
    remove(directory / name for name in earlier & owned(directory))
    contents = dict[str, Any]()
    for kind, record, table in records:
        contents |= dict.fromkeys(kind.tables, table) | {kind.record: record}
    write_results(directory, contents)
    names = [*contents]
    files = f"{directory}/: {', '.join(names)}" if names[1:] else directory / names[0]
    print(f"numbers             {files}", flush=True)
    if any(kind.pictures for kind, *_ in records):
        draw_and_tell(directory)


def _directory(options: argparse.Namespace, source: Path) -> Path:
    return source.parent if options.out is BESIDE else Path(options.out)
