"""Wheel and source package: built from the checkout as it is, complete, and usable."""

from __future__ import annotations

import email
import os
import shutil
import sys
import zipfile
from email.message import Message
from pathlib import Path

import pytest
from environment import environment, finished
from scenes import CASES, ROOT

NOT_COPIED = (
    ".git",
    ".venv",
    "build",
    "dist",
    "*.egg-info",
    "__pycache__",
    ".*_cache",
    ".hypothesis",
)
BUILD = "from setuptools import build_meta; build_meta.build_{kind}({target!r})"
LINKED = "https://example.org/incipient"

pytest.importorskip("setuptools", minversion="77")


def copied(source: Path, target: Path) -> Path:
    everywhere = shutil.ignore_patterns(*NOT_COPIED)

    def ignored(directory: str, names: list[str]) -> set[str]:
        """What is nowhere copied, and results of runs, which are not in the package."""
        of_runs = {"results"} if Path(directory).name != "incipient" else set()
        return set(everywhere(directory, names)) | of_runs

    shutil.copytree(source, target, symlinks=True, ignore=ignored)
    return target


def built(kind: str, source: Path, target: Path) -> Path:
    """The package that a build makes of a source, by the interface that pip uses."""
    code = BUILD.format(kind=kind, target=str(target))
    command = [sys.executable, "-W", "error::DeprecationWarning:setuptools", "-c", code]
    assert "Deprecated" not in finished(command, 120, cwd=source, env=environment()).stderr
    (package,) = target.iterdir()
    return package


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That of the checkout."""
    directory = tmp_path_factory.mktemp("wheel")
    return built("wheel", copied(ROOT, directory / "checkout"), directory / "made")


@pytest.fixture(scope="module")
def unpacked_sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source package of the checkout, unpacked."""
    directory = tmp_path_factory.mktemp("sdist")
    sdist = built("sdist", copied(ROOT, directory / "checkout"), directory / "made")
    shutil.unpack_archive(sdist, directory / "unpacked")
    (top,) = (directory / "unpacked").iterdir()
    return top


def contents_of(wheel: Path) -> tuple[set[str], Message]:
    """Files in a wheel, those that describe it excepted, and its metadata."""
    with zipfile.ZipFile(wheel) as archive:
        (described,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        files = {name for name in archive.namelist() if ".dist-info/" not in name}
        return files, email.message_from_bytes(archive.read(described))


def files_below(directory: Path) -> set[str]:
    """Relative paths of what is kept in a directory, links followed."""
    result = (
        Path(where) / name
        for where, _, names in os.walk(directory, followlinks=True)
        for name in names
    )
    relative = {path.relative_to(directory) for path in result}
    left_out = {"__pycache__", *(["results"] if directory.name != "incipient" else [])}
    return {path.as_posix() for path in relative if not left_out & set(path.parts)}


def test_the_wheel_has_every_file(wheel: Path) -> None:
    """Also those behind the links `incipient/forms` and `incipient/meshes`, and nothing beside the package."""
    assert contents_of(wheel)[0] == {
        f"incipient/{name}" for name in files_below(ROOT / "incipient")
    }


@pytest.mark.slow
def test_the_wheel_runs(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    code = "import incipient; print(incipient.__file__); from incipient.cli import main; raise SystemExit(main())"
    done = finished(
        [sys.executable, "-P", "-c", code, "judge", CASES / "disc_in_pocket.toml"],
        timeout=300,  # compiles the batch judge: 14 s alone
        env=environment() | {"PYTHONPATH": str(tmp_path)},
    )
    assert done.stdout.startswith(str(tmp_path)) and "The grain stays at rest" in done.stdout


TOP = ["Makefile", "LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "pyproject.toml"]


def test_the_source_package_is_complete_and_can_be_set_up(unpacked_sdist: Path) -> None:
    for directory in ("demos", "docs", "tests", "benchmarks", ".ci", "incipient"):
        assert files_below(unpacked_sdist / directory) == files_below(ROOT / directory), directory
    for name in TOP:
        assert (unpacked_sdist / name).read_bytes() == (ROOT / name).read_bytes()
    assert os.access(unpacked_sdist / "setup.sh", os.X_OK)


@pytest.mark.parametrize("repository", ["", LINKED])
def test_links_of_the_readme_are_absolute_where_the_address_is_known(
    repository: str, tmp_path: Path
) -> None:
    """A package index shows no picture that is named by a path."""
    source = copied(ROOT, tmp_path / "source")
    settings = (source / "pyproject.toml").read_text().replace("[project.urls]", "[project.other]")
    if repository:
        settings += f'\n[project.urls]\nRepository = "{repository}"\n'
    (source / "pyproject.toml").write_text(settings)
    shown = contents_of(built("wheel", source, tmp_path / "made"))[1].get_payload()
    assert isinstance(shown, str)
    raw, blob = (f"{repository}/{kind}/HEAD/" if repository else "" for kind in ("raw", "blob"))
    assert f"]({raw}docs/figures/grain_on_bed_flow.png)" in shown
    assert f"[a moving grain]({blob}docs/tutorials/moving.md)" in shown
