"""The house as its imports have it: no floor knows a higher one, no files in a circle, few modules at the top."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import incipient

PACKAGE = Path(incipient.__file__).parent
LINKED = ("forms", "meshes")  # folders beside the package, linked into it
# From the lowest floor up; rooms beside each other on one floor do not know each other either, but for the first.
FLOORS = (
    (
        "errors",
        "installed",
        "arrays",
        "compat",
        "files",
        "form_cache",
        "interrupt",
        "parallel",
        "progress",
        "tables",
    ),
    *(
        ("forms", "geometry"),
        ("meshes", "contact"),
        ("scene",),
        ("mesh",),
        ("fluid",),
        ("body",),
        ("coupled",),
    ),
    *(
        ("planning",),
        ("results",),
        ("evaluation",),
        ("restart",),
        ("effects",),
        ("accuracy",),
        ("simulation",),
        ("adaptive",),
        ("critical",),
        ("entrainment",),
    ),
    *(
        ("output",),
        ("cost",),
        ("sweep",),
        ("survey",),
        ("pictures",),
        ("reporting",),
        ("__init__",),
        ("commands",),
        ("cli",),
        ("__main__",),
    ),
)
FLOOR_OF = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}


def modules() -> dict[str, Path]:
    """Every module of the package by its full name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts).removesuffix(".__init__")] = path
    # `rglob` does not follow the links to the folders beside the package.
    for link in LINKED:
        for path in sorted((PACKAGE / link).glob("*.py")):
            found[f"incipient.{link}.{path.stem}".removesuffix(".__init__")] = path
    return found


MODULES = modules()


def imported(name: str, hints: bool = False) -> set[str]:
    """Modules of the package that a module imports, at its top or within a function, for hints only with `hints`."""
    path = MODULES[name]
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = set()
    for node in _imports(path, hints):
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
            continue
        start = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
        base = ".".join([*start, *filter(None, [node.module])])
        found |= {f"{base}.{one.name}" if f"{base}.{one.name}" in MODULES else base for one in node.names}
    return {one for one in found if one in MODULES}


@cache
def _imports(path: Path, hints: bool = False) -> list[ast.Import | ast.ImportFrom]:
    """What a file imports anywhere, for hints only with `hints`."""
    return list(_imports_in(ast.parse(path.read_text()), hints))


def _imports_in(node: ast.AST, hints: bool) -> Iterator[ast.Import | ast.ImportFrom]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr) or (not hints and _is_for_hints(child)):
            continue
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        yield from _imports_in(child, hints)


