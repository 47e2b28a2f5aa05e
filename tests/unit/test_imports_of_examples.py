"""Demos, benchmarks, scripts of the documentation and tests import names that the package and helpers have."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import incipient

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
