"""A held grain in a uniform turbulent stream by k-omega SST: what is refused, where flow leaves it, and peaks of k."""

import dolfinx
import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import message
from scipy.linalg import solve_banded
from test_turbulence import rectangle

import incipient
from incipient import compat, make_plan
from incipient.compat import petsc
from incipient.effects.turbulence.along_walls import AlongWall, at_end
from incipient.effects.turbulence.fields import TurbulenceConditions
from incipient.effects.turbulence.k_omega_sst import KOmegaSST
from incipient.forms import terms
from incipient.forms import turbulence as forms
from incipient.forms.k_omega_sst import BETA_STAR, Closure, at_smooth_wall
from incipient.mesh.sampling import sample
from incipient.planning.flow_setup import Setup
from incipient.scene import (
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Numerics,
    Output,
    Scene,
    Time,
    Turbulence,
    Uniform,
)

STREAM = {"model": "k-omega-sst", "inflow": "given", "intensity": 0.02, "length": 0.02}
UPWINDED = Numerics(mesh_size=2.0, order=2, error_bars=False, stabilisation="on")


def scene(**changes):
    sections = {
        "domain": Domain(length=22.0, height=20.0, origin=(-6.0, -10.0)),
        "fluid": Fluid(reynolds=1e5, scale="grain"),
        "flow": Uniform(),
        "body": Disc(diameter=1.0, centre=(0.0, 0.0)),
        "effects": Effects(turbulence=True),
        "turbulence": Turbulence(**STREAM),
        "numerics": Numerics(mesh_size=2.0, order=2, error_bars=False),
        "output": Output(fields=False),
    }
    return Scene(**{**sections, **changes})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"bed": Flat()},
            "bed: below a grain in a uniform turbulent stream is not simulated by this version",
        ),
        (
            {
                "body": Disc(diameter=1.0, centre=(0.0, 0.0), motion="free", density=2.0),
                "time": Time(end=1, step=0.1),
            },
            'body.motion: "free" in a uniform turbulent stream is not simulated by this version',
        ),
        (
            {"turbulence": Turbulence(model="k-omega-sst")},
            "turbulence.inflow: developed flow is no uniform stream",
        ),
        (
            {"turbulence": Turbulence(**STREAM, wall="rough", roughness=0.01)},
            'turbulence.wall: "rough" in a uniform stream is not simulated by this version',
        ),
        (
            {"numerics": Numerics(accuracy=0.01)},
            "numerics.accuracy: in a uniform stream is not simulated",
        ),
        (
            {"domain": Domain(length=22.0, height=20.0, origin=(-6.0, -10.0), top="wall")},
            'domain.top: "wall" contradicts a uniform stream',
        ),
        (
            {"turbulence": Turbulence()},
            'flow.kind: "uniform" with turbulence is not simulated by this version',
        ),
    ],
)
def test_what_contradicts_a_grain_in_a_stream_is_told_in_one_line(changes, words):
    assert words in message(lambda: scene(**changes))


def test_the_only_wall_is_that_of_the_grain():
    """Its cells are made for u* of a plate as long as the grain, and the plan says that the layer is turbulent."""
    asked = scene()
    walls = Setup(asked).resolved_walls
    assert walls.names == ("body",)
    # C_f/2 of a turbulent plate: 0.0592/2 Re^-0.2 (White 2006, Viscous Fluid Flow, 6-6).
    assert walls.shear_velocity == pytest.approx((0.0296 * 1e5**-0.2) ** 0.5, rel=0.25)
    for told in ("turbulent from its front on", "compare two meshes"):
        assert any(told in one for one in make_plan(asked).warnings)


@pytest.mark.parametrize(("per_step", "delta"), [(0.0, 0.125), (6.0, 0.1)])
def test_upwinding_in_a_step_is_for_the_shorter_of_two_times(per_step, delta):
    """By hand: |c| = 2 and cells 0.5 long are passed at the rate 8; r . (c . grad w) = 6 on a unit square."""
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    w, along = ufl.SpatialCoordinate(mesh), dolfinx.fem.Constant(mesh, (2.0, 0.0))
    strong = dolfinx.fem.Constant(mesh, (3.0, 1.0))
    term = terms.upwind_in_steps(strong, along, w, 0.5, dolfinx.fem.Constant(mesh, per_step))
    assert dolfinx.fem.assemble_scalar(compat.form(term * ufl.dx)) == pytest.approx(6.0 * delta)


def test_the_velocity_around_a_grain_may_be_upwinded_in_time():
    """Where a user switches stabilisation on; steady flow of the same scene has grad-div then."""
    in_time, on = {"time": Time(end=1.0, step=0.1)}, {"numerics": UPWINDED}
    plans = [make_plan(scene(**one)).stabilisation for one in (in_time | on, on, in_time)]
    assert [(one.present, one.upwind) for one in plans] == [
        (True, True),
        (True, False),
        (False, False),
    ]


