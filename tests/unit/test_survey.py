"""Beds of many grains: deposition, pockets, laws of pivot angles, files, full runs, thresholds, bad input, poses."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scenes import message, sphere_on_plane
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from incipient.arrays import known_percentiles, percentile
from incipient.errors import MissingError, SceneError
from incipient.geometry.contacts import Contacts, balance
from incipient.scene import Ellipsoid
from incipient.scene.file import dumps, example, loads, parse
from incipient.survey.beds import DOWN, Spheres, _near, deposited, rolled, spheres_of
from incipient.survey.full_runs import coefficients_of, reynolds_of, scene_of
from incipient.survey.outcome import with_constant_drag
from incipient.survey.pockets import Pocket, Surface, critical_force, exposed, pockets
from incipient.survey.procedure import _settings, survey, survey_poses
from incipient.survey.request import FlowPast, Survey, Surveyed
from incipient.sweep.cases import identity_of

DEPOSITED = """
[bed]
kind = "deposited"
number = 60
length = 6.0
width = 6.0
seed = 3
"""


def asked(text: str = DEPOSITED, *settings: str) -> Survey:
    return parse(Survey, text, ".", settings, "bed.toml")


# Centres of a triangular layer of spheres of diameter 1 that touch, rows along y, on the plane z = 0, and its period.
LAYER = np.array(
    [(math.sqrt(0.75) * i, j + 0.5 * (i % 2), 0.0) for i in range(12) for j in range(12)]
)
PERIOD = np.array([12 * math.sqrt(0.75), 12.0])
ON_THREE = np.array(
    [1.0 / math.sqrt(3.0), 0.0, math.sqrt(2.0 / 3.0)]
)  # from a sphere to one on it and two others
UP = np.array([0.0, 0.0, 1.0])


def pockets_of(
    spheres: Spheres, numbers: list[int] | None = None, azimuth: float = 0.0
) -> list[Pocket]:
    surface = Surface.of(spheres)
    chosen = exposed(spheres, surface, Surveyed()) if numbers is None else np.array(numbers)
    return list(pockets(spheres, surface, chosen, FlowPast(azimuth=azimuth)))


def on_pocket(size: float, azimuth: float = 0.0) -> Pocket:
    """A sphere in the middle pocket of a triangular layer whose two spheres ahead are one beside the other."""
    height = math.sqrt((0.5 + 0.5 * size) ** 2 - 1.0 / 3.0)
    centre = LAYER[78] + np.array([ON_THREE[0], 0.0, height])
    radii = np.append(np.full(144, 0.5), 0.5 * size)
    (result,) = pockets_of(Spheres(np.vstack([LAYER, centre]), radii, PERIOD), [144], azimuth)
    return result


@pytest.fixture
def swept(monkeypatch, tmp_path) -> dict[str, dict[str, object]]:
    """Rows of a sweep by identity: loads and thresholds that grow from case to case; wide gaps fail."""
    rows: dict[str, dict[str, object]] = {}

    def sweep(scenes, *_, do, **__):
        for scene in scenes:
            identity, count = identity_of(scene, do), len(rows)
            row = {
                "id": identity,
                "status": "failed" if "wide" in scene.title else "done",
                "force_x": 5.0 + 0.01 * count,
                "torque_y": 1.0,
                "mode": "rolling",
                "shields_nominal": 0.01 * (count + 1),
            }
            rows.setdefault(identity, row)

    monkeypatch.setattr("incipient.survey.procedure.run_sweep", sweep)
    monkeypatch.setattr("incipient.survey.procedure.rows_of", lambda _: [*rows.values()])
    (tmp_path / "runs.sqlite").touch()
    return rows


@pytest.mark.parametrize(
    ("centres", "period", "said"),
    [
        # Thirty grains on a box of 1e9 asked for 89 GiB: 12 points across a grain of 1 are 1.2e10 x 96.
        (
            *(np.zeros((30, 3)), np.array([1e9, 8.0])),
            "bed: its surface, 1e+09 x 8, takes 1.2e+12 points",
        ),
        (np.outer(np.arange(30.0), [1.0, 1.0, 0.0]), None, "median grains wide"),
    ],
    ids=["too large", "spheres in a row"],
)
def test_what_is_no_bed_is_refused(centres, period, said):
    assert said in message(lambda: Surface.of(Spheres(centres, np.full(30, 0.5), period)))


@pytest.mark.parametrize("azimuth", [0.0, 37.0])
def test_a_measured_bed_is_surveyed_alike_however_its_axes_are_turned(azimuth):
    """A patch of a layer has the layer's level; grains three diameters from its straight sides are surveyed."""
    to_bed = Rotation.from_euler("z", -azimuth, degrees=True)
    turned = to_bed.apply(LAYER) + np.array([50.0, -20.0, 0.0])
    radii, margin = np.full(144, 0.49), 3.0 * 0.98
    result = Surface.of(Spheres(turned, radii))
    whole = Surface.of(Spheres(LAYER, radii, PERIOD))
    assert result.level == pytest.approx(whole.level, abs=0.01)
    x, y = LAYER[:, 0], LAYER[:, 1]
    far = (x > margin) & (x < x.max() - margin) & (y > margin) & (y < 11.5 - margin)
    assert (result.inside == far).all()


