"""Files of scenes: reading, writing, refusals, and the examples of the documentation."""

from __future__ import annotations

import copy
import json
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any, get_args

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from kinds import every_grain_and_bed, write_files
from scenes import CASES, ROOT, SCENES, message

import incipient
from incipient.errors import OutputError, SceneError
from incipient.files import MARK
from incipient.scene import (
    Domain,
    Fluid,
    Polyline,
    Scene,
    Shear,
    Time,
)
from incipient.scene.file import dumps, example, load, loads, parse, save, schema
from incipient.scene.messages import variants
from incipient.scene.section import Section

# Scene files: what is read is what was written, and one line that names the file for everything else.


MINIMAL = """\
[domain]
length = 12
height = 6
[fluid]
reynolds = 20
scale = "flow"
[flow]
kind = "shear"
"""
POLYGON = """\
[body]
shape = "polygon"
vertices = [[0, 0], [{number}, 0], [0, 1]]
centre = [3, 3]
"""
WITH_FILE = MINIMAL + '[bed]\nkind = "polyline"\nfile = "bed.csv"\n'


def test_a_scene_of_eight_lines_and_the_examples_are_those_of_python():
    domain, fluid = Domain(length=12, height=6), Fluid(reynolds=20, scale="flow")
    assert loads(MINIMAL) == Scene(domain=domain, fluid=fluid, flow=Shear(rate=1))


@pytest.mark.parametrize("in_space", [False, True])
def test_the_example_explains_every_key(in_space):
    """Each key of the example's sections and of the absent ones, its description, and its choices."""
    text, scene = example(in_space), loads(example(in_space))
    for name, field in Scene.model_fields.items():
        chosen = getattr(scene, name)
        section = (
            type(chosen) if isinstance(chosen, Section) else [*variants(field.annotation), None][0]
        )
        part = re.search(
            rf"(?m)^(?:# )?\[{name}\] .*{re.escape(field.description)}\n((?:.+\n)*)", text
        )
        for key, about in () if section is None else section.model_fields.items():
            assert re.search(
                rf"(?m)^(?:# )?{key} = .* # {re.escape(about.description)}", part[1]
            ), key
            for choice in (c for c in get_args(about.annotation) if isinstance(c, str)):
                assert choice in part[1], (key, choice)


@pytest.mark.parametrize(
    "path",
    [
        # That of the pebble, which takes seconds to settle, is loaded by its own tests.
        pytest.param(path, id=path.stem, marks=pytest.mark.slow if path.stem == "pebble" else ())
        for path in sorted(SCENES.glob("*.toml"))
    ],
)
def test_demo_scenes_are_read_and_read_back(path):
    scene = load(path)
    assert scene.title and loads(dumps(scene)) == scene


@pytest.mark.parametrize("name", every_grain_and_bed())
def test_a_scene_of_each_kind_is_read_back(name, tmp_path):
    """Among its numbers is one that no few digits have."""
    write_files(tmp_path)
    plain = every_grain_and_bed()[name]
    plain["fluid"]["reynolds"] = 1.0 / 3.0
    scene = loads(tomli_w.dumps(plain), tmp_path)
    save(scene, tmp_path / "scene.toml")
    assert load(tmp_path / "scene.toml") == loads(dumps(scene)) == scene


@pytest.mark.parametrize(
    "gust",
    [
        "flow.gust.shape=cosine",
        "flow.gust.rise=0.2",
        "flow.gust={shape='points', points=[[0, 1], [1, 2]]}",
    ],
)
def test_a_gust_of_each_shape_is_read_back(gust):
    scene = loads(example(), overrides=("time.end=2", "time.step=0.1", gust))
    assert loads(dumps(scene)) == scene


def test_overrides_are_toml_values_or_bare_words():
    scene = loads(
        example(),
        overrides=(
            "fluid.reynolds=40",
            "fluid.scale=flow",
            "fluid.inertia = false",
            "domain.origin=[-4, 0]",
            "body.x=0",
            'title="Re = 40"',
            "numerics.mesh_size=5e-1",
            "time.end=2",
            "time.step=0.5",
            "time.end=3",
        ),
    )
    assert scene.time == Time(end=3.0, step=0.5)
    assert (scene.fluid.reynolds, scene.fluid.scale, scene.fluid.inertia) == (40.0, "flow", False)
    assert (scene.domain.origin, scene.body.x, scene.title) == ((-4.0, 0.0), 0.0, "Re = 40")
    assert scene.numerics.mesh_size == 0.5
    assert loads(MINIMAL, overrides=["title=Disc on a bed"]).title == "Disc on a bed"


