"""How many cells are expected before a mesh is made, and the refusal of too many."""

from pathlib import Path

import numpy as np
import pytest
from scenes import message

from incipient import load
from incipient.accuracy.first_mesh import counted
from incipient.errors import MeshError
from incipient.meshes import expected
from incipient.planning import meshing
from incipient.planning.plan import make_plan
from incipient.scene import Scene, loads
from incipient.setup.setup import Setup

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
RIPPLES = """\
[domain]
length = 1e5
height = 360
[fluid]
reynolds = 20
scale = "flow"
[flow]
kind = "shear"
[bed]
"""


@pytest.mark.parametrize("name", ["cavity", "cylinder", "grain_on_bed", "pothole_1"])
@pytest.mark.parametrize("mesh_size", [0.5, 2.0])
def test_about_as_many_cells_are_expected_as_are_made(name: str, mesh_size: float) -> None:
    assert_foretold(load(SCENES / f"{name}.toml", [f"numerics.mesh_size={mesh_size}"]))


def test_cells_of_a_bed_that_grow_with_the_distance() -> None:
    """In the pocket of a bed of half-discs; those far away are coarse."""
    bed = ("bed.kind=half-discs", "bed.radius=0.1", "bed.spacing=0.24", "bed.offset=0")
    assert_foretold(load(SCENES / "grain_on_bed.toml", bed))


def assert_foretold(scene: Scene) -> None:
    plan = make_plan(scene)
    laid_out = meshing.lay_out(Setup(scene), plan)
    cells = sum(expected.expected_cells(laid_out.shape, laid_out.sizes).values())
    made = counted(scene)
    assert made is not None and made.cells / 3 < cells < 3 * made.cells


@pytest.mark.parametrize(
    "bed",
    [
        'kind = "half-discs"\nradius = 1e-4\nspacing = 2e-4',
        'kind = "sinusoidal"\namplitude = 1e-4\nwavelength = 1e-3',
        'kind = "sinusoidal"\namplitude = 100\nwavelength = 1',
    ],
)
def test_too_many_bed_forms_are_refused_at_once(bed: str) -> None:
    found = message(lambda: loads(RIPPLES + bed))
    assert "bed: has about " in found and "--set numerics.max_cells" in found


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (RIPPLES.replace("[bed]\n", "").replace("height = 360", "height = 0.1"), "domain"),
        (RIPPLES + 'kind = "polyline"\npoints = [[0, 0], [5, 0], [5.0001, 0.1], [1e5, 0]]', "bed"),
    ],
)
def test_a_mesh_of_too_many_cells_is_refused_before_it_is_made(text: str, part: str) -> None:
    found = message(lambda: counted(loads(text)))
    assert (
        found.startswith("numerics.max_cells: a mesh of about ")
        and f"most for the {part}, more than" in found
    )
    allowed = int(found.rpartition("=")[2])
    scene = loads(text, overrides=[f"numerics.max_cells={allowed}"])
    meshing.lay_out(Setup(scene), make_plan(scene))._require_few_cells()


IN_SPACE = """
[domain]
length = 10.0
height = 5.0
width = 10.0
[fluid]
reynolds = 10.0
scale = "flow"
[flow]
kind = "shear"
"""
SPHERE = '[body]\nshape = "sphere"\ndiameter = 1.0\nx = 5.0\ndensity = 2.65\n'


@pytest.mark.parametrize("grain", [SPHERE, ""])
@pytest.mark.parametrize(
    "bed",
    [
        'kind = "spheres"\nradius = 1e-4\nspacing = 2.1e-4\narrangement = "random"',
        'kind = "spheres"\nradius = 1e-4\nspacing = 2.1e-4',
        'kind = "ridges"\namplitude = 1e-5\nwavelength = 1e-4',
    ],
)
def test_too_many_bed_forms_in_space_are_refused_at_once(grain: str, bed: str) -> None:
    """All spheres below the grain, 10^8 of them, would not fit into the memory."""
    found = message(lambda: loads(f"{IN_SPACE}{grain}[bed]\n{bed}\n"))
    assert "bed: has about " in found and "use a flat bed instead" in found


@pytest.mark.parametrize("bed", ['kind = "flat"', 'kind = "spheres"\nradius = 0.5\nspacing = 1.05'])
def test_a_gap_too_narrow_to_be_meshed_is_refused_at_once(bed: str) -> None:
    """Cells as large as the space about a sphere's contact is wide are as many as its radius over the gap, in parts."""
    text = f"{IN_SPACE}{SPHERE}[bed]\n{bed}\n[gravity]\nacceleration = 1.0\n[contact]\nfriction = 0.5\ngap = "
    found = message(lambda: counted(loads(f"{text}1e-9\n")))
    assert "most for the narrow places" in found and "enlarge contact.gap" in found