def test_neighbours_of_one_height_do_not_rest_on_each_other():
    """Spheres of a level layer, moved up and down by round-off, carry none of the six beside them."""
    above = LAYER + ON_THREE
    above[:, 2] += 1e-13 * np.random.default_rng(0).standard_normal(144)
    spheres = Spheres(np.vstack([LAYER, above]), np.full(288, 0.5), PERIOD)
    result = pockets_of(spheres, [200, 201, 202, 203])
    assert [(len(one.contacts), one.carries) for one in result] == [(9, 0)] * 4


@pytest.mark.parametrize("spread", [0.0, 0.4])
def test_each_sphere_rests_on_those_before_it(spread):
    """Its weight is balanced by the normals of its contacts alone, and no two spheres overlap."""
    drawn = np.clip(np.random.default_rng(0).standard_normal(120), -2.0, 2.0)
    result = deposited(0.5 * (1.0 + spread) ** drawn, np.array([9.0, 8.0]), seed=3)
    for number in range(len(result)):
        before = Spheres(result.centres[:number], result.radii[:number], result.period)
        normals, _ = _near(before, result.centres[number], float(result.radii[number]), 1e-9, 0.0)
        left, _ = balance(normals, DOWN)
        assert np.abs(left).max() < 1e-9
        away = np.linalg.norm(result.without(number).away(result.centres[number]), axis=1)
        assert (away - result.without(number).radii - result.radii[number]).min() > -1e-12


def test_the_seed_and_the_tries_decide():
    radii, period = np.full(50, 0.5), np.array([5.0, 5.0])
    first, again, other = (deposited(radii, period, seed) for seed in (1, 1, 2))
    assert (first.centres == again.centres).all() and not (first.centres == other.centres).all()
    # The more places are tried the more level the bed is.
    rough, level = (Surface.of(deposited(radii, period, 1, tries)).deviation for tries in (1, 10))
    assert level < rough


def test_a_sphere_rolls_into_the_pocket_or_off_the_bed():
    """From anywhere above a triangular layer to sqrt(2/3) above it; from a single sphere off the bed."""
    below = Spheres(LAYER, np.full(144, 0.5), PERIOD)
    for x, y in np.random.default_rng(4).uniform(3.0, 6.0, (10, 2)):
        rest = rolled(below, np.array([x, y, np.inf]), 0.5)
        assert rest[2] == pytest.approx(math.sqrt(2.0 / 3.0), abs=1e-9)
    with pytest.raises(SceneError, match="rolls off the bed"):
        rolled(Spheres(np.zeros((1, 3)), np.array([0.5])), np.array([0.1, 0.0, np.inf]), 0.5)


