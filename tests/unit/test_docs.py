"""The documentation: commands, keys, files, formulas and examples; the parts of the slow tests."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import sys
import typing
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import commands as documents
import mathematics
import pytest
from pydantic import BaseModel
from scenes import ROOT
from slow_parts import PARTS, TESTS, files, of_day

import incipient
from incipient import cli
from incipient.commands.options import COMMANDS
from incipient.judging.in_place import GrainInPlace
from incipient.scene import Scene

# Formulas of the documentation, from TeX to MathML.


def parts(page: str) -> list[str]:
    """Names of the elements, with the text of those that have one."""
    tree = ElementTree.fromstring(f"<p>{mathematics.on_page_content(page)}</p>")
    names = (
        one.tag.rpartition("}")[2] + (f" {one.text}" if one.text else "") for one in tree.iter()
    )
    return [name for name in names if name != "mrow"]


def test_formulas_in_a_line_and_by_themselves_become_mathematics() -> None:
    """Signs of HTML are read; other text stays as it is."""
    line = r'<span class="arithmatex">\(\frac{k^2}{\epsilon}\)</span>'
    assert parts(line) == ["p", "math", "mfrac", "msup", "mi k", "mn 2", "mi ϵ"]
    block = '<div class="arithmatex">\n\\[a &lt; b\\]</div>'
    assert 'display="block"' in mathematics.on_page_content(block)
    assert parts(block) == ["p", "math", "mi a", "mo <", "mi b"]
    page = r"<p>f(x) and <code>\(k\)</code></p>"
    assert mathematics.on_page_content(page) == page


# Demos, benchmarks, scripts of the documentation and tests import names that the package and helpers have.


SCRIPTS = sorted(
    (*ROOT.glob("demos/**/*.py"), *ROOT.glob("benchmarks/**/*.py"), *ROOT.glob("docs/*.py"))
)


HELPERS = {
    path.stem: path for top in ("benchmarks", "tests") for path in ROOT.glob(f"{top}/**/*.py")
}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_imported_names_exist(path: Path) -> None:
    """Without a run of the rest, which takes minutes; names of helpers stand at the begin of a line."""
    for node in ast.walk(ast.parse(path.read_text())):
        module = isinstance(node, ast.ImportFrom) and node.module
        if not module:
            continue
        if module.partition(".")[0] == "incipient":
            exec(ast.unparse(node), {})
        elif helper := HELPERS.get(module.rpartition(".")[2]):
            for alias in node.names:
                start = rf"(?m)^(?:def |class |(?:\w+, )*){alias.name}\b"
                assert re.search(start, helper.read_text()), f"{module}.{alias.name}"


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


def test_every_file_with_slow_tests_is_in_one_part_and_each_part_has_its_day() -> None:
    slow = {
        str(path.relative_to(TESTS))
        for path in TESTS.rglob("test_*.py")
        if SLOW.search(path.read_text())
    }
    named = [name for names in PARTS.values() for name in names]
    assert len(named) == len(set(named)) and slow - {"unit/test_mathematics.py"} == set(named)
    assert {of_day(day) for day in range(1, 1 + len(PARTS))} == set(PARTS)
    assert sorted(files("")) == sorted(one for part in PARTS for one in files(part))
    with pytest.raises(KeyError):
        files("nothing")


# The documents name commands, keys of scenes and files that exist.


TARGETS = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.M))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NOT_KEYS = {
    "toml",
    "json",
    "csv",
    "txt",
    "xdmf",
    "h5",
    "md",
    "py",
    "png",
    "svg",
    "log",
}  # endings of files
of_every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def models(hint: object) -> Iterator[type[BaseModel]]:
    """All models in a type, of unions and lists those of the parts."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        yield hint
    for part in typing.get_args(hint):
        yield from models(part)


def keys(of: type[BaseModel]) -> dict[str, set[str]]:
    """The keys of each section of a model."""
    return {
        name: {key for model in models(field.annotation) for key in model.model_fields}
        for name, field in of.model_fields.items()
    }


