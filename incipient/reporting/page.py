"""What a page is made of, and the HTML that is made of it.

Everything that a reader's browser needs stands in the page itself: style, pictures, script.
"""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from PIL import Image

from ..errors import OutputError

WIDEST, QUALITY = 1400, 88  # of a picture on the page: pixels; of its compression, per cent
LONG = 30  # letters: a text that needs a wide column
LOST = 1e-9  # of a vector: a component below it is round-off
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Bounded:
    """A number with the ends of its error bar."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Erring:
    """A number with its absolute error."""

    value: float
    error: float


# A vector is a tuple of numbers; None is a number that a file could not hold, or that is not there.
Cell = str | bool | int | float | Bounded | Erring | Sequence[float | None] | None
Rows = list[tuple[Cell, ...]]


@dataclass(frozen=True)
class PageTable:
    """Rows of cells under heads. The first column names the rows."""

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Words:
    """Paragraphs; one that begins with ``warning`` stands out."""

    lines: tuple[str, ...]
    kind: ClassVar[str] = "words"


@dataclass(frozen=True)
class Settings:
    """A scene or a case as TOML."""

    text: str
    kind: ClassVar[str] = "settings"

    @property
    def compact(self) -> str:
        """The settings with short lists on one line each."""
        spread = r"\[\s+([^][]{1,80}?),?\s+\]"
        return re.sub(spread, lambda found: f"[{' '.join(found[1].split())}]", self.text)


@dataclass(frozen=True)
class Picture:
    """A picture in a file, shown with a caption."""

    path: Path
    caption: str
    kind: ClassVar[str] = "picture"

    @property
    def uri(self) -> str:
        """The picture itself, as WebP, made smaller where it is very wide; raises OutputError for what is none."""
        stream = io.BytesIO()
        try:
            with Image.open(self.path) as image:
                shown = image.convert("RGB")
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise OutputError(
                f"{self.path}: cannot be read as a picture; remove it, and it is drawn again"
            ) from error
        if shown.width > WIDEST:
            size = WIDEST, round(shown.height * WIDEST / shown.width)
            shown = shown.resize(size, Image.Resampling.LANCZOS)
        shown.save(stream, "WEBP", quality=QUALITY)
        return f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode()}"


Block = PageTable | Words | Settings | Picture


@dataclass(frozen=True)
class PageSection:
    """Blocks under a heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class PagePart:
    """What a page says of one result.

    kind:       what the result is of, such as "Run"
    statements: the verdict, the most important sentence first
    certainty:  how sure it is, in words; empty where that is not known
    versions:   of the programs that computed it
    scene:      its scene or case as TOML; empty where it stands elsewhere
    """

    kind: str
    title: str
    statements: tuple[str, ...]
    sections: tuple[PageSection, ...]
    certainty: str = ""
    notes: tuple[str, ...] = ()
    versions: str = ""
    scene: str = ""


@dataclass(frozen=True)
class Page:
    """A title, the parts, and what concerns them all."""

    title: str
    parts: tuple[PagePart, ...]
    closing: tuple[PageSection, ...]


def html(page: Page) -> str:
    """The page as one HTML document."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {"cell": cell, "look": look}
    return environment.get_template("page.html").render(page=page, style=_own("page.css"))


def section(title: str, *blocks: Block | None) -> tuple[PageSection, ...]:
    """A section of the blocks that there are; none where there are none."""
    there = tuple(block for block in blocks if block is not None)
    return (PageSection(title, there),) if there else ()


def picture_beside(record: Path, caption: str) -> Picture | None:
    """The picture of a file of results, under its name, if it is there."""
    path = record.with_suffix(".png")
    return Picture(path, caption) if path.is_file() else None


def table(head: Sequence[str], rows: Sequence[Sequence[Cell]]) -> PageTable | None:
    """A table, if it has rows."""
    return PageTable(tuple(head), tuple(tuple(row) for row in rows)) if rows else None


def words(*lines: str) -> Words | None:
    """Paragraphs of the lines that are not empty, if there are any."""
    there = tuple(line for line in lines if line)
    return Words(there) if there else None


def look(value: Cell) -> str:
    """The class of a cell in the page's style: of numbers, of long texts, or none."""
    if isinstance(value, str | bool):
        return "long" if isinstance(value, str) and len(value) > LONG else ""
    return "number"


def cell(value: Cell) -> Markup:
    """A cell as HTML: numbers with six digits, in full for programs; what is not known is a dash."""
    if value is None:
        return Markup("–")
    if isinstance(value, bool):
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
    """Components in brackets; those lost in round-off are shown as zero."""
    size = max((abs(part) for part in parts if math.isfinite(part)), default=0.0)
    shown = (_number(part, ".6g", abs(part) <= LOST * size) for part in parts)
    return Markup("({})").format(Markup(", ").join(shown))


def _number(value: float, digits: str, lost: bool = False) -> Markup:
    """A number for readers, zero where it is lost in round-off, and in full for programs."""
    if isinstance(value, int):
        return Markup('<data value="{}">{}</data>').format(value, value)
    if not math.isfinite(value):
        return Markup('<data value="{}">{}</data>').format(value, "–" if math.isnan(value) else "∞")
    shown = f"{0.0 if lost else value + 0.0:{digits}}".replace("-", "−")
    return Markup('<data value="{}">{}</data>').format(repr(value), shown)


def _own(name: str) -> Markup:
    """A file of the page itself, which needs no escaping."""
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))
