"""`incipient judge`: forces and contacts from elsewhere."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..output.ownership import refuse_foreign
from ..parallel import Comm, collectively
from ..progress import telling
from ..simulation.batch_table import open_table
from ..simulation.forces_of_openfoam import read_forces
from ..simulation.grain_in_place import grain_in_place
from ..simulation.judge_batch import SUMMARY, VERDICTS, judge_table
from ..simulation.judge_case import Case, judge_case, load_case, save, text
from ..simulation.judge_forces import judge_forces, load_case_without_load
from ..simulation.judge_series import judge_series, read_columns, save_series, series_from
from ..simulation.motion_in_time import FlowThreshold
from .drawing import draw_and_tell
from .options import BESIDE

OPTIONS_OF = {
    "jobs": ("batch",),
    "since": ("forces", "series"),
    "law": ("forces", "series"),
    **dict.fromkeys(("density", "grain", "bed"), ("forces",)),
}
OF_CASE = ("judgement.json", "judgement.png")
OF_SERIES = ("series.csv", "series.json", "series.png")


def judge(options: argparse.Namespace, comm: Comm) -> int:
    """Judge a case and print the verdict; write it with `--out`."""
    with collectively(comm):
        if comm.rank == 0:
            _refuse_unread(options)
            if options.batch is not None:
                _judge_batch(options)
                return 0
            if options.forces is not None:
                _judge_forces(options)
                return 0
            if options.case is None:
                raise SceneError(
                    "judge: there is no case; give a case file, --batch FILE, or --forces with --grain"
                )
            if options.series is not None:
                _judge_series(load_case_without_load(options.case, options.overrides), options)
                return 0
            case = load_case(options.case, options.overrides)
            judgement = judge_case(case)
            print(text(case, judgement))
            if options.out is not None:
                _keep(judgement, options.case.parent if options.out is BESIDE else options.out)
    return 0


def _refuse_unread(options: argparse.Namespace) -> None:
    """Refuse options that nothing would read."""
    for name, readers in OPTIONS_OF.items():
        if getattr(options, name) is not None and not any(getattr(options, one) for one in readers):
            needs = " or ".join(f"--{one}" for one in readers)
            raise SceneError(f"--{name}: goes with {needs}; add that, or leave --{name} out")


def _judge_batch(options: argparse.Namespace) -> None:
    """Judge a table of cases, which says all that a case file would."""
    path = options.batch
    if options.case is not None:
        raise SceneError(f"--batch: {path} has all of each case; leave out {options.case}")
    jobs = len(os.sched_getaffinity(0)) if options.jobs is None else options.jobs
    if jobs < 1:
        raise SceneError(f"--jobs: is {jobs}; give 1 or more")
    usual = path.parent if options.out is BESIDE else Path("results") / f"{path.stem}_verdicts"
    directory = options.out if isinstance(options.out, Path) else usual
    name = VERDICTS.replace(".csv", ".parquet") if path.suffix == ".parquet" else VERDICTS
    refuse_foreign(directory, (name, SUMMARY), [path])
    with telling(0) as voice:
        found = judge_table(open_table(path, options.overrides), directory, jobs, voice)
    print(found.text())
    print(f"numbers             {directory}/: {name}, {SUMMARY}", flush=True)


def _judge_series(case: Case, options: argparse.Namespace) -> None:
    found = judge_series(case, series_from(read_columns(options.series), options.since))
    print(found.text())
    if options.law is not None:
        start = found.motion.since
        print(FlowThreshold.of(options.law, found.times, found.batch, start, None).text())
    if options.out is not None:
        directory = options.series.parent if options.out is BESIDE else options.out
        refuse_foreign(directory, OF_SERIES, [options.series, options.case])
        save_series(found, directory)
        print(f"numbers             {directory}/: series.csv, series.json", flush=True)
        draw_and_tell(directory)


def _judge_forces(options: argparse.Namespace) -> None:
    if options.density is None:
        why = "--forces needs --density: that of the fluid over the rhoInf of the forces; 1 where they are the same"
        raise SceneError(why)
    if options.case is None:
        case = grain_in_place(options.grain, options.bed, options.overrides)
    elif options.grain or options.bed:
        raise SceneError(
            f"--grain and --bed: {options.case} has the contacts; leave one of them out"
        )
    else:
        case = load_case_without_load(options.case, options.overrides)
    found = judge_forces(
        case, read_forces(options.forces), options.density, options.since, options.law
    )
    print(found.text())
    if options.out is not None:
        beside = (options.case or options.forces).parent
        directory = beside if options.out is BESIDE else options.out
        refuse_foreign(
            directory, (*OF_CASE, *OF_SERIES), filter(None, (options.case, options.grain))
        )
        save(found.judgement, directory)
        save_series(found.series, directory)
        print(
            f"numbers             {directory}/: judgement.json, series.csv, series.json", flush=True
        )
        draw_and_tell(directory)


def _keep(judgement: dict[str, Any], directory: Path) -> None:
    """Write a judgement and its picture, and say where they are."""
    refuse_foreign(directory, OF_CASE)
    save(judgement, directory)
    print(f"numbers             {directory / 'judgement.json'}", flush=True)
    draw_and_tell(directory)
