"""Formulas of the documentation, from TeX to MathML."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from xml.etree import ElementTree

PLACE = Path(__file__).parents[2] / "docs" / "mathematics.py"
SPEC = importlib.util.spec_from_file_location("mathematics", PLACE)
assert SPEC is not None and SPEC.loader is not None
mathematics = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(mathematics)


def parts(page: str) -> list[str]:
    """Names of the elements, with the text of those that have one."""
    tree = ElementTree.fromstring(f"<p>{mathematics.on_page_content(page)}</p>")
    names = (
        one.tag.rpartition("}")[2] + (f" {one.text}" if one.text else "") for one in tree.iter()
    )
    return [name for name in names if name != "mrow"]


def test_a_formula_in_a_line_becomes_a_fraction() -> None:
    found = parts(r'<span class="arithmatex">\(\frac{k^2}{\epsilon}\)</span>')
    assert found == ["p", "math", "mfrac", "msup", "mi k", "mn 2", "mi ϵ"]


def test_a_formula_by_itself_is_a_block_and_signs_of_html_are_read() -> None:
    page = '<div class="arithmatex">\n\\[a &lt; b\\]</div>'
    assert 'display="block"' in mathematics.on_page_content(page)
    assert parts(page) == ["p", "math", "mi a", "mo <", "mi b"]


def test_other_text_stays_as_it_is() -> None:
    page = r"<p>f(x) and <code>\(k\)</code></p>"
    assert mathematics.on_page_content(page) == page