@pytest.mark.parametrize(
    ("overrides", "title"),
    [
        (["fluid.reynolds=40"], "Disc, with fluid.reynolds=40"),
        (
            ["fluid.reynolds=40", "domain.length=9"],
            "Disc, with fluid.reynolds=40, with domain.length=9",
        ),
        (["numerics.mesh_size=2", "output.fields=false"], "Disc"),
        (["fluid.reynolds=40", "title=Fast"], "Fast"),
    ],
)
def test_a_changed_scene_does_not_keep_its_title(overrides, title):
    assert loads('title = "Disc"\n' + MINIMAL, overrides=overrides).title == title
    assert loads(MINIMAL, overrides=["fluid.reynolds=40"]).title == ""


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("fluid.renolds=4", 'fluid.renolds: unknown key; did you mean "reynolds"?'),
        ("bodi.x=4", 'bodi: unknown key; did you mean "body"?'),
        ("fluid.reynolds=-4", "fluid.reynolds: is -4; give a number greater than 0"),
        ("fluid.reynolds=fast", 'fluid.reynolds: is "fast"; give a number'),
        ("fluid.reynolds=", '"" is not a value; write a number, true, [x, y] or "text"'),
        ("fluid.reynolds=[1", '"[1" is not a value; write a number, true, [x, y] or "text"'),
        ("fluid.reynolds=4 5", '"4 5" is not a value; write a number, true, [x, y] or "text"'),
        (
            "fluid.reynolds=4\ntitle=3",
            '"4 title=3" is not a value; write a number, true, [x, y] or "text"',
        ),
        (
            "fluid.reynolds",
            'is not an assignment; write section.key=value, as in "fluid.reynolds=40"',
        ),
        ("fluid..x=1", 'is not an assignment; write section.key=value, as in "fluid.reynolds=40"'),
        ("fluid.reynolds.x=1", "fluid.reynolds is not a section; assign to fluid.reynolds itself"),
        ("flow.kind=sheer", 'flow.kind: "sheer" is not known; did you mean "shear"?'),
    ],
)
def test_wrong_overrides(override, expected):
    said = message(lambda: loads(MINIMAL, overrides=["domain.length=13", override]))
    assert said == f"--set {' '.join(override.split())}: {expected}"