def test_where_the_flow_leaves_a_grain_is_where_the_stress_first_turns():
    """Stress that goes as sin(a t) along the front, t the angle from it, turns at 180/a; above and below apart."""
    turns = {1.0: 100.0, -1.0: 85.0}
    angles = np.radians(np.arange(0.5, 180.0))
    places, pull = [], []
    for side, turn in turns.items():
        along = np.sin(np.pi * angles / np.radians(turn))
        places.append(np.column_stack([2.0 - np.cos(angles), 1.0 + side * np.sin(angles)]))
        pull.append(along[:, None] * np.column_stack([np.sin(angles), side * np.cos(angles)]))
    there, stress = np.concatenate(places), np.concatenate(pull)
    order = np.lexsort(there.T[::-1])
    wall = AlongWall(
        there[order], there[order], np.ones(len(there)), stress[order], np.ones(len(there))
    )
    assert wall.separates(np.array([2.0, 1.0])) == pytest.approx((100.0, 85.0), abs=0.1)


def along(velocities):
    """A level wall with velocities at places one apart."""
    count = len(velocities)
    places = np.column_stack([np.arange(count), np.zeros(count)]).astype(float)
    flow = np.column_stack([velocities, np.zeros(count)]).astype(float)
    return AlongWall(places, np.tile([0.0, -1.0], (count, 1)), np.ones(count), flow, np.ones(count))


@pytest.mark.parametrize(
    ("velocities", "spans"),
    [
        ([1, -1, -1, 1], ((0.5, 2.5),)),
        ([1, 0, -1, -2, 1], ((1.0, 3.0 + 2.0 / 3.0),)),
        ([-1, 0, 1], ((0.0, 1.0),)),
        ([0, -1, 1], ((1.0, 1.5),)),
        ([1, 1, 0], ()),
    ],
)
def test_where_the_flow_runs_upstream_also_with_nodes_at_rest(velocities, spans):
    """By straight lines from node to node, but for those at rest (by hand)."""
    assert np.ravel(along(velocities).backward()) == pytest.approx(np.ravel(spans))


def test_the_outflow_is_at_the_end_wherever_a_domain_lies():
    """Map coordinates: at a million, or at a billionth, only the last of ten nodes is there."""
    for start, step in ((0.0, 1.0), (1e6, 0.1), (0.0, 1e-10)):
        assert at_end(start + step * np.arange(10)).tolist() == [False] * 9 + [True]


@pytest.mark.parametrize("gdim", [2, 3])
def test_a_peak_of_k_at_one_node_does_not_grow(gdim):
    """Eddies of its own make a peak of k spread; in logarithms it would grow for ever on a mesh that is too coarse.

    A node 5 above its neighbours, which all diffuse alike: what is lost by diffusion, and what |grad K|^2 makes, tested
    with the hat of the node.
    """
    box = {2: dolfinx.mesh.create_unit_square, 3: dolfinx.mesh.create_unit_cube}[gdim]
    mesh = box(MPI.COMM_SELF, *[8] * gdim)
    space = compat.space(mesh, ("Lagrange", 1))
    peak = dolfinx.fem.Function(space)
    (node,) = np.nonzero(
        np.linalg.norm(space.tabulate_dof_coordinates()[:, :gdim] - 0.5, axis=1) < 1e-9
    )
    peak.x.array[node] = 5.0
    test, slope, jacobian = ufl.TestFunction(space), ufl.grad(peak), ufl.Jacobian(mesh)

    def made(across):
        square = forms._square(slope, across)
        form = (square * test - ufl.inner(slope, ufl.grad(test))) * ufl.dx(
            metadata={"quadrature_degree": 4}
        )
        return petsc.assemble_vector(compat.form(form)).array[node[0]]

    def across(vector):
        change = ufl.dot(vector, jacobian)
        return ufl.inner(change, change)

    assert made(None) > 0.0
    assert made(across) < 0.0


@pytest.mark.parametrize(("balance", "part"), [(0.5, 1.0), (4.0, 0.25), (4000.0, 0.00025)])
def test_upwinding_lasts_no_longer_than_its_source(balance, part):
    """By hand: |v| = 2 and cells 0.5 long are passed at the rate 8; beta* omega is `balance` times that."""
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    space = compat.space(mesh, ("Lagrange", 1), (2,))
    state, velocity = dolfinx.fem.Function(space), dolfinx.fem.Constant(mesh, (2.0, 0.0))
    omega = 8.0 * balance / BETA_STAR
    state.x.array[0::2], state.x.array[1::2] = -60.0, np.log(omega)
    closure, logarithms = Closure(dolfinx.fem.Constant(mesh, 1.0)), ufl.split(state)
    measure = ufl.dx(metadata={"quadrature_degree": 2})

    def of_k(size, balanced):
        stream = forms.Stream(
            velocity, 1e-12, measure, size, logarithms, reach=lambda along: size, balanced=balanced
        )
        form = forms.residual(logarithms, None, ufl.TestFunctions(space), stream, closure)
        return petsc.assemble_vector(compat.form(form)).array[0::2]

    alone = of_k(None, False)
    whole, found = of_k(0.5, False) - alone, of_k(0.5, True) - alone
    assert np.abs(whole).max() > 0.1 * balance
    assert found == pytest.approx(part * whole, rel=1e-6, abs=1e-9 * omega)


