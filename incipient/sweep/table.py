"""The cases of a sweep as a table: what was varied, what came out with its error bars, what it took."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..effects import known
from ..errors import MissingError
from ..files import csv_text, reported
from ..results.quantity import HIGH, LOW, at
from ..results.si import FLOW
from ..tables.parquet import pyarrow
from .store import DAMAGED, DONE, FAILED, CaseOutcome, Store, damaged

if TYPE_CHECKING:
    import pandas

_THRESHOLD = ("factor", "shields", "reynolds", "shear_reynolds")


def rows(path: Path | str) -> list[dict[str, Any]]:
    """One dictionary a case, in the order in which cases came; columns as in docs/sweeps.md. Not collective.

    A number that a case does not have is missing, an infinite one is infinite. A case that was changed after it was
    written has the status "damaged" and no numbers.

    Raises:
        OutputError: the file is not there, damaged, or not that of a sweep.
    """
    with Store(Path(path)) as store:
        keys = store.keys()
        return [_believed(stored, keys) for stored in store.rows()]


def frame(path: Path | str) -> pandas.DataFrame:
    """Table of a sweep as a frame of pandas, with the columns of `rows`. Not collective.

    Raises:
        MissingError: pandas is not installed.
        OutputError: as `rows`.
    """
    try:
        import pandas
    except ImportError as error:
        raise MissingError(f"pandas cannot be used ({error}): pip install 'incipient[tables]'") from None
    found = rows(path)
    return pandas.DataFrame(found, columns=columns(found))


def columns(found: Sequence[Mapping[str, Any]]) -> list[str]:
    """The columns that any of the rows has, in their order."""
    names: dict[str, None] = {}
    for row in found:
        names |= dict.fromkeys(row)
    last = ("reason", "wall", "cpu", "peak_mib", "tries", "finished", "versions", "id")
    return [name for name in names if name not in last] + [name for name in last if name in names]


def as_csv(found: Sequence[Mapping[str, Any]]) -> str:
    """Rows as the text of a CSV file; what is not known is empty."""
    return csv_text(columns(found), found)


def write_parquet(source: Path, target: Path) -> None:
    """Write the table as a Parquet file; raises MissingError without pandas or pyarrow, and OutputError."""
    pyarrow("tables")
    made = frame(source)
    with reported(target):
        made.to_parquet(target)


def _believed(stored: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """The row of a case; one that was written without a checksum and cannot be read is damaged."""
    try:
        return _row(stored, keys)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        if stored.get("checksum") is not None:
            raise
        return _row(damaged(stored), keys)


def _row(stored: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    scene: dict[str, Any] = {}
    if stored["status"] != DAMAGED:
        scene = (json.loads if stored["task"] == "judge" else tomllib.loads)(stored["scene"])
    row: dict[str, Any] = {"source": stored["source"], "task": stored["task"], "status": stored["status"]}
    row |= {key: _shown(value) for key in keys if (value := at(scene, key)) is not None}
    if stored["result"]:
        row |= quantities(stored["task"], json.loads(stored["result"]))
    row |= {name: stored[name] for name in ("reason", "wall", "cpu", "peak_mib", "tries", "finished")}
    versions = json.loads(stored["versions"] or "{}")
    named = " ".join(f"{name} {number}" for name, number in versions.items())
    return {**row, "versions": named, "id": stored["id"]}


def _shown(value: Any) -> Any:
    return value if isinstance(value, str | int | float | bool) else json.dumps(value)


def quantities(task: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and words of the result of a case, error bars under NAME_low and NAME_high."""
    found = _OF_TASK.get(task, _of_verdict)(result)
    si = result.get("si") or {}
    return found | {f"{name}_si": si[name] for name in FLOW if name in si}


