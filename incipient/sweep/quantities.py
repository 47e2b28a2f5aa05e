"""The quantities of a case's result for the table of a sweep, with their error bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..effects import known
from ..results.kinds import ENTRAINMENT, GUSTS, THRESHOLD, quantities_of
from ..results.si import FLOW

_KINDS = {"threshold": THRESHOLD, "gust": GUSTS, "entrainment": ENTRAINMENT}


def quantities(task: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and words of the result of a case, error bars under NAME_low and NAME_high."""
    kind, columns = _KINDS.get(task), dict[str, Any]()
    for quantity in known.quantities() if kind is None else quantities_of(kind, result):
        columns |= quantity.columns(result)
    si = result.get("si") or {}
    return columns | {f"{name}_si": si[name] for name in FLOW if name in si}
