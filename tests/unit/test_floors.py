"""The rooms of the package on their floors: the lower ones know nothing of the higher ones, hints excepted."""

import ast
from pathlib import Path

import pytest

import incipient

PACKAGE = Path(incipient.__file__).parent
FLOORS = ("arrays", "geometry", "contact", "scene", "mesh", "fluid")


def imported(tree: ast.AST, name: str) -> set[str]:
    """The rooms that a file imports, lazily or not, but for type hints."""
    rooms = set()
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.ImportFrom):
            parts = (node.module or "").split(".")
            if node.level:
                parts = [*name.split(".")[: -node.level], *parts]
            rooms.add([*parts, ""][1] if parts[0] == "incipient" else "")
        rooms |= imported(node, name)
    return rooms


@pytest.mark.parametrize("floor", range(len(FLOORS)))
def test_lower_floors_import_no_higher_ones(floor):
    room = PACKAGE / FLOORS[floor]
    files = sorted(room.rglob("*.py")) if room.is_dir() else [room.with_suffix(".py")]
    assert files
    for file in files:
        name = ".".join(("incipient", *file.relative_to(PACKAGE).with_suffix("").parts))
        higher = imported(ast.parse(file.read_text()), name) & set(FLOORS[floor + 1 :])
        assert not higher, f"{name} imports {higher}"
