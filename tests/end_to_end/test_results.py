"""Results of runs and the page that reports them."""

from __future__ import annotations

import html
import json
import math
import os
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import finished, grids
from processes import CAVITY, GRAIN_ON_BED, VORTEX_STREET, overrides, result_of, settings
from scenes import CASES, POCKET, ROOT, on_bed, rows_of

import incipient
import incipient.sweep
from incipient import cli
from incipient.accuracy import terms
from incipient.cli import main
from incipient.errors import ConvergenceError, IncipientError
from incipient.files import plain, write_json
from incipient.judging.case import judge_case, load_case
from incipient.output.series_file import read_step
from incipient.reporting.results import REMEDIES
from incipient.results.result import without_verdict
from incipient.scene import Domain, Effects, Fluid, Numerics, OpenChannel, Output, Scene
from incipient.sweep.worker import quantities

# What a run leaves behind is complete, agrees with itself, and says again what was asked.


TOP_LEVEL = {
    *("schema_version", "title", "status", "error", "scene", "plan", "cost"),
    *("force", "torque", "coefficients", "contacts", "grain", "gap", "verdict", "centrelines"),
    *(
        "trajectory",
        "error_bars",
        "without_error_bars",
        "adaptation",
        "omitted",
        "measured_cell_reynolds",
    ),
    *("si", "surface", "turbulence", "steady", "separated"),
}
STAGES = {
    "plan",
    "import",
    "mesh",
    "forms",
    "flow",
    "tractions",
    "fields",
    "omitted effects",
    "total",
}
SOME_STAGES = {"contact", "error bars"}  # where there is a grain that rests, or any
OPTIONS = {
    "numerics_mesh_size": 2,
    "numerics_order": 2,  # which the quadratic cells of the files hold exactly
    "bed_kind": "half-discs",
    "bed_radius": 0.5,
    "bed_spacing": 1.2,
    "bed_offset": 1.0,
    "gravity_acceleration": 3.0,
    "numerics_error_bars": False,
}
# Gauss's points and weights on (-1, 1), and quadratic shape functions there: both ends, then the middle.
S, WEIGHTS = np.polynomial.legendre.leggauss(6)
SHAPES = np.array([S * (S - 1) / 2, S * (S + 1) / 2, 1 - S**2])
SLOPES = np.array([S - 0.5, S + 0.5, -2 * S])


def run_here(directory, *arguments):
    """In this process, which has loaded already what a run needs."""
    assert main(["run", *map(str, arguments), "--out", str(directory)]) == 0
    return directory


@pytest.fixture(scope="module")
def grain(tmp_path_factory):
    """A disc in the pocket of a bed of half-discs."""
    return run_here(tmp_path_factory.mktemp("grain"), GRAIN_ON_BED, *settings(**OPTIONS))


@pytest.fixture(scope="module")
def cavity(tmp_path_factory):
    return run_here(
        tmp_path_factory.mktemp("cavity"),
        CAVITY,
        *settings(numerics_mesh_size=3, fluid_reynolds=100),
    )


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """The first steps of a time-dependent run, fields at every third."""
    steps = settings(
        numerics_order=2, numerics_mesh_size=4, time_end=0.05, time_step=0.005, output_every=3
    )
    return run_here(tmp_path_factory.mktemp("street"), VORTEX_STREET, *steps)


# -- result.json ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["grain", "cavity", "street"])
def test_result_has_the_documented_keys_and_its_cost(name, request):
    result = result_of(request.getfixturevalue(name))
    assert set(result) == TOP_LEVEL
    assert (result["schema_version"], result["status"], result["error"]) == (2, "complete", "")
    decision = {"name", "present", "reason", "forced", "expected", "of"}
    assert set(result["plan"]["effects"][0]) == decision
    keys = {"order", "geometry_order", "mesh_size", "convection", "scheme", "reynolds"}
    assert keys <= set(result["plan"])
    cost = result["cost"]
    assert set(cost["wall_time"]) - SOME_STAGES == STAGES
    stages = {name: seconds for name, seconds in cost["wall_time"].items() if name != "total"}
    assert 0 < sum(stages.values()) <= cost["wall_time"]["total"]
    assert all(cost[name] > 0 for name in ("unknowns", "cells", "peak_memory_mib", "ranks"))
    assert all(cost["iterations"][name] > 0 for name in ("newton", "factorisations"))
    assert cost["iterations"]["krylov"] >= 0  # none where the factors alone will do
    assert {"incipient", "dolfinx", "petsc", "python", "numpy"} <= set(cost["versions"])
    assert cost["iterations"].get("steps", 0) == (10 if name == "street" else 0)


