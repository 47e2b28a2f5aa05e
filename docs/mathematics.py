r"""Formulas of the documentation as MathML, made while the site is built: no script and no network when it is read.

`pymdownx.arithmatex` marks \( ... \) and \[ ... \] on pages; `latex2mathml` sets what it has marked.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

# What arithmatex makes in its generic mode of a formula in a line, and of one that stands by itself.
MARKED = re.compile(
    r'<span class="arithmatex">\\\((?P<inline>.*?)\\\)</span>'
    r'|<div class="arithmatex">\s*\\\[(?P<block>.*?)\\\]\s*</div>',
    re.DOTALL,
)


def on_page_content(content: str, **arguments: Any) -> str:
    """The HTML of a page with its formulas as MathML; a hook of mkdocs."""
    return MARKED.sub(_mathml, content)


def _mathml(match: re.Match[str]) -> str:
    inline = match["inline"] is not None
    formula = html.unescape(match["inline"] if inline else match["block"]).strip()
    return convert(formula, display="inline" if inline else "block")
