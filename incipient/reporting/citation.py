"""What closes every page: the scene, the versions, how to cite."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

from .page import PagePart, PageSection, Settings, section, words

CITED = (
    "If you use these numbers, please cite the program and the paper whose criteria it computes:",
    "The incipient developers, incipient, version {version}.",
    "S. J. Childs, Incipient Motion Criteria for a Rigid Sediment Grain on a Rigid Surface.",
    "The numerical method goes back to S. J. Childs and B. D. Reddy (1999), Finite Element Simulation of the Motion "
    "of a Rigid Body in a Fluid with Free Surface, arXiv:physics/9905001.",
)


def closing(directory: Path | None, parts: Sequence[PagePart]) -> tuple[PageSection, ...]:
    """The scene of a directory, or the case of a part, as TOML; versions; how to cite. Not collective."""
    texts = [part.scene for part in parts if part.scene]
    scene = None if directory is None else directory / "scene.toml"
    if scene is not None and scene.is_file():
        texts.insert(0, scene.read_text(encoding="utf-8"))
    version = metadata.version("incipient")
    computed = dict.fromkeys(f"Computed by {part.versions}." for part in parts if part.versions)
    return (
        *section("The scene", *(Settings(text) for text in texts)),
        *section("Versions", words(*computed, f"This page: incipient {version}.")),
        *section("How to cite", words(*(line.format(version=version) for line in CITED))),
    )