KEYS = keys(Scene)
OTHER_KEYS = {"forces.md": keys(GrainInPlace)}  # of pages on files that are no scenes


@of_every_page
def test_commands_exist(page: Path) -> None:
    named = re.findall(r"(?:`|^ *|bin/)incipient ([a-z]+)", page.read_text(), re.MULTILINE)
    assert set(named) <= set(COMMANDS)


@of_every_page
def test_commands_are_taken(page: Path) -> None:
    """Their options exist and have values of the right kind; `make docs-commands` runs them."""
    for command in documents.commands(page):
        program, *words = command.program
        if program == "incipient":
            cli._parser().parse_args(words)
        elif program == "make":
            assert words[0] in TARGETS, command.text
        else:
            assert words[0].startswith("-") or (ROOT / words[0]).exists(), command.text


@of_every_page
def test_keys_exist(page: Path) -> None:
    """Whatever is written in code as section.key is a key of that section, or a module."""
    code = re.findall(r"`([^`\n]+)`", page.read_text())
    named = {
        pair
        for text in code
        for pair in re.findall(r"(?<![\w./])([a-z]+)\.([a-z_]+)\b(?!\()", text)
    }
    modules = {(path.parent.name, path.stem) for path in (ROOT / "incipient").rglob("*.py")}
    others = OTHER_KEYS.get(page.name, {})
    assert not {
        pair
        for pair in named - modules
        if pair[0] in KEYS and pair[1] not in KEYS[pair[0]] | NOT_KEYS | others.get(pair[0], set())
    }


@of_every_page
def test_files_that_are_linked_or_named_exist(page: Path) -> None:
    """Named ones are paths in code that begin with a directory of the repository."""
    text = page.read_text()
    linked = re.findall(r"\]\((?!https?:)([^)#\s]+)[^)]*\)", text)
    named = re.findall(r"`((?:demos|docs|benchmarks|tests|forms|meshes|incipient)/[\w./-]+)`", text)
    paths = [*(page.parent / name for name in linked), *(ROOT / name for name in named)]
    assert not [path for path in paths if not path.exists()]


def test_the_navigation_names_pages_that_exist() -> None:
    pages = r"(?m)^ *- (?:[^:\n]+: )?([\w/]+\.(?:md|markdown))$"
    named = set(re.findall(pages, (ROOT / "mkdocs.yml").read_text()))
    assert len(named) > 20 and not {name for name in named if not (ROOT / "docs" / name).exists()}


@pytest.mark.skipif(
    sys.version_info[:2] != (3, 11), reason="others print signatures in other words"
)
def test_the_generated_pages_are_those_of_the_code() -> None:
    """After a change: python docs/reference.py."""
    for page, content in importlib.import_module("reference").pages().items():
        assert page.read_text(encoding="utf-8") == content, page.name


def test_the_page_on_python_says_what_calls_take_and_fields_are() -> None:
    """Names as a reader knows them, no places in memory; fields with the comments beside or above them."""
    page = (ROOT / "docs/reference/python.markdown").read_text()
    assert not re.search(r"<class|<function|numpy\.dtype|\bat 0x", page)
    assert (
        "load(path: Path | str, overrides: Sequence[str] = (), comm: Comm | None = None) -> Scene"
        in page
    )
    plan = page.partition("### `Plan`")[2].partition("### ")[0]
    assert "- `warnings`: what in the scene makes the result less sure, in words" in plan
    assert "- `sought`: What the mesh is chosen for by the run" in plan


def test_the_gallery_has_every_demo() -> None:
    """The scripts, the scenes and the cases, as far as they are not shown by another."""
    said = (ROOT / "docs" / "gallery.md").read_text()
    demos = [
        path
        for folder in ("", "scenes", "cases")
        for path in (ROOT / "demos" / folder).glob("*.[pt][yo]*")
    ]
    assert len(demos) > 30
    assert not [path for path in demos if path.stem.rstrip("_1234") not in said]
