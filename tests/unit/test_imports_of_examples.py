"""Demos, benchmarks and scripts of the documentation import names that the package has."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    (*ROOT.glob("demos/**/*.py"), *ROOT.glob("benchmarks/**/*.py"), *ROOT.glob("docs/*.py"))
)


def package_imports(path: Path) -> list[tuple[str, str]]:
    """Modules of the package and the names that a script takes from them, within functions also."""
    nodes = [
        node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)
    ]
    return [
        (node.module, alias.name)
        for node in nodes
        if node.module and node.module.partition(".")[0] == "incipient"
        for alias in node.names
    ]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_imported_names_exist(path: Path) -> None:
    """By name, without a run: most of these scripts take minutes."""
    for module, name in package_imports(path):
        if not hasattr(import_module(module), name):
            import_module(f"{module}.{name}")