@pytest.mark.parametrize(("step", "error"), [(3.0, 0.07), (30.0, 0.005)])
def test_k_that_enters_a_layer_without_any_is_that_of_its_own_equation(step, error):
    """Next to a wall, in layers as on mesh_size = 2, k on top is suddenly a million times that below.

    Without eddies the equation of k is linear: three implicit steps of it by differences on 4000 points, over k on top.
    A front of ln k would let Newton's method go around, as at the wall of a cylinder at Re 3.6 million.
    """
    viscosity, small, added, before, count = 0.01, 1e-12, 2e-3, 1e-7, 8
    ends = np.concatenate([[0.0], np.cumsum(1.82 ** np.arange(count))])
    ends /= ends[-1]
    domain = rectangle((0, 0), (1, 1), (3, count))
    domain.mesh.geometry.x[:, 1] = np.interp(
        domain.mesh.geometry.x[:, 1], np.linspace(0.0, 1.0, count + 1), ends
    )

    def logarithms(k, away):
        log_omega = at_smooth_wall(viscosity, np.maximum(away, 0.3 * ends[1]), np)
        return np.array([np.full(len(away), np.log(small * (k + added))), log_omega])

    given = TurbulenceConditions(("top",), lambda x: logarithms(1.0, x[1]), ("bottom",))
    kinds = {"in_layers": True, "in_stream": True, "added": small * added}
    heights = np.sort(np.concatenate([ends[1:-1], 0.5 * (ends[1:-1] + ends[2:])]))
    with KOmegaSST(domain, given, 2, viscosity, **kinds) as fields:
        fields.begin(lambda places, away: logarithms(before, away))
        fields.impose()
        fields.carried_by(dolfinx.fem.Constant(domain.mesh, (0.0, 0.0)), viscosity)
        for _ in range(3):
            past = fields.state.x.array.copy()
            assert fields.step((1.0 / step, -1.0 / step, 0.0), (past, past), 1e-8) <= 1e-8
        places = np.column_stack([np.full(len(heights), 0.5), heights])
        found = np.exp(sample(fields.state, places)[:, 0]) / small - added

    fine = np.linspace(0.0, 1.0, 4001)[1:]
    spread = viscosity * step / fine[0] ** 2
    lost = 0.09 * 6.0 * viscosity / 0.075 / fine**2
    bands = np.array(
        [np.full(4000, -spread), 1.0 + 2.0 * spread + step * lost, np.full(4000, -spread)]
    )
    bands[1, -1], bands[2, -2] = 1.0, 0.0
    k = np.full(4000, before)
    k[-1] = 1.0
    for _ in range(3):
        k = solve_banded((1, 1), bands, k)
    assert np.abs(found - np.interp(heights, fine, k)).max() < error


@pytest.mark.slow
def test_slow_flow_is_that_without_turbulence():
    """At Re 40 no k is left at the disc: its drag is that of laminar flow to 0.1%."""
    slow = {"fluid": Fluid(reynolds=40.0, scale="grain")}
    weak = Turbulence(**STREAM | {"intensity": 0.001})
    # Without layers cells are larger: laminar flow on mesh_size = 2 errs by 0.14%.
    finer = Numerics(mesh_size=1.0, order=2, error_bars=False)
    without = {"turbulence": None, "effects": Effects(), "numerics": finer}
    drag, laminar = (
        incipient.run(scene(**slow, **sections)).force.flow[0]
        for sections in ({"turbulence": weak}, without)
    )
    assert drag == pytest.approx(laminar, rel=1e-3)


@pytest.mark.slow
def test_a_thin_layer_becomes_turbulent_within_long_steps(tmp_path):
    """Re 3.6 million, set off at once: nearly every step up to t = 0.1 is a quarter longer than the one before.

    The flow then leaves the grain nowhere but at its rear: a laminar layer set off at once turns first there, at
    t = 0.35 R/V (Blasius 1908, Z. Math. Phys. 56, 1), a turbulent one later. A speed that goes up and down from node to
    node along the wall turned at 94 and 72 degrees.
    """
    fast = {"fluid": Fluid(reynolds=3.6e6, scale="grain"), "numerics": UPWINDED}
    incipient.run(scene(**fast, time=Time(end=0.1, step=0.1, first_step=0.01)), tmp_path)
    rows = np.genfromtxt(
        tmp_path / "history.csv", delimiter=",", names=True, dtype=None, encoding=None
    )
    assert len(rows) < 25
    assert min(rows["separation_above"][-1], rows["separation_below"][-1]) > 170.0