def _is_for_hints(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def room_of(module: str) -> str:
    return [*module.split("."), "__init__"][1]


def test_every_room_has_a_floor() -> None:
    assert {room_of(module) for module in MODULES} == set(FLOOR_OF)


@pytest.mark.parametrize("room", sorted(FLOOR_OF, key=lambda room: FLOOR_OF[room]))
def test_no_room_imports_from_a_higher_floor(room: str) -> None:
    upward = [
        f"{module} imports {other}"
        for module in MODULES
        if room_of(module) == room
        for other in imported(module)
        if FLOOR_OF[room_of(other)] > FLOOR_OF[room]
    ]
    assert not upward


def test_no_files_in_a_circle() -> None:
    """What imports nothing that is left is taken away, again and again; files in a circle would be left over."""
    left = {module: imported(module) - {module} for module in MODULES}
    while free := [module for module, others in left.items() if not others & left.keys()]:
        for module in free:
            del left[module]
    assert not left


def test_demos_and_benchmarks_import_what_there_is() -> None:
    """By name, without running them: most of them take minutes, and no test of the default suite does."""
    root = Path(__file__).parents[2]
    lacking = [
        f"{path.relative_to(root)}: {node.module}.{one.name}"
        for path in sorted(
            (*root.glob("demos/**/*.py"), *root.glob("benchmarks/**/*.py"), *root.glob("docs/*.py"))
        )
        for node in _imports(path)
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "incipient"
        for one in node.names
        if not (f"{node.module}.{one.name}" in MODULES or one.name in _names_of(node.module or ""))
    ]
    assert not lacking


def _names_of(module: str) -> set[str]:
    """What a module of the package has at its top."""
    tree = ast.parse(MODULES[module].read_text()) if module in MODULES else ast.Module([], [])
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {(one.asname or one.name).partition(".")[0] for one in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)  # names that are loaded when they are asked for
    return found


def test_few_modules_at_the_top() -> None:
    at_the_top = [path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith("__")]
    assert len(at_the_top) <= 10


def test_files_of_tests_have_names_of_their_own() -> None:
    """Files without a package are modules by their bare names: of two alike only one could be collected."""
    names = Counter(path.name for path in Path(__file__).parents[1].glob("*/*.py"))
    assert not [name for name, number in names.items() if number > 1]


def test_forms_and_meshes_keep_to_their_libraries() -> None:
    """Forms are UFL alone, meshes gmsh alone; contact and the integrator know no finite elements."""
    rooms = {
        "forms": {"ufl"},
        "meshes": {"gmsh", "numpy"},
        "contact": {"numpy", "scipy", "clarabel", "numba"},
        "geometry": {"PIL", "numpy", "scipy", "trimesh"},
    }
    for room, allowed in rooms.items():
        for name, path in MODULES.items():
            if room_of(name) == room:
                assert _libraries(path) <= allowed, name


def _libraries(path: Path) -> set[str]:
    named = set()
    for node in _imports(path):
        if isinstance(node, ast.Import):
            named |= {one.name.partition(".")[0] for one in node.names}
        elif not node.level:
            named.add((node.module or "").partition(".")[0])
    return {one for one in named if one not in incipient_and_standard()}


def incipient_and_standard() -> set[str]:
    import sys

    return {"incipient", *sys.stdlib_module_names}


# What the house must not gain again: the bound of each measure is its value when it was last lowered.
BOUNDS = {
    "functions with a parameter scene": 120,
    "imports within functions": 145,
    "imports for type hints": 96,
    "circles with type hints": 1,
    "files in the largest circle with type hints": 2,
    "files beyond its folder that name turbulence": 23,
    "lines": 69_600,
}

NAMES_TURBULENCE = re.compile("turbulen|eddies", re.IGNORECASE)


@cache
def measures() -> dict[str, int]:
    """What is bounded, as the code has it now, without the folders that are linked into the package."""
    # Installed from a wheel they are folders of the package.
    own = [path for path in sorted(PACKAGE.rglob("*.py")) if path.relative_to(PACKAGE).parts[0] not in LINKED]
    texts = [path.read_text() for path in own]
    nodes = [node for text in texts for node in ast.walk(ast.parse(text))]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    hinting = [node for node in nodes if _is_for_hints(node)]
    circles = circles_with_hints()
    return {
        "functions with a parameter scene": sum("scene" in _parameters(one) for one in functions),
        "imports within functions": len({one for function in functions for one in _import_nodes(function)}),
        "imports for type hints": sum(len(_import_nodes(one)) for one in hinting),
        "circles with type hints": len(circles),
        "files in the largest circle with type hints": max(map(len, circles), default=0),
        "files beyond its folder that name turbulence": sum(
            bool(NAMES_TURBULENCE.search(text))
            for path, text in zip(own, texts, strict=True)
            if path.parent != PACKAGE / "effects/turbulence"
        ),
        "lines": sum(len(text.splitlines()) for text in texts),
    }


def _parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    arguments = function.args
    return {one.arg for one in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)}


def _import_nodes(node: ast.AST) -> list[ast.AST]:
    return [one for one in ast.walk(node) if isinstance(one, ast.Import | ast.ImportFrom)]


def circles_with_hints() -> list[set[str]]:
    """Sets of files each of which leads to every other by imports, those for type hints among them."""
    knows = {name: imported(name, hints=True) - {name} for name in MODULES}
    reach = {name: _reached(name, knows) for name in knows}
    circles = {frozenset(other for other in reach[name] if name in reach[other]) for name in knows}
    return [set(circle) for circle in circles if circle]


def _reached(start: str, knows: dict[str, set[str]]) -> set[str]:
    """All that a file leads to by one step or more."""
    reached: set[str] = set()
    ahead = list(knows[start])
    while ahead:
        if (name := ahead.pop()) not in reached:
            reached.add(name)
            ahead.extend(knows[name])
    return reached


@pytest.mark.parametrize("measure", BOUNDS)
def test_what_was_gained_is_kept(measure: str) -> None:
    assert measures()[measure] <= BOUNDS[measure]
