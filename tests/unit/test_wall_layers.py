"""Layers of thin cells along walls in space: what they leave as it was, how thick they are, and distances in them."""

import numpy as np
import pytest
from mpi4py import MPI
from tetrahedra import area, cells, faces, grain_above, names, volume

from incipient import compat, make_plan
from incipient.geometry import Sphere
from incipient.mesh.domain import build
from incipient.mesh.wall_distance import cells_at, distances
from incipient.meshes import Near, Sizes, WallLayers
from incipient.meshes.curving import least_stretch
from incipient.meshes.expected import expected_cells
from incipient.meshes.solid_model import solid_model
from incipient.planning.flow_setup import Setup
from incipient.planning.meshing import lay_out
from incipient.scene import (
    Contact,
    Domain,
    Effects,
    Fluid,
    Gravity,
    Numerics,
    OpenChannel,
    Scene,
    SphereBed,
    Turbulence,
)
from incipient.scene import Sphere as SphereGrain

FIRST = {"bed": 0.02, "body": 0.01}


def sizes(layers=None):
    """Cells of 0.2 at a sphere of diameter one, and of 0.4 along the bed."""
    near = (Near(0.2, 0.4, boundary="body"), Near(0.4, 0.4, boundary="bed"))
    return Sizes(1.0, near, gap_part=0.8, layers=layers)


@pytest.mark.parametrize("symmetric", [False, True])
def test_layers_leave_the_region_as_it_is(symmetric):
    """Volume and areas are exact to what curved cells miss; no cell folds over."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5, symmetric=symmetric)
    whole = 0.5 if symmetric else 1.0
    with solid_model(region, sizes(WallLayers(FIRST, 4, 1.5)), 2) as model:
        assert volume(model) == pytest.approx(whole * (27.0 - np.pi / 6.0), rel=1e-4)
        assert area(faces(model, "body")) == pytest.approx(whole * np.pi, rel=2e-3)
        assert area(faces(model, "bed")) == pytest.approx(whole * 9.0, rel=1e-9)
        for side in ("inflow", "outflow"):
            assert area(faces(model, side)) == pytest.approx(whole * 9.0, rel=1e-9)
        if symmetric:
            assert area(faces(model, "symmetry")) == pytest.approx(9.0 - np.pi / 4.0, rel=1e-3)
        assert least_stretch(cells(model)).min() > 0.0
        assert {"bed", "body"} < set(names(model))
        found = len(cells(model))
    with solid_model(region, sizes(), 2) as plain:
        before = len(cells(plain))
    told = expected_cells(region, sizes(WallLayers(FIRST, 4, 1.5)))
    assert found > before
    assert told["layers along walls"] == pytest.approx(found - before, rel=1.0)


def test_first_cells_are_as_thick_as_wanted_and_fill_gaps():
    """Where cells at walls end, and distances from walls: by the sphere and the plane themselves."""
    region, _ = grain_above(Sphere(1.0), gap=0.1, half=1.5)
    centre = region.holes["body"].placement.centre
    shape = sizes(WallLayers(FIRST, 4, 1.5))
    domain = build(MPI.COMM_SELF, lambda: solid_model(region, shape, 2), 3)
    space = compat.space(domain.mesh, ("Lagrange", 1))
    near = cells_at(domain, ("bed", "body"))
    corners = space.tabulate_dof_coordinates()[np.unique(compat.cell_dofs(space)[near])]
    away = {"body": np.linalg.norm(corners - centre, axis=1) - 0.5, "bed": corners[:, 2]}
    for name, first in FIRST.items():
        off = away[name][(away[name] > 1e-6) & (away[name] < 2.0 * first)]
        assert np.median(off) == pytest.approx(first, rel=0.02)
    places = np.random.default_rng(3).uniform((-1.5, -1.5, 0.0), (1.5, 1.5, 3.0), (500, 3))
    from_centre = np.linalg.norm(places - centre, axis=1)
    exact = np.minimum(from_centre - 0.5, places[:, 2])[from_centre > 0.5]
    found = distances(domain, ("bed", "body"), places[from_centre > 0.5])
    # The sphere is flat pieces with edges of 0.15 at most, half of a cell: by 0.15^2/(8 0.5) they lie within it.
    assert found == pytest.approx(exact, abs=5.7e-3)


def test_no_cell_in_the_layers_of_a_pocket_folds_over():
    """Thin layers at spheres between spheres, of which cells reached 1700 times their volume through themselves."""
    centre = 4.0 + np.sqrt(1.0 / 12.0)
    scene = Scene(
        domain=Domain(length=9.0, width=5.0, height=5.866),
        fluid=Fluid(reynolds=3500.0, scale="grain"),
        flow=OpenChannel(),
        body=SphereGrain(diameter=1.0, x=4.0, density=2.65),
        bed=SphereBed(
            radius=0.5, spacing=1.0, arrangement="triangular", angle=90.0, offset=(centre, 3.0)
        ),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(model="k-omega-sst"),
        contact=Contact(friction=0.5, gap=0.05),
        gravity=Gravity(acceleration=1.0),
        numerics=Numerics(mesh_size=2.2, order=2, error_bars=False),
    )
    with lay_out(Setup(scene), make_plan(scene)).gmsh_model() as model:
        folded = least_stretch(cells(model))
    assert len(folded) > 10_000 and folded.min() > 0.05