def test_a_wide_gap_is_warned_of_wherever_the_run_is_told(tmp_path, said_by, caplog):
    scene = settings(
        numerics_mesh_size=6, numerics_error_bars=False, contact_gap=0.05, output_fields=False
    )
    warning = "contact.gap = 0.05 is wide"
    assert (
        warning in said_by("run", GRAIN_ON_BED, *scene, "--out", tmp_path)
        and f"warning: {warning}" in caplog.text
    )
    (told,) = result_of(tmp_path)["plan"]["warnings"]
    assert told.startswith(warning)


def test_forces_couples_and_contacts_fit_together(grain):
    result = result_of(grain)
    force, scene = result["force"], result["scene"]
    area, gravity = np.pi / 4, scene["gravity"]["acceleration"]
    assert force["buoyancy"] == pytest.approx([0, area * gravity, 0])
    assert force["weight"] == pytest.approx([0, -scene["body"]["density"] * area * gravity, 0])
    parts = [force[name] for name in ("flow", "buoyancy", "weight")]
    assert force["total"] == pytest.approx(np.sum(parts, axis=0))
    # The surface integral converges half as fast: it is a check, not the answer.
    assert force["surface_integral"] == pytest.approx(force["flow"], rel=0.02, abs=1e-12)
    assert result["torque"]["surface_integral"] == pytest.approx(result["torque"]["flow"], rel=0.05)
    unit = 0.5 * result["coefficients"]["reference_velocity"] ** 2
    assert result["coefficients"]["drag"] == pytest.approx(force["flow"][0] / unit)
    for load in (result["force"], result["torque"]):
        both = np.add(load["pressure"], load["viscous"])
        assert both == pytest.approx(load["surface_integral"], rel=1e-12, abs=1e-15)
    # Pressure acts through the centre of a disc.
    assert abs(result["torque"]["pressure"][2]) < 1e-5 * abs(result["torque"]["flow"][2])
    assert quantities("run", result)["pressure_force_x"] == result["force"]["pressure"][0]
    assert result["coefficients"]["moment"] == pytest.approx(result["torque"]["flow"][2] / unit)
    assert len(result["contacts"]) == 2
    for contact in result["contacts"]:
        # Both discs have the same radius: the contact lies where their surfaces meet, on the line of centres.
        arm = np.subtract(contact["point"][:2], result["grain"]["centre"])
        assert arm == pytest.approx(0.5 * np.array(contact["normal"][:2]))
    assert result["gap"]["width"] == pytest.approx(0.01) and result["gap"]["resolved"]
    assert isinstance(result["verdict"]["moves"], bool) and result["verdict"]["sentence"]


ABOVE_THE_BED = {"x": None, "centre": (5.0, 3.0)}


@pytest.mark.parametrize(
    ("sections", "body", "lacks"),
    [
        ({}, {}, ""),
        ({"contact": None}, {}, "it needs [contact]"),
        ({}, {"density": None}, "it needs body.density"),
        ({}, ABOVE_THE_BED, "it needs body.x instead of body.centre"),
        ({"contact": None}, ABOVE_THE_BED, ""),
    ],
)
def test_what_a_verdict_lacks_is_said_of_a_scene_that_has_the_rest(sections, body, lacks):
    scene = on_bed().model_dump() | sections
    stored = {"trajectory": None, "scene": scene | {"body": scene["body"] | body}}
    assert without_verdict(stored) == lacks