@pytest.mark.parametrize("size", [0.6, 1.0, 1.4, 2.0])
def test_pivot_angle_over_two_spheres(size):
    """Kirchner et al. (1990): tan = (1/sqrt 3)/sqrt((D/K)^2 + 2 D/K - 1/3); upstream twice as much over one."""
    result, exact = on_pocket(size), 1.0 / math.sqrt(3.0 * (size**2 + 2.0 * size - 1.0 / 3.0))
    assert result.pivot == pytest.approx(math.degrees(math.atan(exact)), abs=1e-5)
    assert len(result.contacts) == 3 and result.carries == 0
    ahead = math.degrees(math.atan(2.0 * exact))
    assert on_pocket(size, 180.0).pivot == pytest.approx(ahead, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "value", "within"),
    [
        ("exposure", math.sqrt(2.0 / 3.0), 1e-9),  # above the tops of the layer
        # The mean of a triangular layer, half balls and the floor below them, is about 0.3 above its centres; the
        # bead raises it a little.
        ("protrusion", math.sqrt(2.0 / 3.0) + 0.5 - 0.3, 0.05),
        ("visible", 1.0, 0.03),
        ("sheltered", 0.0, 0.25),
        ("skew", 0.0, 0.02),
    ],
)
def test_how_far_it_stands_out(name, value, within):
    assert getattr(on_pocket(1.0), name) == pytest.approx(value, abs=within)


def test_what_carries_another_is_told():
    spheres = deposited(np.full(60, 0.5), np.array([6.0, 6.0]), 3)
    result = pockets_of(spheres)
    for one in result:
        away = spheres.without(one.number).away(one.centre)
        touching = np.linalg.norm(away, axis=1) < 1.0 + 1e-6
        assert one.carries == int((away[touching, 2] < 0.0).sum())
    assert 0 < sum(not one.carries for one in result) < len(result)
    assert len(exposed(spheres, Surface.of(spheres), Surveyed(most=5))) == 5


def test_grains_on_the_floor_are_left_out_with_a_reason(tmp_path):
    """The floor holds their weight, which their neighbours alone would not: they had no pivot angle."""
    thin = survey(
        asked(DEPOSITED, "bed.number=40", "bed.length=8.0"), tmp_path, tmp_path, MPI.COMM_SELF
    )
    left = {*range(40)} - {one.number for one in thin.pockets}
    heights = [thin.spheres.centres[number][2] for number in left]
    assert heights == pytest.approx([0.5] * (thin.exposed - len(thin.pockets)))
    assert np.isfinite([one.pivot for one in thin.pockets]).all()
    assert (
        f"left out            {len(left)} grains, which lie on the floor of the box" in thin.text()
    )


def test_constant_drag_by_hand():
    """A grain that stands out as a whole: drag 0.76/2 (integral of the log law squared over its disc)."""

    def inside(z: float) -> float:
        speed = math.log(max(30.0 * z, 1.0)) / 0.41
        return speed**2 * 2.0 * math.sqrt(max(0.25 - (z - 0.5) ** 2, 0.0))

    force = math.pi / 6.0 * math.tan(math.radians(40.0))
    exact = force / (0.5 * 0.76 * quad(inside, 0.0, 1.0, limit=200)[0])
    assert with_constant_drag(40.0, 1.0, 1.0) == pytest.approx(exact, rel=1e-3)
    assert with_constant_drag(40.0, -0.1, 1.0) == math.inf


@pytest.mark.parametrize(
    ("kind", "text", "diameters"),
    [
        ("spheres", "x,y,z,diameter\n0,0,0,1\n1,0,0,1.5\n2,0,0,2\n", [1.0, 1.5, 2.0]),
        # Of equal volume.
        (
            "ellipsoids",
            "Ngrain,Xc,Yc,Zc,Dmax,Dmed,Dmin,angle_Mview,angle_Xview\n"
            + "".join(f"{k},{k},0,0,2,1,0.5,10,20\n" for k in range(3)),
            [1.0] * 3,
        ),
    ],
)
def test_files_of_spheres_and_ellipsoids(kind, text, diameters, tmp_path):
    (tmp_path / "bed.csv").write_text(text)
    result = spheres_of(asked(f'[bed]\nkind = "{kind}"\nfile = "bed.csv"').bed, tmp_path)
    assert 2.0 * result.radii == pytest.approx(diameters) and result.period is None
    assert result.centres[:, 0].tolist() == [0.0, 1.0, 2.0]


