"""Pictures of thresholds and of judged cases, from loads made up so that statics knows the answer."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from images import assert_is_a_picture
from scenes import POCKET

import incipient.judging.case as cases
from incipient.contact import Contacts, Load, safety_factor
from incipient.contact.verdict import judge
from incipient.errors import OutputError
from incipient.files import plain, write_json
from incipient.geometry.closest import touching
from incipient.pictures.apart import draw_apart
from incipient.pictures.directory_pictures import draw
from incipient.pictures.judged import judged
from incipient.pictures.outlines import bed_line, grain_outline, hull, round_radius, sketched
from incipient.pictures.style import STATES
from incipient.pictures.verdict import critical_sentence
from incipient.scene import load, save

DEMOS = Path(__file__).parents[2] / "demos"
FLOW, COUPLE, WEIGHT = (
    np.array([1.0, 0.5, 0.0]),
    np.array([0.0, 0.0, -0.15]),
    np.array([0.0, -13.0, 0.0]),
)
MASS_AND_INERTIA = 1.0, 0.1 * np.eye(3)
BOX = np.array([[-0.5, -0.4, 0.0], [0.5, -0.4, 0.0], [0.5, 0.4, 0.0], [-0.5, 0.4, 0.0]])


def found(directory, overrides, flow=FLOW, factor=None):
    """A threshold as the search would leave it, for a flow whose load grows in proportion."""
    scene = load(DEMOS / "scenes" / "grain_on_bed.toml", overrides)
    contacts = touching(scene.grain, scene.placement, scene.bed_shape, scene.contact_tolerance)
    centre = np.array([*scene.placement.centre, 0.0])
    safety = safety_factor(Load(flow, COUPLE, WEIGHT, centre), contacts, scene.contact.friction)
    share = safety.value if np.isfinite(safety.value) and safety.value > 0.0 else 1.0
    critical = Load(share * flow, share * COUPLE, WEIGHT, centre)
    verdict = judge(critical, contacts, scene.contact.friction, (2.0, np.eye(3)))
    stored = {
        "factor": safety.value if factor is None else factor,
        "held_to": safety.value,
        "reason": "",
        "errors": {"factor": 0.2, "shields": 0.001, "reynolds": 5.0, "shear_reynolds": None},
        "shields": 0.01,
        "reynolds": 55.0,
        "shear_reynolds": 7.4,
        "mode": "pivoting",
        "verdict": verdict.to_dict(),
        "load": asdict(critical),
        "contacts": {
            "points": contacts.points,
            "normals": contacts.normals,
            "areas": contacts.areas,
        },
        "trials": [{"factor": 1.0, "safety_factor": safety.value}],
    }
    save(scene, directory / "scene.toml")
    write_json(directory / "threshold.json", stored)
    return directory


def judged_case(directory, name, *overrides, shaped=True):
    path = DEMOS / "cases" / f"{name}.toml"
    few = ("errors.samples=20",) if "[errors]" in path.read_text() else ()
    said = cases.judge_case(cases.load_case(path, (*few, *overrides)))
    if not shaped:
        del said["case"]
    write_json(directory / "judgement.json", said)
    return directory


def box_on_a_plane(pushed, inert=MASS_AND_INERTIA):
    contacts = Contacts(BOX, np.tile([0.0, 0.0, -1.0], (4, 1)), np.full(4, 0.2))
    acting = Load(
        np.array(pushed), np.zeros(3), np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 0.3])
    )
    verdict = judge(acting, contacts, 0.5, inert).to_dict()
    return judged(plain(verdict), Path("judgement.json"))


def stored_verdict(directory):
    path = directory / "judgement.json"
    return judged(json.loads(path.read_text())["verdict"], path)


# -- thresholds --------------------------------------------------------------------------------------------


def test_a_threshold_in_a_pocket_is_drawn(tmp_path):
    written = draw(found(tmp_path, POCKET))
    assert [path.name for path in written] == ["threshold.png"]
    assert_is_a_picture(written[0])


def test_a_contact_that_is_left_has_a_state_of_the_pictures(tmp_path):
    """At the threshold the grain is held by one of its two contacts alone."""
    case = judged(
        json.loads((found(tmp_path, POCKET) / "threshold.json").read_text())["verdict"], tmp_path
    )
    assert case.states[0] == "UNLOADED" and set(case.states) <= STATES.keys()


@pytest.mark.parametrize(
    ("overrides", "flow", "said"),
    [
        ([], FLOW, "however weak this flow is"),  # a disc on a plane rolls
        (
            [*POCKET, "contact.friction=5.0"],
            FLOW,
            "no strength of this flow",
        ),  # the pocket wedges it
    ],
)
def test_why_there_is_no_threshold_is_said(tmp_path, overrides, flow, said):
    directory = found(tmp_path, overrides, flow)
    assert_is_a_picture(*draw(directory))
    assert said in critical_sentence(json.loads((directory / "threshold.json").read_text()))


@pytest.mark.parametrize(
    "missing",
    ["factor", "errors", "shields", "reynolds", "mode", "verdict", "load", "contacts", "trials"],
)
def test_an_incomplete_threshold_is_named(tmp_path, missing):
    path = found(tmp_path, POCKET) / "threshold.json"
    stored = json.loads(path.read_text())
    del stored[missing]
    path.write_text(json.dumps(stored))
    with pytest.raises(OutputError, match=rf"threshold\.json: holds no {missing}"):
        draw(tmp_path)


def test_a_search_that_ended_without_a_threshold_says_how_far_it_went(tmp_path):
    path = found(tmp_path, [*POCKET, "contact.friction=5.0"]) / "threshold.json"
    stored = json.loads(path.read_text()) | {"held_to": 12.0, "reason": "the grain is held"}
    path.write_text(json.dumps(stored))
    assert_is_a_picture(*draw(tmp_path))
    assert critical_sentence(stored).startswith("No threshold up to 12 times the flow of the scene")


def test_a_threshold_without_its_scene_is_an_error(tmp_path):
    (found(tmp_path, POCKET) / "scene.toml").unlink()
    with pytest.raises(OutputError, match=r"scene\.toml: cannot be read .No such file"):
        draw(tmp_path)


def test_a_threshold_that_makes_no_sense_is_an_error(tmp_path):
    path = found(tmp_path, POCKET) / "threshold.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"trials": 3}))
    with pytest.raises(OutputError, match=r"threshold\.json: cannot be drawn: TypeError"):
        draw(tmp_path)


# -- judged cases ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["block_on_incline", "disc_in_pocket"])
def test_cases_in_the_plane_are_drawn(tmp_path, name):
    written = draw(judged_case(tmp_path, name))
    assert [path.name for path in written] == ["judgement.png"]
    assert_is_a_picture(written[0])


def test_a_case_that_gives_a_shape_is_drawn_with_it(tmp_path):
    (picture,) = draw(judged_case(tmp_path, "disc_in_pocket"))
    shaped = picture.read_bytes()
    (picture,) = draw(judged_case(tmp_path, "disc_in_pocket", shaped=False))
    assert_is_a_picture(picture)
    assert picture.read_bytes() != shaped


@pytest.mark.slow
@pytest.mark.parametrize(
    "flow", [pytest.param("[0.2, 0.0, 0.0]", marks=pytest.mark.slow), "[0.4, 0.1, 0.05]"]
)  # rests, pivots
def test_cases_in_space_are_drawn(tmp_path, flow):
    judged_case(tmp_path, "sphere_on_three_spheres", f"load.flow_force={flow}")
    written = draw_apart(tmp_path).paths
    assert [path.name for path in written] == ["judgement.png"]
    assert_is_a_picture(written[0])


def test_an_incomplete_judgement_is_named(tmp_path):
    path = judged_case(tmp_path, "disc_in_pocket") / "judgement.json"
    stored = json.loads(path.read_text())
    del stored["verdict"]["judges"]["equilibrium"]["safety"]
    path.write_text(json.dumps(stored))
    with pytest.raises(OutputError, match=r"judgement\.json: its verdict holds no safety"):
        draw(tmp_path)
    path.write_text("{}")
    with pytest.raises(OutputError, match=r"judgement\.json: holds no verdict"):
        draw(tmp_path)
    path.write_text(json.dumps(stored | {"case": {"load": 3}}))
    with pytest.raises(
        OutputError, match=r"judgement\.json: .*cannot be understood|holds no safety"
    ):
        draw(tmp_path)


# -- what is shown of them ---------------------------------------------------------------------------------


def test_forces_of_a_grain_that_rests_balance_its_load_inside_their_cones():
    case = box_on_a_plane([0.2, 0.0, 0.0])
    acting = case.load
    assert np.allclose(case.forces.sum(axis=0) + acting.force, 0.0, atol=1e-8)
    assert np.allclose(
        np.cross(case.contacts.points - acting.centre, case.forces).sum(axis=0)
        + acting.flow_couple,
        0.0,
        atol=1e-8,
    )
    assert case.share == 1.0 and case.motion is None
    assert set(case.states) <= {"INSIDE", "EDGE"}
    assert (np.hypot(*case.forces[:, :2].T) <= 0.5 * case.forces[:, 2] * (1 + 1e-6)).all()


def test_a_grain_that_slides_is_shown_sliding_with_forces_on_the_edge():
    case = box_on_a_plane([0.6, 0.0, 0.0])  # more than friction 0.5 holds of weight 1
    assert case.motion is not None and np.allclose(
        case.motion.acceleration, [0.1, 0.0, 0.0], atol=1e-6
    )
    assert set(case.states) == {"SLIDE"}
    assert case.friction == 0.5


def test_without_mass_forces_are_shown_at_the_safety_factor():
    case = box_on_a_plane([0.6, 0.0, 0.0], inert=None)
    assert case.motion is None and case.share == case.safety_factor
    assert np.isclose(
        case.share, 0.5 / 0.6, rtol=1e-6
    )  # friction 0.5 holds half of the weight of 1
    assert case.occasion.startswith("contact force that balances 0.8333 times")
    assert np.allclose(case.forces.sum(axis=0), [-0.5, 0.0, 1.0], atol=1e-6)


def test_contacts_of_a_sphere_are_known_from_those_of_a_box(tmp_path):
    directory = judged_case(tmp_path, "sphere_on_three_spheres")
    sphere = stored_verdict(directory)
    assert np.isclose(round_radius(sphere), 0.5, rtol=1e-4)
    points, _ = sketched(sphere)
    assert np.allclose(np.linalg.norm(points - sphere.load.centre, axis=1), 0.5, rtol=1e-4)
    box = box_on_a_plane([0.2, 0.0, 0.0])
    assert round_radius(box) is None and box.patches == [[0, 1, 2, 3]]
    points, triangles = sketched(box)
    assert np.allclose(np.sort(np.unique(points[:, 2])), [0.0, 0.6]) and len(triangles) == 12


def test_outlines_come_from_the_curves():
    scene = load(DEMOS / "scenes" / "grain_on_bed.toml", POCKET)
    outline = grain_outline(scene.grain, scene.placement)
    assert np.allclose(np.linalg.norm(outline - scene.placement.centre, axis=1), 0.5)
    line = bed_line(scene.bed_shape, 3.0, 5.0)
    assert np.allclose(scene.bed_shape.height(line[5:-5:7, 0]), line[5:-5:7, 1], atol=1e-6)


def test_a_block_is_sketched_through_its_contacts(tmp_path):
    directory = judged_case(tmp_path, "block_on_incline")
    case = stored_verdict(directory)
    corners = {tuple(point) for point in np.round(hull(sketched(case)[0][:, :2]), 9)}
    assert corners == {(-1.0, 0.0), (1.0, 0.0), (1.0, 1.0), (-1.0, 1.0)}