def test_a_cavity_has_centrelines_and_no_grain(cavity):
    result = result_of(cavity)
    assert set(result["centrelines"]) == {"minimum of v1", "maximum of v2", "minimum of v2"}
    for name in ("force", "torque", "coefficients", "grain", "gap", "verdict"):
        assert result[name] is None
    assert result["contacts"] == []
    assert not (cavity / "surface.xdmf").exists() and not (cavity / "history.csv").exists()


# -- scene.toml ----------------------------------------------------------------------------------------------


def test_the_written_scene_is_the_scene_that_ran(grain):
    asked = incipient.load(GRAIN_ON_BED, overrides(**OPTIONS))
    assert incipient.load(grain / "scene.toml") == asked


# -- fields --------------------------------------------------------------------------------------------------


def test_vtk_opens_the_fields(grain):
    (grid,) = grids(grain / "fields").values()
    assert set(grid.point_data) == {"velocity", "pressure", "vorticity"}
    assert grid.n_cells == result_of(grain)["cost"]["cells"]
    assert grid.bounds[:4] == pytest.approx((0, 24, 0, 20), abs=1e-9)
    assert grid["velocity"].shape[1] == 3
    inflow = np.abs(grid.points[:, 0]) < 1e-9
    # The profile starts from the datum, below the half-disc there, whose centre is 0.2 away.
    y, datum = grid.points[inflow, 1], result_of(grain)["plan"]["datum"]["height"]
    profile = np.minimum(y - datum, 3 * (y - np.sqrt(0.5**2 - 0.2**2)))
    assert grid["velocity"][inflow, 0] == pytest.approx(np.clip(profile, 0, None), abs=1e-9)
    centre = np.array(result_of(grain)["grain"]["computed_centre"])
    on_grain = np.isclose(np.linalg.norm(grid.points[:, :2] - centre, axis=1), 0.5, atol=1e-6)
    assert on_grain.sum() > 20 and np.abs(grid["velocity"][on_grain]).max() < 1e-12


def test_vorticity_is_that_of_the_velocity(cavity):
    """Stokes's theorem: over the box the vorticity adds up to the circulation, which is minus the lid's speed."""
    step = read_step(cavity / "fields")
    corners = step.points[step.cells[:, :3], :2]
    area = 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    middles = step.fields["vorticity"][step.cells[:, 3:]].mean(axis=1)  # exact for quadratics
    assert area.sum() == pytest.approx(1.0)
    assert area @ middles == pytest.approx(-1.0, rel=0.05)


def test_the_traction_on_the_surface_adds_up_to_the_force(grain):
    (grid,) = grids(grain / "surface").values()
    assert set(grid.point_data) == {"traction"}
    step, result = read_step(grain / "surface"), result_of(grain)
    nodes, traction = step.points[step.cells], step.fields["traction"][step.cells]
    stretch = np.linalg.norm(np.einsum("cni,ng->cgi", nodes, SLOPES), axis=2) * WEIGHTS
    there = np.einsum("cni,ng->cgi", traction, SHAPES)
    force = np.einsum("cgi,cg->i", there, stretch)
    assert stretch.sum() == pytest.approx(np.pi, rel=1e-4)
    assert force == pytest.approx(result["force"]["flow"], rel=1e-5, abs=1e-12)
    arms = np.einsum("cni,ng->cgi", nodes, SHAPES) - result["torque"]["about"]
    couple = np.einsum("cgi,cg->i", np.cross(arms, there), stretch)
    assert couple == pytest.approx(result["torque"]["flow"], rel=1e-5, abs=1e-12)


# -- time ----------------------------------------------------------------------------------------------------


def test_history_has_a_row_for_every_step(street):
    rows = rows_of(street / "history.csv")
    expected = {
        "time",
        "step",
        "newton",
        "error",
        "force_x",
        "force_y",
        "torque",
        "drag",
        "lift",
        "moment",
        "mode",
    }
    assert set(rows[0]) == expected
    assert [float(row["time"]) for row in rows] == pytest.approx(0.005 * np.arange(1, 11))
    result = result_of(street)
    last = [
        float(rows[-1][name]) for name in ("force_x", "force_y", "torque", "drag", "lift", "moment")
    ]
    coefficients = [result["coefficients"][name] for name in ("drag", "lift", "moment")]
    assert last == [*result["force"]["flow"][:2], result["torque"]["flow"][2], *coefficients]


