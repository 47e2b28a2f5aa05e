"""The page of results: complete in itself, with the numbers of the results, readable on a telephone."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from scenes import POCKET

import incipient
import incipient.sweep
from incipient import cli
from incipient.accuracy import terms
from incipient.errors import ConvergenceError, OutputError, SceneError
from incipient.judging.case import judge_case, load_case, save
from incipient.reporting.results import REMEDIES
from incipient.scene import Domain, Effects, Fluid, Numerics, OpenChannel, Output, Scene

ROOT = Path(__file__).parents[2]
CASES, SCENE = ROOT / "demos/cases", ROOT / "demos/scenes/grain_on_bed.toml"
SMALL = (
    "domain.length=8.0",
    "domain.height=4.0",
    "body.x=4.0",
    "numerics.mesh_size=4.0",
    "numerics.order=2",
)
LOADING = {"src", "href", "srcset", "data", "poster", "action", "xlink:href"}
CHROMIUM = shutil.which("chromium")
# Run in the page when it has been loaded; what it finds is told to the frame around it, which is as wide as a
# telephone: the window of a browser is wider.
LOOK = """
<script>
addEventListener("load", () => {
  console.info("looked");
  parent.postMessage(JSON.stringify({
    width: innerWidth, across: document.documentElement.scrollWidth,
    loaded: performance.getEntriesByType("resource").map((one) => one.name).filter((name) => !name.startsWith("data:")),
    broken: [...document.images].filter((one) => !one.naturalWidth).length,
  }), "*");
});
</script>
"""
FRAME = """<iframe src="page.html" width="390" height="844" style="border: 0"></iframe>
<script>addEventListener("message", (event) => { document.title = event.data; });</script>
"""


class Seen(HTMLParser):
    """What a page loads, its numbers, its text."""

    def __init__(self, page: Path):
        super().__init__()
        self.loaded: list[str] = []
        self.numbers: list[float] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(page.read_text())
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "img"):
            self.open.append(tag)
        self.loaded += [value or "" for name, value in attrs if name in LOADING and tag != "a"]
        self.numbers += [
            float(value or "nan") for name, value in attrs if tag == "data" and name == "value"
        ]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data

    def stands_alone(self) -> bool:
        """Whether everything that is loaded is in the page."""
        return all(one.startswith("data:") for one in self.loaded) and not re.search(
            r"url\(|@import", self.text
        )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coarse run with error bars, and without the fields that pictures are drawn from."""
    directory = tmp_path_factory.mktemp("run") / "grain"
    settings = [*SMALL, "output.fields=false", 'title="A disc, <small>"']
    incipient.run(incipient.load(SCENE, settings), directory)
    return incipient.report(directory).parent


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A judged case in space."""
    directory = tmp_path_factory.mktemp("judged")
    save(judge_case(load_case(CASES / "sphere_on_three_spheres.toml")), directory)
    return directory


def numbers_of(*parts: Any) -> list[float]:
    """All numbers in data."""
    found: list[float] = []
    for part in parts:
        if isinstance(part, dict):
            found += numbers_of(*part.values())
        elif isinstance(part, list):
            found += numbers_of(*part)
        elif isinstance(part, int | float) and not isinstance(part, bool):
            found.append(float(part))
    return found


def test_the_numbers_of_a_run_are_those_of_its_result(run: Path) -> None:
    page, stored = Seen(run / "report.html"), json.loads((run / "result.json").read_text())
    assert page.stands_alone()
    force, couple, bars = stored["force"], stored["torque"], stored["error_bars"]
    planar = [vector[:2] for name, vector in force.items() if name != "repulsion"]
    turning = [couple[name][2] for name in ("flow", "surface_integral")]
    terms = [[*term["force"][:2], term["torque"][2]] for term in bars["terms"]]
    shares = [share["wall_time"] for share in stored["cost"]["effects"].values()]
    wanted = numbers_of(
        planar,
        turning,
        terms,
        shares,
        stored["coefficients"],
        bars["force"][:2],
        stored["gap"]["width"],
    )
    assert len(wanted) > 30
    assert not set(wanted) - set(page.numbers)


def test_a_run_says_all_that_is_asked_of_it(run: Path) -> None:
    page, stored = Seen(run / "report.html"), json.loads((run / "result.json").read_text())
    assert "A disc, <small>" in page.text
    assert "The grain begins to move (rolling), safety factor 0" in page.text
    assert "How sure: Certain within the error bars: it moves (rolling" in page.text
    for effect in stored["plan"]["effects"]:
        assert effect["name"] in page.text and effect["reason"] in page.text
    for said in (
        REMEDIES["gap"],
        REMEDIES["domain"],
        "reynolds = 20.0",
        "petsc 3",
        "Incipient Motion Criteria",
    ):
        assert said in page.text
    # Without fields there is nothing to draw: the page says so, and is there.
    assert "Pictures that are missing here: not drawn" in page.text and "output.fields" in page.text


def test_a_channel_says_what_its_turbulence_is(tmp_path: Path) -> None:
    scene = Scene(
        domain=Domain(length=20.0, height=1.0),
        fluid=Fluid(reynolds=10060.0, scale="flow"),
        flow=OpenChannel(),
        effects=Effects(turbulence=True),
        numerics=Numerics(mesh_size=3.0),
        output=Output(fields=False),
    )
    walls = incipient.run(scene, tmp_path).turbulence
    assert walls is not None
    page = Seen(incipient.report(tmp_path))
    assert "Turbulence" in page.text
    told = [walls.least, walls.largest, walls.shear_velocity, walls.at_outflow, walls.friction]
    at = page.numbers.index(told[0])
    assert page.numbers[at : at + 5] == told


def test_every_term_has_a_remedy() -> None:
    """By the names that the module of terms gives them."""
    written = Path(terms.__file__).read_text()
    named = re.findall(r'Term(?:\.of_\w+)?\("([\w ]+)"', written)
    assert {"discretisation", "time step", "gap", "domain"} <= set(named)
    assert {*named, terms.GROUND, terms.OF_MESH} <= REMEDIES.keys()


@pytest.mark.slow
def test_a_sweep_shows_curves_cases_and_failures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "sweep.sqlite"
    settings = (*SMALL, *POCKET, "numerics.error_bars=false", "fluid.inertia=false")
    told = [word for setting in settings for word in ("--set", setting)]
    # A grain lighter than the fluid has no threshold.
    varied = ["--over", "body.density=0.5,2.65", "--do", "threshold", "--out", str(file)]
    assert cli.main(["sweep", str(SCENE), *told, *varied]) == ConvergenceError.exit_code
    capsys.readouterr()
    assert cli.main(["report", str(file)]) == 0
    written = Path(capsys.readouterr().out.strip())
    assert written == tmp_path / "sweep_report.html"
    page, rows = Seen(written), incipient.sweep.rows(file)
    assert page.stands_alone() and any(one.startswith("data:image/webp") for one in page.loaded)
    for row in rows:
        if row["status"] == "done":
            assert {row["shields"], row["factor"], row["body.density"]} <= set(page.numbers)
        else:
            assert row["reason"] in page.text
    assert "2 cases: 1 computed, 1 failed" in page.text


def test_bad_input_is_refused_in_a_line(run: Path, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="there is no such file or directory; give"):
        incipient.report(tmp_path / "nowhere")
    with pytest.raises(SceneError, match="holds no result yet"):
        incipient.report(tmp_path)
    with pytest.raises(OutputError, match="is not the file of a sweep"):
        incipient.report(CASES / "disc_in_pocket.toml")
    stored = json.loads((run / "result.json").read_text())
    del stored["cost"]
    (tmp_path / "result.json").write_text(json.dumps(stored))
    with pytest.raises(OutputError, match=r"result\.json: holds no cost; compute it again"):
        incipient.report(tmp_path)


def test_the_page_cites_what_the_citation_file_does() -> None:
    file = (ROOT / "CITATION.cff").read_text()
    said = (ROOT / "incipient/reporting/templates/page.html").read_text()
    for title in re.findall(r"^ *-? *title: (.+)$", file, re.M):
        assert title in said
    assert "arXiv:physics/9905001" in file and "arXiv:physics/9905001" in said


@pytest.mark.slow
def test_a_threshold_has_its_numbers_and_errors(tmp_path: Path) -> None:
    found = incipient.threshold(incipient.load(SCENE, [*SMALL, *POCKET]), tmp_path)
    page = Seen(incipient.report(tmp_path))
    assert page.stands_alone() and any(one.startswith("data:image/webp") for one in page.loaded)
    assert found.bars is not None and found.errors["shields"] is not None
    flows = [one for trial in found.trials for one in (trial.factor, trial.safety_factor)]
    assert not {
        found.factor,
        found.shields,
        found.errors["shields"],
        *found.bars.terms.values(),
        *flows,
    } - {*page.numbers}
    assert f"Between {found.bars.low:.4g} and {found.bars.high:.4g} times" in page.text


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
@pytest.mark.parametrize("which", ["run", "judged"])
def test_in_a_browser(which: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """On a telephone 390 pixels wide, without a network: nothing is asked of it, nothing goes wrong."""
    page = incipient.report(request.getfixturevalue(which), tmp_path / "page.html")
    page.write_text(page.read_text().replace("</body>", f"{LOOK}</body>"))
    frame = tmp_path / "frame.html"
    frame.write_text(FRAME)
    browser = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    browser += [
        "--enable-logging=stderr",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={tmp_path / 'user'}",
    ]
    done = subprocess.run(
        [*browser, "--virtual-time-budget=5000", "--dump-dom", frame.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | {"HOME": str(tmp_path)},
    )
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert len(said) == 1 and "looked" in said[0]  # and no error
    found = json.loads(html.unescape(re.search(r"<title>(.*?)</title>", done.stdout)[1]))
    assert found["width"] == 390 and found["across"] <= 390
    assert found["loaded"] == [] and found["broken"] == 0
