"""Tables of cases, one per row, evaluated together.

Columns (in 3-D with `_z`, and three of torque): force_x, force_y, couple (torque), weight_x, weight_y, centre_x,
centre_y, friction, contact_1_x, contact_1_y, normal_1_x, normal_1_y and so on for further contacts, empty if a row has
fewer; optional are cohesion, about_x, about_y (the point of the torque), mass and inertia (in 3-D inertia_x, inertia_y,
inertia_z, and inertia_xy, inertia_xz, inertia_yz unless the axes are principal axes), convex (0 if normals may point
into the grain), and name.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats, decimal, unwarned
from ..contact.batch import CHUNK, Batch, Cases, judge_many
from ..contact.friction import FrictionCone
from ..errors import Interrupted, SceneError, shortened
from ..files import csv_text, make_directory, write_results
from ..progress import Silent
from ..results.quantity import labelled
from .case import ROUNDING
from .table import Table, names_of, read_table, require_columns, vectors

VERDICTS, SUMMARY = "verdicts.csv", "batch.json"
COLUMNS = ("row", "name", "safety_factor", "held", "mode", "reason")
_CONTACT = re.compile(r"(?:contact|normal)_([1-9][0-9]{0,2})_[xyz]")
_PRODUCTS = ("xy", "xz", "yz")  # of inertia


def verdicts_text(verdicts: Mapping[str, Any]) -> str:
    """The outcome of `judge_table` as text."""
    cases, failed = verdicts["cases"], verdicts["failed"]
    lines = labelled("cases", str(cases))
    for mode, count in verdicts["modes"].items():
        lines.append(f"{mode:<19} {count} ({count / cases:.2%})")
    if verdicts["modes"]:
        lines += labelled("safety factor", f"{verdicts['least_safety_factor']:.4g} at the least")
    if failed:
        lines += labelled("not judged", f"{failed}, the first:")
        lines += [f"  row {row}: {reason}" for row, reason in verdicts["reasons"].items()]
    return "\n".join(lines)


def judge_table(
    path: Path, settings: Sequence[str], directory: Path, jobs: int, progress: Silent
) -> dict[str, Any]:
    """Judge the cases of a table; write verdicts.csv and batch.json; returns the content of the latter.

    These are the numbers of cases and of failures, cases by mode, the least safety factor, and five reasons by row.

    Args:
        settings: values of columns for all rows, such as "friction=0.5".
        jobs: number of threads.

    Raises:
        SceneError: an invalid table or setting.
        MissingError: a Parquet file without pyarrow.
        OutputError: a file cannot be written.
        Interrupted: by Ctrl-C; verdicts so far are written.
    """
    table = read_table(path)
    cases, faults = _cases(table, dict(map(_setting, settings)))
    if not len(cases):
        raise SceneError(f"{path}: has no case; give one in each line below the names")
    make_directory(directory)
    progress.begin("verdicts")
    count, answers, failed = len(cases), list[tuple[float, int, str]](), dict[int, str]()
    with suppress(KeyboardInterrupt):
        for batch in _judged(cases, jobs):
            failed |= {len(answers) + place: why for place, why in batch.reasons.items()}
            held = batch.held.astype(int).tolist()
            answers += zip(batch.factors.tolist(), held, batch.mode_names, strict=True)
            progress.count("verdicts", len(answers), count)
    failed |= dict.fromkeys(range(len(answers), count), "not judged: interrupted; call again")
    failed = dict(sorted((failed | faults).items()))
    labels = table.labels or [""] * count
    rows = (
        {"row": place + 1, "name": labels[place], "reason": failed[place]}
        if place in failed
        else dict(zip(COLUMNS, (place + 1, labels[place], *answers[place]), strict=False))
        for place in range(count)
    )
    right = [answer for place, answer in enumerate(answers) if place not in failed]
    verdicts = {
        "cases": count,
        "failed": len(failed),
        "modes": dict(Counter(mode for *_, mode in right).most_common()),
        "least_safety_factor": min((factor for factor, *_ in right), default=np.inf),
        "reasons": {place + 1: why for place, why in islice(failed.items(), 5)},
    }
    write_results(directory, {VERDICTS: csv_text(COLUMNS, rows), SUMMARY: verdicts})
    if len(answers) < count:
        raise Interrupted(
            f"interrupted; {directory}/ has the verdicts on the first {len(answers)} rows"
        )
    return verdicts


def _judged(cases: Cases, jobs: int) -> Iterator[Batch]:
    parts = (cases.part(slice(start, start + CHUNK)) for start in range(0, len(cases), CHUNK))
    # Compiled kernels let other threads compute; filters of warnings are common to all threads.
    with unwarned(), ThreadPoolExecutor(jobs) as pool:
        try:
            yield from pool.map(judge_many, parts)
        finally:
            pool.shutdown(cancel_futures=True)


def _setting(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    with suppress(ValueError):
        if np.isfinite(number := decimal(value.strip())):
            return name.strip(), number
    raise SceneError(
        f"--set {shortened(text)}: is not a finite number; with --batch give COLUMN=NUMBER"
    )


def _cases(table: Table, constants: Mapping[str, float]) -> tuple[Cases, dict[int, str]]:
    if twice := table.columns.keys() & constants.keys():
        raise SceneError(f"--set {min(twice)}: the table has this column; leave one of them out")
    value = {
        **table.columns,
        **{key: np.full(len(table), constant) for key, constant in constants.items()},
    }
    gdim = 3 if {"force_z", "contact_1_z"} & value.keys() else 2
    number = max((int(name[1]) for name in map(_CONTACT.fullmatch, value) if name), default=1)
    points, normals = (
        [f"{kind}_{k}" for k in range(1, number + 1)] for kind in ("contact", "normal")
    )

    def names(*quantities: str) -> list[str]:
        return [name for quantity in quantities for name in names_of(quantity, gdim)]

    numbers = [*names("force", "couple", "weight", "centre"), "friction"]
    numbers += ["cohesion"] if "cohesion" in value else []
    about, inertia = names("about"), names("inertia")
    has_point = not value.keys().isdisjoint(about)
    numbers += about if has_point else []
    inert = ["mass", *inertia]
    products = [f"inertia_{axes}" for axes in _PRODUCTS] if gdim == 3 else []
    has_inertia = not value.keys().isdisjoint(inert + products)
    needed = [*numbers, *names(*points, *normals), *(inert if has_inertia else [])]
    optional = ["name", *about, "cohesion", "convex", *inert, *products]
    require_columns("batch", value, needed, optional, "give it, or --set {name}=VALUE for all rows")
    force, torque, weight, centre = (
        vectors(value, name, gdim) for name in ("force", "couple", "weight", "centre")
    )
    if has_point:  # tau_c = tau_a + (a - c) ^ F
        torque = torque + np.cross(vectors(value, "about", gdim) - centre, force)
    touching, outward = (_of_contacts(value, kind, gdim) for kind in (points, normals))
    arms = touching - centre[:, None]
    with np.errstate(over="ignore", invalid="ignore"):  # of values above 1e154
        lengths, distances = (np.linalg.norm(vector, axis=2) for vector in (outward, arms))
        inward = (arms * outward).sum(axis=2) < -ROUNDING * distances
    is_unit = np.abs(lengths - 1.0) <= ROUNDING
    inward &= value.get("convex", np.ones(len(table)))[:, None] != 0.0
    cases = Cases(
        touching,
        outward / np.where(is_unit, lengths, 1.0)[..., None],
        force,
        torque,
        weight,
        centre,
        FrictionCone(value["friction"], value.get("cohesion", np.zeros(len(table)))),
        *((value["mass"], _inertia(value, inertia)) if has_inertia else ()),
    )
    faults = dict(table.faults)
    for name in [*numbers, *names(*points, *normals)]:
        contact = _CONTACT.fullmatch(name)
        is_needed = cases.contacts >= int(contact[1]) if contact else True
        for place in np.flatnonzero(is_needed & ~np.isfinite(value[name])).tolist():
            faults.setdefault(place, f"{name} is empty or not finite; give a number")
    for wrong, why in (
        (
            ~is_unit & ~np.isnan(lengths),
            "is not of length 1; give a unit vector out of the grain",
        ),
        (inward, "points into the grain; turn it; if the grain is not convex, convex=0"),
    ):
        for place, number in np.argwhere(wrong).tolist():
            faults.setdefault(place, f"normal_{number + 1} {why}")
    return cases, faults


def _of_contacts(value: Mapping[str, Floats], names: Sequence[str], gdim: int) -> Floats:
    """Vectors (n, contacts, 3), NaN of missing contacts."""
    of_each = np.stack([vectors(value, name, gdim) for name in names], axis=1)
    return np.where(np.isnan(of_each[..., :gdim]).all(axis=2, keepdims=True), np.nan, of_each)


def _inertia(value: Mapping[str, Floats], moments: Sequence[str]) -> Floats:
    diagonal = np.stack([value[name] for name in moments], axis=1)
    matrices = np.where(np.eye(3), diagonal[:, None], 0.0)
    for axes in _PRODUCTS:
        first, other = ("xyz".index(axis) for axis in axes)
        product = np.nan_to_num(value.get(f"inertia_{axes}", 0.0), nan=0.0)
        matrices[:, first, other] = matrices[:, other, first] = product
    matrices[np.isnan(value["mass"]) & np.isnan(diagonal).all(axis=1)] = np.nan
    return matrices
