"""Formulas and examples of the documentation, and the parts of the slow tests."""

from __future__ import annotations

import ast
import importlib.util
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest
from slow_parts import PARTS, TESTS, files, of_day

import incipient

# Formulas of the documentation, from TeX to MathML.


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


# Demos, benchmarks, scripts of the documentation and tests import names that the package and helpers have.


ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    (*ROOT.glob("demos/**/*.py"), *ROOT.glob("benchmarks/**/*.py"), *ROOT.glob("docs/*.py"))
)
HELPERS = {
    path.stem: path
    for folder in ("benchmarks", "tests")
    for path in ROOT.glob(f"{folder}/**/*.py")
    if path.stem != "__init__"
}


def imports(path: Path) -> list[tuple[str, str]]:
    """Modules and the names that a script takes from them, within functions also."""
    nodes = [
        node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)
    ]
    return [(node.module, alias.name) for node in nodes if node.module for alias in node.names]


def names_in(path: Path) -> set[str]:
    """The names at the top of a module."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        found |= {
            part.id
            for part in ast.walk(node)
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
        }
    return found


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_imported_names_exist(path: Path) -> None:
    """By name, without a run: most of these scripts take minutes."""
    missing = []
    for module, name in imports(path):
        if module.partition(".")[0] == "incipient":
            there = hasattr(import_module(module), name) or find_spec(f"{module}.{name}")
        else:
            helper = HELPERS.get(module.rpartition(".")[2])
            there = helper is None or name in names_in(helper)
        if not there:
            missing.append(f"{module}.{name}")
    assert not missing


def test_no_module_hides_a_public_name() -> None:
    """A package of a public function's name would take its place as soon as anything in it is imported."""
    public = {name: getattr(incipient, name) for name in incipient.__all__}
    for path in sorted((ROOT / "incipient").rglob("*.py")):
        module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        if not module.endswith("__main__"):
            import_module(module.removesuffix(".__init__"))
    assert {name: getattr(incipient, name) for name in incipient.__all__} == public


# Every file with slow tests belongs to one part, and each part has its day.


SLOW = re.compile(r"pytest\.mark\.slow\b")


def test_every_file_with_slow_tests_is_in_one_part() -> None:
    found = {
        str(path.relative_to(TESTS))
        for path in TESTS.rglob("test_*.py")
        if SLOW.search(path.read_text())
    }
    named = [name for names in PARTS.values() for name in names]
    assert len(named) == len(set(named))
    assert found - {"unit/test_mathematics.py"} == set(named)


def test_each_part_has_its_day() -> None:
    assert {of_day(day) for day in range(1, 1 + len(PARTS))} == set(PARTS)


def test_all_parts_together_are_all_files() -> None:
    assert sorted(files("")) == sorted(one for part in PARTS for one in files(part))
    with pytest.raises(KeyError):
        files("nothing")