def test_labels_become_spheres_of_their_area(tmp_path):
    y, x = 0.05 * np.mgrid[:80, :80]
    heights, labels = np.zeros((80, 80)), np.zeros((80, 80), dtype=np.int32)
    for number, (a, b, r) in enumerate([(1.0, 1.0, 0.5), (2.5, 1.2, 0.7), (1.5, 3.0, 0.6)], 1):
        away = (x - a) ** 2 + (y - b) ** 2
        heights = np.maximum(heights, np.sqrt(np.maximum(r * r - away, 0.0)))
        labels[away < r * r] = number
    np.save(tmp_path / "h.npy", heights)
    np.save(tmp_path / "l.npy", labels)
    text = '[bed]\nkind = "labels"\nheights = "h.npy"\nlabels = "l.npy"\ncell = [0.05, 0.05]'
    result = spheres_of(asked(text).bed, tmp_path)
    assert result.radii == pytest.approx([0.5, 0.7, 0.6], rel=0.02)
    assert result.centres[1] == pytest.approx([2.5, 1.2, 0.0], abs=0.03)


def test_measured_grains_are_let_down_onto_their_neighbours():
    """A bead measured a tenth of a diameter above its pocket rests in it."""
    place = LAYER[78] + ON_THREE + 0.1 * UP
    (result,) = pockets_of(Spheres(np.vstack([LAYER, place]), np.full(145, 0.5)), [144])
    assert result.shifted == pytest.approx(0.1, abs=1e-6)
    assert result.pivot == pytest.approx(math.degrees(math.atan(1.0 / math.sqrt(8.0))), abs=1e-4)


def test_the_share_of_values_that_are_not_larger():
    """By counting: of 1 to 20, five percent are 1 or less; infinite values are the largest."""
    values = np.arange(1.0, 21.0)
    assert [percentile(values, share) for share in (5, 50, 84, 95)] == [1.0, 10.0, 17.0, 19.0]
    assert [percentile([3.0, math.inf, 1.0], share) for share in (50, 84)] == [3.0, math.inf]


@pytest.mark.parametrize(
    ("count", "told"),
    [(2, []), (3, [50]), (7, [16, 50, 84]), (20, [16, 50, 84]), (21, [5, 16, 50, 84, 95])],
)
def test_few_values_tell_few_percentiles(count, told):
    """None where the smaller side of a percentile would hold one value at most."""
    assert known_percentiles((5, 16, 50, 84, 95), count) == told


def test_the_scene_has_the_grain_in_its_pocket():
    """As near its neighbours as the gap and no nearer, the flow's datum where the bed's surface is."""
    radii = 0.5 * 1.3 ** np.clip(np.random.default_rng(5).standard_normal(150), -2.0, 2.0)
    spheres = deposited(radii, np.array([9.0, 9.0]), 5, 2)
    free = [one for one in pockets_of(spheres) if not one.carries]
    assert len(free) > 10
    for one in free[:4]:
        level = (Surface.of(spheres).level - float(one.centre[2])) / one.diameter
        for wide, gap in ((False, 0.02), (True, 0.04)):
            scene = scene_of(one, level, asked(), 1.0, wide=wide)
            centre = np.array(scene.placement.centre)
            # All three contacts are as wide.
            ends = centre + (0.5 + gap - 1e-9) * one.contacts.normals
            assert np.abs(scene.bed_shape.distance(ends)).max() < 1e-8
            assert scene.bed_shape.distance(centre)[0] == pytest.approx(0.5 + gap, abs=1e-9)
            assert scene.flow.datum == pytest.approx(centre[2] + level, abs=1e-9)


def test_a_neighbour_may_be_higher_than_the_usual_domain():
    """A sphere six diameters high beside the grain: the top was at five, and the whole survey ended there."""
    near = on_pocket(1.0)
    near = replace(
        near,
        neighbours=np.vstack([near.neighbours, [3.0, 3.0, 2.5]]),
        radii=np.append(near.radii, 3.0),
    )
    scene = scene_of(near, -0.5, asked(), 1.0)
    top = max(z + r for _, _, z, r in (*scene.bed.spheres, *scene.bed.posts))
    assert top > 6.0 and scene.domain.height == pytest.approx(top + 3.0)