@pytest.mark.parametrize(
    ("more", "override", "expected"),
    [
        (
            *("", "body.x=3"),
            'a.toml --set body.x=3: body.shape: is missing; use "disc", "ellipse", "rectangle", "polygon", '
            '"superellipse", "star" or "discs"',
        ),
        (
            *("", "domain.kind=box"),
            'a.toml --set domain.kind=box: flow.kind: "shear" needs open ends but a box is closed; ',
        ),
        # A wrong number in the file is not blamed on a key that was set.
        *(
            (POLYGON.format(number=number), "fluid.reynolds=40", "a.toml: body.vertices")
            for number in ("nan", "1e300")
        ),
    ],
)
def test_a_mistake_names_the_file_and_the_override_that_is_to_blame(more, override, expected):
    assert message(lambda: loads(MINIMAL + more, overrides=[override], name="a.toml")).startswith(
        expected
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[domain]\nlength = 12\nheight =\n", "line 3: invalid value; correct the TOML there"),
        (
            "[domain\n",
            "line 1: expected ']' at the end of a table declaration; correct the TOML there",
        ),
        (
            "[domain]\nlength = 1\nlength = 2\n",
            "line 3: cannot overwrite a value; correct the TOML there",
        ),
        ("a = " + "[" * 5000, "is nested too deeply; a scene has sections and keys only"),
        (
            "",
            "domain: is missing; add a section [domain]: The region that the fluid may fill "
            "(and 2 more errors: fluid: is missing; ",
        ),
        (
            MINIMAL.replace("reynolds = 20", "reynolds = nan"),
            "fluid.reynolds: is nan; give a finite number",
        ),
        (
            MINIMAL.replace("reynolds = 20", "reynolds = -1"),
            "fluid.reynolds: is -1; give a number greater than 0",
        ),
        (
            MINIMAL.replace("reynolds", "renolds"),
            'fluid.renolds: unknown key; did you mean "reynolds"?',
        ),
        (
            MINIMAL.replace("kind =", "kin ="),
            'flow.kind: is missing; use "shear", "poiseuille", "open-channel", ',
        ),
        (
            MINIMAL + "velocity = 1\n",
            'flow.velocity: unknown key for "shear"; known are datum, gust, kind, rate',
        ),
        (
            MINIMAL.replace('kind = "shear"', 'kind = "lid"'),
            'flow.kind: "lid" needs a box but the domain is a channel',
        ),
        (
            MINIMAL + "[contact]\nfriction = 0.5\n",
            "contact.friction: friction needs a bed but",
        ),
        (
            MINIMAL + '[body]\nshape = "disc"\ndiameter = 1\ncentre = [4, 7]\n',
            "body.centre: the grain reaches y = 7.5, the domain's top is at 6; move the grain",
        ),
        (
            "domain = 3\n" + MINIMAL.partition("[fluid]")[2].join(["[fluid]", ""]),
            "domain: is 3; write a section [domain]",
        ),
        (MINIMAL + "rate = [1]\n", "flow.rate: is a list of 1; give a number"),
        (
            MINIMAL.replace("height = 6", 'height = 6\ntop = "free-surface"'),
            "domain.top: a free surface needs time steps; add a section [time]",
        ),
        (
            MINIMAL + '[surface]\nelevation = "0.1*x"\n',
            'surface: describes a free surface, but the top is "stream"; set domain.top',
        ),
        (
            MINIMAL.replace("12", "-12").replace("20", "-20"),
            "domain.length: is -12; give a number greater than 0 (and 1",
        ),
        (
            MINIMAL.replace("height = 6", "height = 6\nwidth = 6") + "[body]\nx = 1\n",
            'body.shape: is missing; use "sphere", "cylinder", ',
        ),
        ("x = " + "9" * 5000, "has an integer with thousands of digits; shorten it"),
        ("x" * 5000 + " = 1", f"{'x' * 77}...: unknown key; known are"),
        (
            MINIMAL.replace("shear", "k" * 5000),
            f'flow.kind: "{"k" * 36}... is not known; use',
        ),
        ("title = 'K\udcf6rner'", "is not UTF-8 text at byte 10; save it as UTF-8"),
        (None, "cannot be read (No such file or directory); give the name of a scene file"),
    ],
)
def test_wrong_files(tmp_path, text, expected):
    path = tmp_path / "wrong.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
    said = message(lambda: load(path))
    assert said.startswith(f"{path}: {expected}") and len(said) < 1000


@pytest.mark.parametrize("name", ["run", "threshold", "entrainment", "make_plan"])
def test_a_name_of_a_file_is_no_scene(name):
    """They ended with "AttributeError: 'str' object has no attribute"."""
    expected = (
        f'incipient.{name} takes a scene, not the name of its file; use incipient.load("a.toml")'
    )
    assert message(lambda: getattr(incipient, name)("a.toml")) == expected


def with_bed(tmp_path: Path, rows: str) -> Scene:
    (tmp_path / "bed.csv").write_text(rows, encoding="utf-8")
    return loads(WITH_FILE, tmp_path)


def test_a_polyline_is_read_beside_the_scene_and_saved_with_it(tmp_path, monkeypatch):
    scene = with_bed(tmp_path, "x [m], (y)\n# surveyed\n-1, 0\n\n6,0.5\n12,0.25\n")
    monkeypatch.chdir(tmp_path)
    points = ((-1.0, 0.0), (6.0, 0.5), (12.0, 0.25))
    assert scene.bed == Polyline(points=points) == Polyline(file="bed.csv")
    (tmp_path / "bed.csv").unlink()
    save(scene, tmp_path / "scene.toml")
    assert load(tmp_path / "scene.toml") == scene


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("0,0\n", "bed.file: {}/bed.csv has 1 point; give two or more points"),
        ("", "bed.file: {}/bed.csv has 0 points; give two or more points"),
        (
            "0,0\n1,nan\n",
            'bed.file: {}/bed.csv line 2 is "1,nan"; write two finite numbers x, y a line',
        ),
        (
            "x,y\n0,0\n1,2,3\n",
            'bed.file: {}/bed.csv line 3 is "1,2,3"; write two finite numbers x, y a line',
        ),
        *(  # taken for a heading, and missing from the bed without a word
            (
                f"{row}\n0,0\n12,0\n",
                f'bed.file: {{}}/bed.csv line 1 is "{row}"; write two finite numbers',
            )
            for row in ("٣,٤", "nan,nan", "-1;0", "1e,2e", ",", "x,0")
        ),
        (
            "0,0\nhere,there\n",
            'bed.file: {}/bed.csv line 2 is "here,there"; write two finite numbers x, y a line',
        ),
        (
            "0,0\n6,0.5\n",
            "bed: reaches from x = 0 to 6, the domain from 0 to 12; add points or shorten the domain",
        ),
    ],
)
def test_wrong_polyline_files(tmp_path, rows, expected):
    said = message(lambda: with_bed(tmp_path, rows))
    assert said.startswith(f"scene: {expected.format(tmp_path)}")


