"""The TOML examples of the tutorials and the how-to pages are scenes, surveys and cases that the program takes."""

from __future__ import annotations

import copy
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from incipient.errors import SceneError
from incipient.scene import example, loads
from incipient.scene.file import parse

ROOT = Path(__file__).parents[2]
PAGES = [
    *sorted((ROOT / "docs/tutorials").glob("*.md")),
    *sorted((ROOT / "docs/howto").glob("*.md")),
]
EXAMPLES = {
    f"{page.stem}-{number}": text
    for page in PAGES
    for number, text in enumerate(re.findall(r"^```toml\n(.*?)^```", page.read_text(), re.S | re.M))
}
FILES = {
    "outline.csv": "0,0\n1,0\n1.1,0.6\n0.5,1\n0,0.7\n",
    "profile.csv": "0,0\n5,0.1\n7,0\n9,0.2\n16,0\n24,0\n",
}
WHOLE = {
    "domain",
    "fluid",
    "flow",
    "bed",
    "body",
}  # sections of an example that is a scene by itself
TUTORIAL = tomllib.loads(EXAMPLES["verdict-0"])
IN_SPACE = tomllib.loads(example(True))
for base in (TUTORIAL, IN_SPACE):
    del base["body"]["settle"]  # which takes its time


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the files are that examples name."""
    made = tmp_path_factory.mktemp("files")
    for name, text in FILES.items():
        (made / name).write_text(text)
    shutil.copy(ROOT / "demos/scenes/pebble.stl", made)
    return made


def merged(base: dict[str, Any], part: dict[str, Any]) -> str:
    """A scene in which the sections of an example stand; one that says its kind takes the place of another."""
    found = copy.deepcopy(base)
    if base and "units" in part:  # which replace these
        del found["fluid"]["reynolds"], found["gravity"]
    for name, section in part.items():
        whole = not isinstance(section, dict) or {"kind", "shape"} & section.keys()
        found[name] = section if whole else {**found.get(name, {}), **section}
    return tomli_w.dumps(found)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_taken(name: str, directory: Path) -> None:
    part = tomllib.loads(EXAMPLES[name])
    if not {"load", "errors"}.isdisjoint(part):
        from incipient.judging.case import Case

        parse(Case, merged(tomllib.loads(EXAMPLES["forces-0"]), part), directory, [], name)
        return
    if part.get("bed", {}).get("kind") == "deposited":
        from incipient.survey.request import SurveyRequest

        parse(SurveyRequest, tomli_w.dumps(part), directory, [], name)
        return
    said = []
    bases = ({}, {}) if part.keys() >= WHOLE else (TUTORIAL, IN_SPACE)
    for base in bases:
        try:
            loads(merged(base, part), directory, name=name)
        except SceneError as error:
            said.append(str(error))
    assert len(said) < 2, said