def test_coefficients_by_the_rows_of_a_sweep():
    """Of a run with a wider gap that is done; of that alone nothing is known where the run itself has failed."""
    given = on_pocket(1.0), -0.5, asked(), 2.0
    first = scene_of(*given, error_bars=True), scene_of(*given, wide=True)
    second = scene_of(on_pocket(1.2), -0.5, asked(), 2.0), None
    done = {"status": "done", "force_x": 3.0, "torque_y": 1.0}
    rows = {
        identity_of(first[0], "run"): done | {"force_x_low": 2.9, "force_x_high": 3.1},
        identity_of(first[1], "run"): done | {"force_x": 3.3},
        identity_of(second[0], "run"): {"status": "failed"},
    }
    (result,) = coefficients_of({7: first, 8: second}, rows)
    assert result.number == 7 and result.values.tolist() == [6.0, 0.0, 0.0, 0.0, 2.0, 0.0]
    assert result.errors is not None and result.errors[0] == pytest.approx(0.2 + 0.6)
    rows[identity_of(first[1], "run")] = {"status": "failed"}
    assert coefficients_of({7: first, 8: second}, rows)[0].errors is None


@pytest.mark.slow
def test_a_later_call_computes_what_is_new(swept, tmp_path):
    """Eight runs, of which one is repeated with a wider gap in vain; then one more, the others as they were."""
    pytest.importorskip("sklearn")
    more = "\n[flow]\ngalileo = 20.0\n[runs]\nwith_error_bars = 1\n"
    result = []
    for number in (8, 9):
        request = asked(DEPOSITED + more, "runs.number=8")
        record = survey(request, tmp_path, tmp_path, MPI.COMM_SELF, number - 8).emulator
        result.append((record["runs"], record["failed"], len(swept)))
    assert result == [(8, 0, 9), (9, 0, 10)]


def test_reynolds_numbers_spread_over_the_thresholds():
    assert reynolds_of(5, None) == 1.0
    result = np.sort(np.log([reynolds_of(run, 10.0) for run in range(40)]))
    low, high = np.log(0.3), np.log(30.0)
    assert low <= result[0] and result[-1] <= high and np.diff(result).max() < 0.1 * (high - low)


LABELS = 'kind = "labels"\nheights = "h.npy"\ncell = [1, 1]\nlabels = '
REFUSED = [
    (
        '[bed]\nkind = "heap"',
        'bed.kind: "heap" is not known; use "deposited", "spheres", "ellipsoids" or "labels"',
    ),
    (DEPOSITED + "grains = 3", 'bed.grains: unknown key for "deposited"'),
    (
        DEPOSITED + 'sizes = "uniform"',
        "bed.spread: is needed by unequal sizes; give both spread and sizes",
    ),
    (DEPOSITED + "spread = 0.2", "bed.spread: is read only for unequal sizes; give both"),
    (DEPOSITED + "diameters = [1.0]", "bed.diameters: is retired; give sizes and spread"),
    (DEPOSITED + "[runs]\nnumber = -1", "runs.number: is -1; give a number of at least 0"),
    (DEPOSITED + "[flow]\nfriction = -0.1", "flow.friction: is -0.1; give a number of at least 0"),
    (DEPOSITED + "[runs]\norder = 7", "runs.order: is 7; give a number of at most 3"),
]


@pytest.mark.parametrize("missing", [True, False])
def test_what_an_emulator_lacks_is_said_before_any_run(missing, monkeypatch, tmp_path):
    """scikit-learn, or runs."""
    said = r"scikit-learn cannot be used .*: pip install 'incipient\[survey\]'"
    if missing:
        monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
    else:
        pytest.importorskip("sklearn")
        said = "runs.number: 6 grains have a full run, the emulator needs 8; give 8 or more"
    monkeypatch.delattr("incipient.survey.procedure.run_sweep")
    request = asked(DEPOSITED, "runs.number=6")
    with pytest.raises(MissingError if missing else SceneError, match=said):
        survey(request, tmp_path, tmp_path / "out", MPI.COMM_SELF)
    assert not (
        tmp_path / "out/survey.json"
    ).exists()  # thresholds of an earlier call would be gone