def test_saved_scenes_are_complete(tmp_path):
    save(loads(MINIMAL), tmp_path / "scene.toml")
    data = tomllib.loads((tmp_path / "scene.toml").read_text(encoding="utf-8"))
    assert data["flow"] == {"kind": "shear", "rate": 1.0, "datum": "auto"}
    assert data["numerics"]["mesh_size"] == 1.0
    assert sorted(path.name for path in tmp_path.iterdir()) == [MARK, "scene.toml"]
    with pytest.raises(OutputError, match=r"missing/scene\.toml: cannot be written"):
        save(loads(MINIMAL), tmp_path / "missing" / "scene.toml")


# What `st.text` has without an alphabet as well, by a table that takes a second to make.
CHARACTERS = st.characters(exclude_categories=["Cs"])


@settings(deadline=None)
@given(st.text(CHARACTERS, max_size=60))
def test_any_text_is_a_scene_or_one_line(text):
    assert message(lambda: loads(text)).startswith("scene: ")


def test_the_schema_describes_every_key_and_asks_for_kind_and_shape():
    described = schema()
    definitions, text = described["definitions"], json.dumps(described)
    assert described["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert list(described["properties"]) == list(Scene.model_fields)
    for name, section in {"scene": described, **definitions}.items():
        assert section["description"] and section["additionalProperties"] is False, name
        assert all(key["description"] for key in section["properties"].values()), name
    assert "prefixItems" not in text and "$defs" not in text
    required = {"Lid": ["kind"], "Disc": ["shape", "diameter"], "Sphere": ["shape", "diameter"]}
    assert {name: definitions[name]["required"] for name in required} == required
    assert definitions["Domain"]["required"] == ["length", "height"]
    assert definitions["Domain"]["properties"]["origin"] == {
        "default": [0.0, 0.0],
        "description": "Lower left corner [length]; the bed's base line runs through it",
        "items": {"type": "number"},
        "maxItems": 3,
        "minItems": 2,
        "title": "Origin",
        "type": "array",
    }


# The TOML examples of the tutorials and the how-to pages are scenes, surveys and cases that the program takes.


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
    result = copy.deepcopy(base)
    if base and "units" in part:  # which replace these
        del result["fluid"]["reynolds"], result["gravity"]
    for name, section in part.items():
        whole = not isinstance(section, dict) or {"kind", "shape"} & section.keys()
        result[name] = section if whole else {**result.get(name, {}), **section}
    return tomli_w.dumps(result)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_taken(name: str, directory: Path) -> None:
    part = tomllib.loads(EXAMPLES[name])
    if not {"load", "errors"}.isdisjoint(part):
        from incipient.judging.case import Case

        parse(Case, merged(tomllib.loads(EXAMPLES["forces-0"]), part), directory, [], name)
        return
    if part.get("bed", {}).get("kind") == "deposited":
        from incipient.survey.request import Survey

        parse(Survey, tomli_w.dumps(part), directory, [], name)
        return
    said = []
    bases = ({}, {}) if part.keys() >= WHOLE else (TUTORIAL, IN_SPACE)
    for base in bases:
        try:
            loads(merged(base, part), directory, name=name)
        except SceneError as error:
            said.append(str(error))
    assert len(said) < 2, said


@pytest.mark.parametrize(
    ("command", "file", "said"),
    [
        ("plan", CASES / "disc_in_pocket.toml", "is a case; use incipient judge"),
        ("plan", CASES / "block_on_block.toml", "is a case; use incipient judge"),
        ("judge", SCENES / "grain_on_bed.toml", "is a scene; use incipient run"),
    ],
)
def test_a_file_of_another_command_is_named(
    said_by: Any, command: str, file: Path, said: str
) -> None:
    assert said_by(command, file, code=2).endswith(f"{file.name}: {said}\n")
