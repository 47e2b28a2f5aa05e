"""How many cells are expected before a mesh is made, and the refusal of too many."""

from pathlib import Path

import pytest
from scenes import message

from incipient import load
from incipient.meshes import expected
from incipient.planning import drawing
from incipient.planning.plan import make_plan
from incipient.scene import Scene, loads
from incipient.simulation.build import estimate

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
    laid_out = drawing.lay_out(scene, plan)
    cells = sum(expected.expected_cells(laid_out.shape, laid_out.sizes).values())
    made = estimate(scene).estimate
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
    found = message(lambda: estimate(loads(text)))
    assert (
        found.startswith("numerics.max_cells: a mesh of about ")
        and f"most for the {part}, more than" in found
    )
    allowed = int(found.rpartition("=")[2])
    scene = loads(text, overrides=[f"numerics.max_cells={allowed}"])
    drawing.lay_out(scene, make_plan(scene))._require_few_cells()