@pytest.mark.parametrize(("text", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_bad_beds_are_refused_in_one_line(text, said):
    assert message(lambda: asked(text)).startswith(f"bed.toml: {said}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('kind = "spheres"\nfile = "bed.csv"', "has 1 point; give three or more"),
        ('kind = "spheres"\nfile = "none.csv"', "cannot be read"),
        ('kind = "ellipsoids"\nfile = "bed.csv"', "has no column Xc; write Xc, Yc, Zc"),
        (f'{LABELS}"l.npy"', "give equal numbers of both"),
        (f'{LABELS}"h.npy"', "is not a table of integers"),
        ('kind = "deposited"\nnumber = 60\nlength = 3.0\nwidth = 3.0', "less than four of its grains; enlarge"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_in_one_line(text, said, tmp_path):
    (tmp_path / "bed.csv").write_text("x,y,z\n0,0,0\n")
    np.save(tmp_path / "h.npy", np.zeros((40, 40)))
    np.save(tmp_path / "l.npy", np.zeros((4, 4), dtype=int))
    assert said in message(lambda: spheres_of(asked(f"[bed]\n{text}").bed, tmp_path))


@pytest.mark.parametrize("size", [1.0, 2.0])
def test_cohesion_pulls_at_the_rear_contact_of_a_grain(size):
    """Between two contacts at an angle without friction: F = W tan + 2 c sin, by hand; c over the grain's own weight.

    The pull of each contact is that of all grains: a grain of twice the median diameter has eight times the weight.
    """
    angle, flow = np.radians(30.0), FlowPast(friction=0.0, cohesion=2.4)
    normals = np.array([[sign * np.sin(angle), 0.0, -np.cos(angle)] for sign in (1.0, -1.0)])
    force = critical_force(Contacts(0.5 * normals, normals), flow.law(size, 1.0))
    pull = flow.cohesion / size**3
    assert force == pytest.approx(np.tan(angle) + 2.0 * pull * np.sin(angle), rel=1e-9)


# -- poses of one grain ------------------------------------------------------------------------------


def test_all_rotations_are_equally_likely() -> None:
    """Turned axes are uniform on the sphere: heights uniform from -1 to 1 (Archimedes), for each axis."""
    turned = []
    for (setting,) in _settings(2000, 1, (0.0, 0.0, 0.0)):
        angles = json.loads(setting.partition("=")[2])
        body = Ellipsoid(semi_axes=(1.0, 0.8, 0.6), x=1.0, orientation=angles)
        turned.append(body.placed((0.0, 0.0, 0.0)).rotation)
    heights = np.sort(np.array(turned)[:, 2], axis=0)
    exact = np.linspace(-1.0, 1.0, 2000)
    # Kolmogorov's distance of 2000 samples is below 0.0364 with a probability of 99%; heights span 2.
    assert np.abs(heights - exact[:, None]).max() < 2.0 * 0.0364


def test_the_first_pose_is_the_scenes_own() -> None:
    result = _settings(3, 2, (10.0, 20.0, 30.0))
    assert len(set(result)) == 6 and result[0] == ("body.orientation=[10, 20, 30]", "bed.seed=0")
    assert result[:3] != result[3:] and [one[0] for one in result[:3]] == [
        one[0] for one in result[3:]
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (example(), "that rests on a bed; give domain.width and body.x"),
        (dumps(loads(example(in_space=True))), "--seeds: "),
    ],
)
def test_scenes_without_poses_or_seeds_are_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    assert said in message(lambda: survey_poses(path, (), 2, 2, tmp_path / "out", MPI.COMM_WORLD))


def test_poses_of_an_earlier_call_in_the_same_place_are_not_counted(
    swept: dict[str, dict[str, object]], tmp_path: Path
) -> None:
    """Four poses, whose Shields numbers are 0.01 to 0.04, then the first two of them alone."""
    boxes = tmp_path / "box.toml"
    body = Ellipsoid(semi_axes=(0.6, 0.5, 0.4), x=5.0, density=2.65, settle=True)
    boxes.write_text(dumps(sphere_on_plane(body=body)))
    four, two = (survey_poses(boxes, (), count, 1, tmp_path, MPI.COMM_WORLD) for count in (4, 2))
    assert four.shields == pytest.approx((0.01, 0.02, 0.03, 0.04)) and len(swept) == 4
    assert (two.poses, two.shields) == (2, pytest.approx((0.01, 0.02)))
    assert "50% below 0.02" in four.text()
    assert "0.01, 0.02: too few for percentiles" in two.text() and "below" not in two.text()
