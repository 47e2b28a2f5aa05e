"""The documents name commands, keys of scenes and files that exist."""

import importlib
import re
import sys
import typing
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from incipient import cli
from incipient.commands.options import COMMANDS
from incipient.judging.in_place import GrainInPlace
from incipient.scene import Scene

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))
import commands as documents  # noqa: E402

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
def test_linked_files_exist(page: Path) -> None:
    linked = re.findall(r"\]\((?!https?:)([^)#\s]+)[^)]*\)", page.read_text())
    assert not [name for name in linked if not (page.parent / name).exists()]


@of_every_page
def test_named_files_exist(page: Path) -> None:
    """Paths in code that begin with a directory of the repository."""
    named = re.findall(
        r"`((?:demos|docs|benchmarks|tests|forms|meshes|incipient)/[\w./-]+)`", page.read_text()
    )
    assert not [name for name in named if not (ROOT / name).exists()]


def test_the_navigation_names_pages_that_exist() -> None:
    named = set(
        re.findall(
            r"^ *- (?:[^:\n]+: )?([\w/]+\.(?:md|markdown))$",
            (ROOT / "mkdocs.yml").read_text(),
            re.M,
        )
    )
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
    assert "- `sought`: What mesh and order are chosen for by the run" in plan


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