def test_python_gives_what_the_command_gives(grain):
    result = incipient.run(incipient.load(GRAIN_ON_BED, overrides(**OPTIONS)))
    told, here = result_of(grain), plain(result.to_dict())
    for name in ("force", "torque", "coefficients", "grain", "gap", "contacts", "verdict", "scene"):
        assert here[name] == told[name]


def test_fields_are_written_when_asked_and_at_the_end(street):
    assert list(grids(street / "fields")) == pytest.approx([0.015, 0.03, 0.045, 0.05])
    assert list(grids(street / "surface")) == pytest.approx([0.015, 0.03, 0.045, 0.05])


# -- from Python ---------------------------------------------------------------------------------------------


# The page of results: complete in itself, with the numbers of the results, readable on a telephone.


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
    incipient.run(incipient.load(GRAIN_ON_BED, settings), directory)
    return incipient.report(directory).parent


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A judged case in space."""
    directory = tmp_path_factory.mktemp("judged")
    case = load_case(CASES / "sphere_on_three_spheres.toml")
    write_json(directory / "judgement.json", judge_case(case))
    return directory


def numbers_of(*parts: Any) -> list[float]:
    """All numbers in data."""
    return [float(word) for word in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", json.dumps(parts))]


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
    assert "How sure: Certain within the error bars: it moves" in page.text
    for effect in stored["plan"]["effects"]:
        assert effect["name"] in page.text and effect["reason"] in page.text
    for said in (
        REMEDIES["gap"],
        REMEDIES["domain"],
        "grain Re",
        "flow Re",
        "reynolds = 20.0",
        "petsc 3",
        "Incipient Motion Criteria",
    ):
        assert said in page.text
    # Without fields there is nothing to draw: the page says so, and is there.
    assert "Pictures that are missing here: not drawn" in page.text and "output.fields" in page.text


def test_a_threshold_of_zero_says_whose_load_it_shows(tmp_path: Path) -> None:
    """A disc on a plane rolls in any flow: area times 1.65 times 10 is its weight, a tenth of that the force shown."""
    incipient.threshold(incipient.load(GRAIN_ON_BED, SMALL), tmp_path)
    page = Seen(incipient.report(tmp_path))
    assert "rolling in one whose force is a tenth of its submerged weight" in page.text
    assert "Load on the grain [scene units]" in page.text
    along, up, _ = json.loads((tmp_path / "threshold.json").read_text())["load"]["flow_force"]
    assert math.hypot(along, up) == pytest.approx(1.65 * math.pi / 4.0)
    assert {along, up} <= set(page.numbers)


def test_a_run_below_waves_has_the_numbers_of_its_layer(tmp_path: Path) -> None:
    """By hand, with U = d = 1, T = 3.7, nu = 1/20: KC = U T/d, delta^2 = nu T/pi, Re_delta = U delta/nu."""
    waves = [
        'flow={kind="oscillatory", velocity=1.0, period=3.7}',
        "time={end=0.2, step=0.1}",
        "numerics.error_bars=false",
        "output.fields=false",
    ]
    incipient.run(incipient.load(GRAIN_ON_BED, [*SMALL, *waves]), tmp_path)
    page = Seen(incipient.report(tmp_path))
    thickness = math.sqrt(3.7 / 20.0 / math.pi)
    at = page.numbers.index(3.7)
    assert page.numbers[at : at + 3] == pytest.approx([3.7, thickness, 20.0 * thickness])
    assert all(name in page.text for name in ("KC", "delta/d", "Re_delta"))


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
    page = Seen(incipient.report(tmp_path))
    assert "Turbulence" in page.text
    told = [walls.least, walls.largest, walls.at_outflow, walls.friction, walls.shear_velocity]
    at = page.numbers.index(told[0])
    assert page.numbers[at : at + 5] == told


def test_every_term_has_a_remedy() -> None:
    """By the names that the module of terms gives them."""
    named = re.findall(r'Term(?:\.of_\w+)?\("([\w ]+)"', Path(terms.__file__).read_text())
    assert {"discretisation", "time step", "gap", "domain"} <= set(named)
    assert {*named, terms.GROUND, "mesh"} <= REMEDIES.keys()


@pytest.mark.slow
def test_a_sweep_shows_curves_cases_and_failures(tmp_path: Path, said_by: Any) -> None:
    file = tmp_path / "sweep.sqlite"
    settings = (*SMALL, *POCKET, "numerics.error_bars=false", "fluid.inertia=false")
    told = [word for setting in settings for word in ("--set", setting)]
    # A grain lighter than the fluid has no threshold.
    varied = ["--over", "body.density=0.5,2.65", "--do", "threshold", "--out", str(file)]
    assert cli.main(["sweep", str(GRAIN_ON_BED), *told, *varied]) == ConvergenceError.exit_code
    written = Path(said_by("report", file).strip())
    assert written == tmp_path / "sweep_report.html"
    page, rows = Seen(written), incipient.sweep.rows(file)
    assert page.stands_alone() and any(one.startswith("data:image/webp") for one in page.loaded)
    for row in rows:
        if row["status"] == "done":
            assert {row["shields"], row["factor"], row["body.density"]} <= set(page.numbers)
        else:
            assert row["reason"] in page.text
    assert "2 cases: 1 computed, 1 failed" in page.text


@pytest.mark.parametrize(
    ("path", "complaint"),
    [
        ("nowhere", "there is no such file or directory; give"),
        ("", "holds no result yet"),
        (CASES / "disc_in_pocket.toml", "is not the file of a sweep"),
        ("incomplete", r"result\.json: holds no cost; compute it again"),
    ],
)
def test_bad_input_is_refused_in_a_line(
    run: Path, tmp_path: Path, path: str, complaint: str
) -> None:
    if path == "incomplete":
        stored = json.loads((run / "result.json").read_text())
        del stored["cost"]
        (tmp_path / path).mkdir()
        (tmp_path / path / "result.json").write_text(json.dumps(stored))
    with pytest.raises(IncipientError, match=complaint):
        incipient.report(tmp_path / path)


def test_the_page_cites_what_the_citation_file_does() -> None:
    file = (ROOT / "CITATION.cff").read_text()
    said = (ROOT / "incipient/reporting/templates/page.html").read_text()
    for title in re.findall(r"^ *-? *title: (.+)$", file, re.M):
        assert title in said
    assert "arXiv:physics/9905001" in file and "arXiv:physics/9905001" in said


@pytest.mark.slow
def test_a_threshold_has_its_numbers_and_errors(tmp_path: Path) -> None:
    computed = incipient.threshold(incipient.load(GRAIN_ON_BED, [*SMALL, *POCKET]), tmp_path)
    page = Seen(incipient.report(tmp_path))
    assert page.stands_alone() and any(one.startswith("data:image/webp") for one in page.loaded)
    assert computed.bars is not None and computed.ranges["shields"] is not None
    flows = [one for trial in computed.trials for one in (trial.factor, trial.safety_factor)]
    assert not {
        computed.factor,
        computed.shields,
        *computed.bars.terms.values(),
        *flows,
    } - {*page.numbers}
    low, high = computed.ranges["shields"]
    assert f"({low:.4g} to {high:.4g})" in page.text


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
    command = [*browser, "--virtual-time-budget=5000", "--dump-dom", frame.as_uri()]
    done = finished(command, 120, env=os.environ | {"HOME": str(tmp_path)})
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert len(said) == 1 and "looked" in said[0]  # and no error
    computed = json.loads(html.unescape(re.search(r"<title>(.*?)</title>", done.stdout)[1]))
    assert computed["width"] == 390 and computed["across"] <= 390
    assert computed["loaded"] == [] and computed["broken"] == 0
