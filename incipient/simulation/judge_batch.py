"""Many cases in a table, judged in chunks: by several processes, kept chunk by chunk, and resumed after a kill."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import multiprocessing
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..contact.batch import judge_many
from ..errors import ConvergenceError, OutputError, SceneError
from ..files import (
    MARK,
    make_directory,
    part_of,
    replaced,
    reported,
    write_json,
    write_text_atomically,
)
from ..input_files import reading
from ..parallel import end_with_parent
from ..parquet import pyarrow
from ..progress import Silent
from .batch_table import KINDS, Columns, Row, Table

VERDICTS, SUMMARY, CHUNKS, REQUEST = "verdicts.csv", "batch.json", "verdicts.chunks", "request.json"
HEAD = "row,name,safety_factor,held,mode,reason\n"
MOST_REASONS = 5  # told


@dataclass(frozen=True)
class Verdicts:
    """What came of a table: its cases, how many failed and why the first of them, modes, the least safety factor."""

    cases: int
    failed: int
    modes: dict[str, int]
    least_safety_factor: float
    reasons: dict[int, str]
    kept: int  # chunks of an earlier call

    def text(self) -> str:
        """The outcome in a few lines for a reader."""
        lines = [f"{'cases':<20}{self.cases}"]
        lines += [
            f"{mode:<19} {count} ({count / self.cases:.2%})" for mode, count in self.modes.items()
        ]
        if self.modes:
            lines.append(f"{'safety factor':<20}{self.least_safety_factor:.4g} at the least")
        if self.failed:
            lines.append(f"{'not judged':<20}{self.failed}, the first:")
            lines += [f"  row {row}: {reason}" for row, reason in self.reasons.items()]
        return "\n".join(lines)


def judge_table(table: Table, directory: Path, jobs: int, voice: Silent) -> Verdicts:
    """Judge the cases of a table and write verdicts.csv, or .parquet of a Parquet file, and batch.json. Not collective.

    Chunks that an earlier call for the same table has left in the directory are not judged again.

    Raises:
        SceneError: the table cannot be read, or there is no row in it.
        OutputError: something cannot be written, or chunks of another table are there.
        ConvergenceError: a process was ended from outside; what is judged is kept.
    """
    if not table.rows:
        raise SceneError(f"{table.path}: has no row of a case; give one a line below the names")
    chunks = directory / CHUNKS
    _begin(table, chunks)
    missing = [number for number in range(len(table)) if not _is_whole(table, chunks, number)]
    for number in missing:
        _chunk(chunks, number).unlink(missing_ok=True)
    kept = len(table) - len(missing)
    voice.begin("verdicts")
    for count, _ in enumerate(_judged(table, chunks, missing, jobs), kept + 1):
        voice.count("verdicts", min(count * table.size, table.rows), table.rows)
    found = _gathered([_chunk(chunks, number) for number in range(len(table))], kept)
    if found.cases != table.rows:
        why = f"hold {found.cases} verdicts for {table.rows} rows"
        raise OutputError(f"{chunks}: the chunks {why}; another program changes them, call again")
    _write(table, directory, chunks)
    write_json(directory / SUMMARY, asdict(found))
    with reported(chunks):
        mine = (_chunk(chunks, number) for number in range(len(table)))
        for path in (*mine, chunks / REQUEST, chunks / MARK):
            path.unlink(missing_ok=True)
        chunks.rmdir()
    return found


def _chunk(chunks: Path, number: int) -> Path:
    return chunks / f"{number:06d}.csv"


def _is_whole(table: Table, chunks: Path, number: int) -> bool:
    """Whether the chunk of an earlier call has the verdict of each of its rows; one that was cut is judged again."""
    path, first = _chunk(chunks, number), number * table.size + 1
    if not path.exists():
        return False
    try:
        numbers = [
            int(row)
            for row, _, factor, _, _, reason in _rows(path)
            if reason or float(factor) >= 0.0
        ]
    except (ValueError, OutputError):
        return False
    return numbers == list(range(first, first + table.rows_of(number)))


def _begin(table: Table, chunks: Path) -> None:
    """Make the directory of chunks, or refuse that of another table."""
    with reading(table.path, KINDS), table.path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    request = {
        "sha256": digest,
        "set": dict(table.columns.constant),
        "rows": table.rows,
        "chunk": table.size,
    }
    path = chunks / REQUEST
    make_directory(chunks)
    if not path.exists():
        write_json(path, request)
        return
    before = None
    with suppress(SceneError), reading(path, ""):
        before = json.loads(path.read_text())
    if before != request:
        raise OutputError(
            f"{chunks}: holds chunks of another table or --set; remove it, or give another --out"
        )


def _judged(table: Table, chunks: Path, missing: list[int], jobs: int) -> Iterator[int]:
    """Judge chunks that are not there yet; the number of each when it is written.

    Workers read and write themselves: of a pool whose worker is killed, large messages to the others may never arrive.
    """
    if jobs == 1 or len(missing) < 2:
        yield from (_judge_chunk(table, chunks, number) for number in missing)
        return
    # Not forked: what the parent has loaded may hold threads.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(missing)), context, end_with_parent) as pool:
        futures = [pool.submit(_judge_chunk, table, chunks, number) for number in missing]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool:
            why = "a process was ended, perhaps for want of memory; what is judged is kept"
            raise ConvergenceError(f"batch: {why}: call again, with fewer --jobs") from None
        finally:
            pool.shutdown(cancel_futures=True)  # waits for chunks that are begun


def _judge_chunk(table: Table, chunks: Path, number: int) -> int:
    """Judge a chunk and write its verdicts; its number."""
    text = verdicts(table.columns, number * table.size, table.chunk(number))
    write_text_atomically(_chunk(chunks, number), text)
    return number


def verdicts(columns: Columns, start: int, rows: list[Row]) -> str:
    """The verdicts of rows as lines of CSV; rows are counted from `start`, the first of a table is 1."""
    cases, names, problems = columns.cases(rows)
    found = judge_many(cases)
    reasons = {**found.reasons, **problems}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    given = zip(found.factors.tolist(), found.held.tolist(), found.mode_names, strict=True)
    for place, (factor, held, mode) in enumerate(given):
        name = names[place] if names else ""
        said = (
            ("", "", "", reasons[place])
            if place in reasons
            else (repr(factor), int(held), mode, "")
        )
        writer.writerow((start + place + 1, name, *said))
    return text.getvalue()


def _rows(path: Path) -> Iterator[list[str]]:
    remedy = "remove it and call again"
    with (
        reading(path, remedy, error=OutputError),
        path.open(encoding="utf-8", newline="") as stream,
    ):
        yield from csv.reader(stream)


def _gathered(paths: list[Path], kept: int) -> Verdicts:
    modes, reasons, least, cases = Counter[str](), dict[int, str](), float("inf"), 0
    for row, _, factor, _, mode, reason in (row for path in paths for row in _rows(path)):
        cases += 1
        if reason:
            if len(reasons) < MOST_REASONS:
                reasons[int(row)] = reason
            continue
        modes[mode] += 1
        least = min(least, float(factor))
    return Verdicts(cases, cases - modes.total(), dict(modes.most_common()), least, reasons, kept)


def _write(table: Table, directory: Path, chunks: Path) -> None:
    """Put the chunks together."""
    if table.path.suffix == ".parquet":
        _write_parquet(directory / VERDICTS.replace(".csv", ".parquet"), chunks, len(table))
        return
    path = directory / VERDICTS
    with (
        replaced(path, part_of(path)) as part,
        part.open("w", encoding="utf-8", newline="") as stream,
    ):
        stream.write(HEAD)
        for number in range(len(table)):
            stream.write(_chunk(chunks, number).read_text(encoding="utf-8"))


def _write_parquet(path: Path, chunks: Path, count: int) -> None:
    arrow = pyarrow()
    kinds = (
        arrow.int64(),
        arrow.string(),
        arrow.float64(),
        arrow.bool_(),
        arrow.string(),
        arrow.string(),
    )
    schema = arrow.schema(zip(HEAD.strip().split(","), kinds, strict=True))
    also = (arrow.ArrowException,)
    with (
        replaced(path, part_of(path), also) as part,
        arrow.parquet.ParquetWriter(part, schema) as writer,
    ):
        for number in range(count):
            columns: list[Any] = list(map(list, zip(*_rows(_chunk(chunks, number)), strict=True)))
            columns[0] = [int(row) for row in columns[0]]
            columns[2] = [float(factor) if factor else None for factor in columns[2]]
            columns[3] = [bool(int(held)) if held else None for held in columns[3]]
            writer.write_table(arrow.table(columns, schema=schema))