def test_a_flat_domain_is_refused_before_it_is_filled_with_boxes() -> None:
    """By hand: 1e5 / (0.51 times 30) = 6,500 by as many, or half of them, in two rows; 7.5 GiB had been asked for."""
    far = [f"domain.{key}=1e5" for key in ("length", "width")]
    scene = load(SCENES / "sphere_on_plane.toml", [*far, "body.x=5e4"])
    with pytest.raises(MeshError, match=r"too flat to be meshed: 1e\+05 long and 30 across"):
        counted(scene)


def test_the_cells_of_a_narrow_gap_are_foretold_as_if_all_were_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At most so many boxes are looked at; with all of them the number hardly changes."""
    contact = "[gravity]\nacceleration = 1.0\n[contact]\nfriction = 0.5\ngap = 1e-4\n"
    scene = loads(f'{IN_SPACE}{SPHERE}[bed]\nkind = "flat"\n{contact}')
    laid_out = meshing.lay_out(Setup(scene), make_plan(scene))
    numbers = []
    for most in (50_000, 400_000):
        monkeypatch.setattr(expected, "MOST_COUNTED", most)
        numbers.append(sum(expected.expected_cells(laid_out.shape, laid_out.sizes).values()))
    assert numbers[0] == pytest.approx(
        numbers[1], rel=0.3
    )  # a ninth, by what was counted when this was written


@pytest.mark.parametrize(
    ("across", "remedy"),
    [
        (
            [[0, 1e-5, 0], [0, 0, 1e-5]],
            "the surface of body crosses itself in .*: make body thicker or blunter there",
        ),
        (
            [[0, 1, 0], [0.3, 0.3, 1e-4]],
            "could not be meshed: .*; use another numerics.mesh_size, and make thin parts",
        ),
    ],
)
def test_what_helps_a_grain_that_cannot_be_meshed_is_said(
    across: list[list[float]], remedy: str
) -> None:
    """A needle, whose cells made smaller again and again cross all the same, and a sheet."""
    vertices = [[0, 0, 0], [1, 0, 0], *across]
    body = f'[body]\nshape = "polyhedron"\nvertices = {vertices}\ncentre = [5.0, 5.0, 2.0]\n'
    with pytest.raises(MeshError, match=remedy):
        counted(loads(f"{IN_SPACE}{body}[numerics]\nmesh_size = 3.0\n"))


@pytest.mark.parametrize(
    ("relief", "said"), [(1.0, ""), (3.0, "the bed rises by 5.7 on 1: to mesh it takes minutes")]
)
def test_a_bed_of_spikes_is_told_of_before_it_is_meshed(
    relief: float, said: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Of 20 x 20 heights every second one of every second row is raised; neighbours are 0.53 apart."""
    heights = np.zeros((20, 20))
    heights[1::2, 1::2] = relief
    np.save(tmp_path / "bed.npy", heights)
    bed = f'[bed]\nkind = "height-map"\nfile = "{tmp_path / "bed.npy"}"\ncell = [0.53, 0.53]\n'
    scene = loads(
        f"{IN_SPACE}{SPHERE}{bed}[gravity]\nacceleration = 1.0\n[contact]\nfriction = 0.5\n"
    )
    with caplog.at_level("INFO", "incipient"):
        meshing.lay_out(Setup(scene), make_plan(scene))._require_few_cells()
    assert caplog.text.count("the bed rises by") == bool(said) and said in caplog.text


@pytest.mark.parametrize(
    ("wavelength", "said"), [(1.0, ""), (0.5, "most for the bed: mesh and flow take minutes")]
)
def test_waves_much_finer_than_the_channel_are_told_of_before_they_are_meshed(
    wavelength: float, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Turbulent flow over waves 0.2 high in a channel 20 long: 12,000 cells are expected, and 26,000."""
    text = (
        '[domain]\nlength = 20.0\nheight = 4.0\n[fluid]\nreynolds = 1e6\nscale = "flow"\n'
        '[flow]\nkind = "open-channel"\n'
        f'[bed]\nkind = "sinusoidal"\namplitude = 0.1\nwavelength = {wavelength}\n[effects]\nturbulence = true\n'
    )
    scene = loads(text)
    with caplog.at_level("INFO", "incipient"):
        meshing.lay_out(Setup(scene), make_plan(scene))._require_few_cells()
    assert ("take minutes" in caplog.text) == bool(said) and said in caplog.text
