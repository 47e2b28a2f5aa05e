"""Jinja2 templates of pages, with style and pictures embedded, and the format of values."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from PIL import Image

from ..errors import OutputError
from ..results.quantity import components

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Bounded:
    """A number with both ends of its error bar."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Erring:
    """A number with its absolute error."""

    value: float
    error: float


def rendered(template: str, **context: Any) -> Markup:
    """A rendered template; text is escaped. Raises jinja2.UndefinedError for a missing key."""
    return Markup(environment(**context).get_template(template).render())


def environment(**context: Any) -> Environment:
    """Templates with a context of global names, which macros require."""
    templates = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    filters = (cell, look, components, embedded, compact)
    templates.filters |= {function.__name__: function for function in filters}
    templates.globals |= {"erring": erring, **context}
    return templates


def erring(value: float, error: float | None) -> float | Erring:
    """A number, with its error if known."""
    return value if error is None else Erring(value, error)


def embedded(path: Path) -> str:
    """A picture as a URI in WebP, of limited width. Raises OutputError for an invalid picture."""
    buffer = io.BytesIO()
    try:
        with Image.open(path) as image:
            shown = image.convert("RGB")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise OutputError(
            f"{path}: cannot be read as a picture; remove it, and it is drawn again"
        ) from error
    shown.thumbnail((1400, shown.height), Image.Resampling.LANCZOS, reducing_gap=None)
    shown.save(buffer, "WEBP", quality=88)
    return f"data:image/webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def compact(text: str) -> str:
    """TOML with short lists on one line each."""
    spread = r"\[\s+([^][]{1,80}?),?\s+\]"
    return re.sub(spread, lambda match: f"[{' '.join(match[1].split())}]", text)


def look(value: Any) -> str:
    """Style class of a cell: numbers, long texts, or none."""
    if isinstance(value, str | bool):
        return "long" if isinstance(value, str) and len(value) > 30 else ""
    return "number"


def cell(value: Any) -> Markup:
    """A cell as HTML: numbers with six digits, and in full for programs; unknown values as a dash."""
    if value is None:
        return Markup("–")
    if isinstance(value, bool | np.bool_):
        return Markup("yes" if value else "no")
    if isinstance(value, str):
        return escape(value)
    if isinstance(value, int | float):
        return _number(value, ".6g")
    if isinstance(value, Bounded):
        ends = [_number(end, ".4g") for end in (value.low, value.high)]
        return Markup("{} <small>({} to {})</small>").format(_number(value.value, ".6g"), *ends)
    if isinstance(value, Erring):
        error = _number(value.error, ".1e" if value.error else "g")
        return Markup("{} <small>± {}</small>").format(_number(value.value, ".6g"), error)
    return _vector([math.nan if part is None else float(part) for part in value])


def _vector(parts: Sequence[float]) -> Markup:
    size = max((abs(part) for part in parts if math.isfinite(part)), default=0.0)
    # Components smaller by nine orders are round-off.
    shown = (_number(part, ".6g", abs(part) <= 1e-9 * size) for part in parts)
    return Markup("({})").format(Markup(", ").join(shown))


def _number(value: float, digits: str, lost: bool = False) -> Markup:
    if isinstance(value, int):
        return Markup('<data value="{}">{}</data>').format(value, value)
    if not math.isfinite(value):
        return Markup('<data value="{}">{}</data>').format(value, "–" if math.isnan(value) else "∞")
    shown = f"{0.0 if lost else value + 0.0:{digits}}".replace("-", "−")
    return Markup('<data value="{}">{}</data>').format(repr(float(value)), shown)