def _of_threshold(result: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"mode": result["mode"]}
    for name in _THRESHOLD:
        value, error = result[name], result["errors"][name]
        found[name] = math.inf if value is None else value
        if value is not None and error is not None:
            found |= {name + LOW: value - error, name + HIGH: value + error}
    if "shields_nominal" in result:  # files of before do not have it
        value = result["shields_nominal"]
        found["shields_nominal"] = math.inf if value is None else value
    if result["reason"]:
        found["note"] = result["reason"]
    return found


def _of_gust(result: Mapping[str, Any]) -> dict[str, Any]:
    found = {name: result[name] for name in ("strength", "held", "leaves", "impulse", "runs")}
    value, error = result["strength"], result["error"]
    ends = {} if error is None else {"strength" + LOW: value - error, "strength" + HIGH: value + error}
    return found | ends


def _of_entrainment(result: Mapping[str, Any]) -> dict[str, Any]:
    steady, own = result["threshold"], result["scene"]
    found: dict[str, Any] = {"mode": steady["mode"], "shields": steady["shields"]}
    found |= {
        "probability": own["probability"],
        f"probability{LOW}": own["low"],
        f"probability{HIGH}": own["high"],
    }
    found |= {} if own["rate"] is None else {"rate": own["rate"]}
    for one in result["quantiles"]:
        name = f"shields_at_{one['probability']:g}"
        found[name] = one["shields"]
        if one["error"] is not None:
            found |= {name + LOW: one["shields"] - one["error"], name + HIGH: one["shields"] + one["error"]}
    return found


def _of_verdict(result: Mapping[str, Any]) -> dict[str, Any]:
    verdict = result["verdict"]
    found: dict[str, Any] = {}
    if verdict is not None:
        factor = verdict["safety_factor"]
        found = {"mode": verdict["mode"], "moves": verdict["moves"]}
        found["safety_factor"] = math.inf if factor is None else factor
        paper = verdict["judges"]["criteria"]
        found["paper"] = paper["wording"] if paper["moves"] else "no incipient motion"
    bars = result.get("error_bars")
    if bars is not None and bars["safety_factor"] is not None:
        bar = bars["safety_factor"]
        ends = (math.inf if bar[end] is None else bar[end] for end in ("low", "high"))
        found |= dict(zip((f"safety_factor{LOW}", f"safety_factor{HIGH}"), ends, strict=True))
        found["certain"] = bar["certain"]
    for quantity in known.quantities():
        found |= quantity.columns(result)
    return found


_OF_TASK = {"threshold": _of_threshold, "gust": _of_gust, "entrainment": _of_entrainment}


def in_words(row: Mapping[str, Any]) -> str:
    """Outcome of a case in a few words, by its row."""
    if row["status"] in (FAILED, DAMAGED):
        return str(row["reason"])
    if row["task"] == "threshold":
        bar = row.get(f"shields{HIGH}")
        error = "" if bar is None else f" +- {bar - row['shields']:.1g}"
        return f"{row['mode']} at Shields number {row['shields']:.4g}{error}"
    if row["task"] == "entrainment":
        return f"probability of motion {row['probability']:.3g}, steady Shields number {row['shields']:.4g}"
    if row["task"] == "gust":
        return f"critical strength {row['strength']:.4g}"
    words = f"{row['mode']}, safety factor {row['safety_factor']:.4g}" if "mode" in row else "no verdict"
    if "left_pocket" in row:
        return f"left its pocket at t = {row['left_pocket']:.4g}"
    if "does" in row:
        words = f"{row['does']} at the end, {words}"
    if "friction" not in row:
        return words
    words = words if "mode" in row else f"C_f {row['friction']:.5g}"
    return words if row["applicable"] else f"{words}, law of the wall NOT APPLICABLE"


def described(task: str, outcome: CaseOutcome) -> str:
    """Outcome of a case that has just been computed, in a few words."""
    row: dict[str, Any] = {"task": task, "status": FAILED, "reason": outcome.reason}
    if outcome.result is not None:
        row |= {"status": DONE, **quantities(task, outcome.result)}
    return in_words(row)
