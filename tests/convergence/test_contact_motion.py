"""Bodies that roll, slide, rock and settle on beds without a fluid, against exact motions."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scenes import REFERENCE

from incipient.arrays import Floats
from incipient.body.contact_motion import ActiveContacts, ContactLaw, ContactMotion
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.contact.impulses import contact_impulses
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat, HalfDiscs, Sinusoidal
from incipient.geometry.plane.grains import Disc, Polygon, Rectangle
from incipient.geometry.settle import proximity
from incipient.geometry.space.beds import Plane, Ridges, SphereBed
from incipient.geometry.space.grains import Box, Ellipsoid, Solid, Sphere

G = 10.0


class Case:
    """A grain of density one on a bed, stepped under gravity and a force on its centre of mass."""

    def __init__(
        self,
        grain: object,
        bed: object,
        placement: Placement,
        law: ContactLaw,
        velocities: Floats | None = None,
    ):
        self.body = RigidBody(Inertia.about(grain.volume, grain.inertia, grain.gdim))  # type: ignore[arg-type]
        near = proximity(grain, bed)  # type: ignore[arg-type]
        self.moves = ContactMotion(self.body, near.gaps, law, grain.size)  # type: ignore[attr-defined]
        self.state = BodyState.at(placement, velocities)
        self.contacts = ActiveContacts.none(placement.gdim)
        self.work = 0.0

    def step(self, dt: float, gravity: Floats, force: Floats | float = 0.0) -> None:
        """One step; `work` is the contacts'."""
        load = np.zeros(self.body.size)
        d = self.body.gdim
        load[:d] = self.body.inertia.mass * np.asarray(gravity) + force
        taken = self.moves.step(self.state, dt, load, before=self.contacts)
        self.state, self.contacts = taken.end, taken.contacts
        self.work += sum(taken.contacts.work)

    def run(self, dt: float, end: float, gravity: Floats) -> Case:
        """Steps to an end."""
        for _ in range(round(end / dt)):
            self.step(dt, gravity)
        return self

    def energy(self, gravity: Floats) -> float:
        """Kinetic and potential energy."""
        return self.body.kinetic_energy(self.state) - self.body.inertia.mass * float(
            np.asarray(gravity) @ self.state.place
        )


def down(gdim: int, slope: float = 0.0) -> Floats:
    """Gravity (gdim,) on a plane that falls along x by an angle, in the directions of the plane."""
    result = np.zeros(gdim)
    result[0], result[-1] = G * np.sin(slope), -G * np.cos(slope)
    return result


# A round grain of diameter 1/2 that touches a plane, and its moment of inertia over m R^2.
ROUND = {
    2: (Disc(0.5), Flat(), Placement((0.0, 0.25)), 0.5),
    3: (Sphere(0.5), Plane(), Placement((0.0, 0.0, 0.25)), 0.4),
}


BLOCK = Rectangle(1.0, 0.5), Flat(), Placement((0.0, 0.25))


@pytest.mark.parametrize(
    ("gdim", "friction", "c", "rolls"),
    [
        *(pytest.param(gdim, 0.5, 0.0, True, marks=pytest.mark.slow) for gdim in ROUND),
        *(pytest.param(gdim, 0.05, 0.0, False, marks=pytest.mark.slow) for gdim in ROUND),
        *((gdim, 0.5, 0.1, True) for gdim in ROUND),
        (2, 0.05, 0.02, False),
    ],
)
def test_round_grains_roll_or_slide_down_an_incline(
    gdim: int, friction: float, c: float, rolls: bool
) -> None:
    """With a couple c R N against rolling: a = g (sin - c cos)/(1 + k), k = 1/2 or 2/5, where friction holds it.

    Else a = g (sin - friction cos), and friction less c turns the grain.
    """
    *at_rest, k = ROUND[gdim]
    case = Case(*at_rest, ContactLaw(friction, rolling=c)).run(0.05, 0.5, down(gdim, 0.3))
    along = np.sin(0.3) - (c if rolls else friction) * np.cos(0.3)
    exact = 0.5 * G * along / (1.0 + k if rolls else 1.0)
    turning = exact if rolls else 0.5 * G * (friction - c) * np.cos(0.3) / k
    assert case.state.velocity[0] == pytest.approx(exact, rel=1e-9)
    assert case.state.place[0] == pytest.approx(0.25 * exact, rel=0.05)
    assert np.abs(case.state.spin).max() == pytest.approx(turning / 0.25, rel=1e-9)


@pytest.mark.parametrize("gdim", [2, 3])
def test_resistance_to_rolling_slows_round_grains_and_holds_them_on_gentle_slopes(
    gdim: int,
) -> None:
    """a = -g c/(1 + k) on the level until it rests; at rest on slopes where c >= tan.

    By the balances of momentum with a couple c R N against rolling. In space along any direction of the surface.
    """
    *at_rest, k = ROUND[gdim]
    c = 0.1
    law = ContactLaw(0.5, rolling=c)
    held = Case(*at_rest, law).run(0.05, 0.5, down(gdim, np.arctan(0.99 * c)))
    assert np.abs(held.state.velocities).max() < 1e-9
    loads = held.contacts.mean_load(held.state.place, 0.05)
    weight = held.body.inertia.mass * np.concatenate(
        [down(gdim, np.arctan(0.99 * c)), np.zeros(2 * gdim - 3)]
    )
    assert loads == pytest.approx(-weight, abs=1e-9 * np.abs(weight).max())
    speed, start = 0.6, np.zeros(3 * gdim - 3)
    if gdim == 2:
        start[[0, 2]] = speed, -speed / 0.25
    else:
        start[[0, 1, 3, 4]] = 0.6 * speed, 0.8 * speed, -0.8 * speed / 0.25, 0.6 * speed / 0.25
    rolls = Case(*at_rest, law, start)
    first = rolls.energy(down(gdim))
    rolls.run(0.01, 0.5, down(gdim))
    assert np.linalg.norm(rolls.state.velocity) == pytest.approx(
        speed - 0.5 * G * c / (1.0 + k), rel=1e-9
    )
    assert rolls.work == pytest.approx(rolls.energy(down(gdim)) - first, rel=1e-9)
    rolls.run(0.01, 1.0, down(gdim))
    assert np.abs(rolls.state.velocities).max() < 1e-9
    way = speed**2 * (1.0 + k) / (2.0 * G * c)
    assert np.linalg.norm(rolls.state.place[:-1]) == pytest.approx(way, rel=0.02)


def test_a_block_slides_to_rest_where_friction_has_taken_its_energy() -> None:
    """The way is u^2/(2 friction g), for a step of 1/30 of the time to a thousandth; the work is the energy lost."""
    case = Case(*BLOCK, ContactLaw(0.3), np.array([1.0, 0, 0]))
    case.run(0.01, 0.5, down(2))
    assert case.state.place[0] == pytest.approx(1.0 / 6.0, rel=1e-3)
    assert np.abs(case.state.velocities).max() < 1e-9
    assert case.work == pytest.approx(-0.5 * 0.5, rel=1e-2)


@pytest.mark.parametrize(
    ("first", "dt", "end", "slope", "rolling", "velocity", "error"),
    [
        (1.0, 0.01, 0.2, 0.0, 0.0, 1.0 - 0.2 * 0.2 * G, 1e-6),
        (0.0, 0.01, 0.1, np.arctan(0.5), 0.0, 0.0, 1e-9),
        # Not held: from the first step on it accelerates by g (sin - 0.2 cos), tan = 0.7.
        *((0.0, 0.05, 0.05, np.arctan(0.7), c, 0.05 * G * 0.5 / np.hypot(1.0, 0.7), 1e-10)
          for c in (0.0, 0.1)),
    ],
    ids=["brakes", "held", "slides", "slides, rolling resistance"],
)  # fmt: skip
def test_kinetic_friction_brakes_what_static_friction_would_hold(
    first: float,
    dt: float,
    end: float,
    slope: float,
    rolling: float,
    velocity: float,
    error: float,
) -> None:
    """Friction of a block is that of sliding, 0.2, while a contact slides, and 0.6 at rest."""
    law = ContactLaw(0.6, 0.2, rolling=rolling)
    case = Case(*BLOCK, law, np.array([first, 0.0, 0.0])).run(dt, end, down(2, slope))
    assert case.state.velocities == pytest.approx([velocity, 0.0, 0.0], abs=error)


def test_a_rocking_block_keeps_the_energy_that_housner_gives_it() -> None:
    """The spin after the impact is 1 - 3/2 sin^2 alpha of that before, tan alpha = width/height (Housner 1963).

    The block turns about its right corner, at the origin; gravity acts in the step of the impact as if that was at its
    start, by which the spin errs by at most dt m g width/(2 J spin), 1e-3.
    """
    width, height, tilt, spin = 0.5, 2.0, 0.004, 0.5
    alpha, arm = np.arctan(width / height), 0.5 * np.hypot(width, height)
    centre = arm * np.array([-np.sin(alpha - tilt), np.cos(alpha - tilt)])
    turning = spin * np.array([-centre[1], centre[0], 1.0])
    block, placement = Rectangle(width, height), Placement(tuple(centre), -tilt)
    case = Case(block, Flat(), placement, ContactLaw(5.0), turning)
    upright = 0.5 * case.body.inertia.mass * G * height
    before = case.energy(down(2)) - upright
    while case.state.orientation[0] < 0.0:
        case.step(2.5e-4, down(2))
    kept = (case.energy(down(2)) - upright) / before
    assert np.sqrt(kept) == pytest.approx(1.0 - 1.5 * np.sin(alpha) ** 2, rel=1e-3)


def test_a_disc_settles_in_a_pocket_on_both_its_neighbours() -> None:
    """The forces at rest are W/(2 cos 30 degrees) at 30 degrees to the vertical, each without friction."""
    case = Case(Disc(1.0), HalfDiscs(0.5, 1.0, 0.0), Placement((0.52, 1.0)), ContactLaw(0.0))
    case.run(0.01, 1.5, down(2))
    forces = case.contacts.forces(0.01)
    weight = case.body.inertia.mass * G
    assert case.state.place == pytest.approx([0.5, np.sqrt(0.75)], abs=1e-3)
    assert len(forces) == 2
    assert forces[:, 1] == pytest.approx([0.5 * weight] * 2, rel=1e-2)


BOWLS = {
    2: (Disc(0.5), Sinusoidal(0.5, 4.0), (2.2, 0.3)),
    3: (Sphere(0.5), Ridges(0.5, 4.0), (2.2, 0.0, 0.3)),
}


@pytest.mark.slow
@pytest.mark.parametrize("gdim", [2, 3])
def test_rolling_in_a_bowl_keeps_energy_to_second_order(gdim: int) -> None:
    """No work is done by contacts that roll; what a step loses falls faster than the step."""
    lost = []
    for dt in (0.02, 0.01):
        grain, bed, place = BOWLS[gdim]
        case = Case(grain, bed, Placement(place), ContactLaw(10.0))
        near = case.moves.near(case.state.placement, 2.0)
        way = near.normals[0] * -near.gaps[0]
        case.state = BodyState.at(case.state.placement.moved(way, np.zeros(2 * gdim - 3)))
        first = case.energy(down(gdim))
        case.run(dt, 1.0, down(gdim))
        speed = case.body.kinetic_energy(case.state)
        lost.append(abs(first - case.energy(down(gdim))) / max(abs(first), speed))
    assert lost[1] < 1e-3
    assert lost[1] < 0.4 * lost[0] or lost[1] < 1e-6


def test_a_polygon_rolls_down_without_gaining_energy() -> None:
    """A hexagon down a steep incline: at each impact energy goes, never comes."""
    angles = np.arange(6) * np.pi / 3.0
    grain = Polygon(0.5 * np.column_stack([np.cos(angles), np.sin(angles)]))
    gravity = down(2, 0.7)
    case = Case(grain, Flat(), Placement((0.0, 0.5 * np.sqrt(0.75))), ContactLaw(2.0))
    last = case.energy(gravity)
    for _ in range(150):
        case.step(0.01, gravity)
        now = case.energy(gravity)
        assert now <= last + 2e-3 * case.body.kinetic_energy(case.state) + 1e-9
        last = now
    assert case.state.orientation[0] < -np.pi / 3.0


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_impacts_give_back_what_restitution_says(restitution: float) -> None:
    """The normal velocity after an impact is the coefficient times that before, one step of gravity apart."""
    law = ContactLaw(0.0, restitution=restitution)
    case = Case(Disc(1.0), Flat(), Placement((0.0, 0.6)), law, np.array([0.0, -2.0, 0.0]))
    case.run(0.01, 0.08, np.zeros(2))
    assert case.state.velocity[1] == pytest.approx(2.0 * restitution, abs=1e-9)


@pytest.mark.parametrize("grain", [Box((0.6, 0.4, 0.3)), Ellipsoid((0.4, 0.3, 0.2))])
def test_elastic_impacts_in_space_keep_the_energy(grain: Solid) -> None:
    """Without friction and weight, of grains that turn by an eighth of a radian in the step and touch at one point.

    With velocities at the ends of the step alone they gain up to 3%.
    """
    random, touched = np.random.default_rng(3), 0
    for _ in range(6):
        start = Placement((0.0, 0.0, 0.0)).moved((0.0, 0.0, 0.0), random.normal(size=3))
        spin = random.normal(size=3)
        velocities = np.array([0.3, 0.2, -1.0, *(5.0 * spin / np.linalg.norm(spin))])
        gap = proximity(grain, Plane()).gaps(start, 1.0).gaps.min()
        start = start.moved((0.0, 0.0, random.uniform(0.0, 0.02) - gap), (0.0, 0.0, 0.0))
        case = Case(grain, Plane(), start, ContactLaw(0.0, restitution=1.0), velocities)
        before = case.energy(np.zeros(3))
        case.step(0.025, np.zeros(3))
        if len(case.contacts) == 1:
            touched += 1
            assert case.energy(np.zeros(3)) == pytest.approx(before, rel=1e-4)
    assert touched >= 3


def test_friction_at_an_elastic_impact_gains_no_energy() -> None:
    """A box that lands on a corner: by Newton's law alone it gains 52% (Kane & Levinson 1985)."""
    start, velocities = Placement((0.0, 0.26), 0.2), np.array([0.3, -1.0, 5.0])
    law = ContactLaw(0.5, restitution=1.0)
    case = Case(Rectangle(0.6, 0.4), Flat(), start, law, velocities)
    before = case.energy(np.zeros(2))
    case.step(0.025, np.zeros(2))
    assert len(case.contacts) == 1 and case.state.velocity[1] > 0.0
    assert case.energy(np.zeros(2)) == pytest.approx(before, rel=1e-6)


def test_a_corner_that_others_press_into_the_bed_does_no_work() -> None:
    """Of the three corners that meet the plane one was leaving it: by Newton's law alone the box gains 3.3%."""
    box = Box((0.6, 0.4, 0.3), 0.05)
    start = Placement((0.0, 0.0, 0.0)).moved((0.0, 0.0, 0.0), (-0.02795, -0.02408, -0.02605))
    gap = proximity(box, Plane()).gaps(start, 1.0).gaps.min()
    start = start.moved((0.0, 0.0, 1e-3 - gap), (0.0, 0.0, 0.0))
    velocities = np.array([0.3, 0.2, -1.0, 2.5709, -2.84452, 1.67684])
    case = Case(box, Plane(), start, ContactLaw(0.0, restitution=1.0), velocities)
    before = case.energy(np.zeros(3))
    case.step(0.025, np.zeros(3))
    assert len(case.contacts) == 3
    assert case.energy(np.zeros(3)) == pytest.approx(before, rel=1e-5)


@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_the_work_of_an_impact_in_space_is_the_change_of_the_energy(restitution: float) -> None:
    """Without gravity nothing else does work. Of the mean of start and end it was 0.2% and 0.4% less."""
    grain, start = (
        Ellipsoid((0.4, 0.3, 0.2)),
        Placement((0.0, 0.0, 0.0)).moved((0.0, 0.0, 0.0), (0.4, 0.3, 0.2)),
    )
    gap = proximity(grain, Plane()).gaps(start, 1.0).gaps.min()
    start = start.moved((0.0, 0.0, 1e-3 - gap), (0.0, 0.0, 0.0))
    law, velocities = (
        ContactLaw(0.3, restitution=restitution),
        np.array([0.3, 0.2, -1.0, 3.0, -2.0, 4.0]),
    )
    case = Case(grain, Plane(), start, law, velocities)
    before = case.energy(np.zeros(3))
    case.step(0.02, np.zeros(3))
    change = case.energy(np.zeros(3)) - before
    assert len(case.contacts) == 1
    assert case.work == pytest.approx(change, rel=1e-5)


def test_restitution_is_not_sought_at_contacts_that_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disc that rolls in a valley bounces nowhere: the same impulses, of as many solves, as without restitution."""
    solves = list[int]()

    def counted(gain: Floats, free: Floats, friction: Floats) -> Floats:
        solves.append(len(friction))
        return contact_impulses(gain, free, friction)

    monkeypatch.setattr("incipient.body.contact_motion.contact_impulses", counted)
    ends, numbers = [], []
    for restitution in (0.0, 0.5):
        grain, bed = Disc(0.5), Sinusoidal(0.1, 4.0)
        place = proximity(grain, bed).lowered(Placement((0.3, 1.0)), 0.0)
        case = Case(grain, bed, place, ContactLaw(0.5, restitution=restitution))
        case.step(0.02, down(2))  # in which the contact is new
        solves.clear()
        for _ in range(10):
            case.step(0.02, down(2))
        ends.append(case.state.packed())
        numbers.append(len(solves))
    assert ends[1] == pytest.approx(ends[0], rel=1e-6, abs=1e-6)
    assert 10 <= numbers[1] == numbers[0]


def test_a_thrown_box_with_restitution_gains_no_energy() -> None:
    """Where its contact passes from corner to corner, as without restitution: 46% in one of these steps before."""
    turned = -2.55566503, 0.41809885, -0.56776961
    start = Placement((0.0, 0.0, 0.8)).moved((0.0, 0.0, 0.0), turned)
    velocities = np.array([-0.45264929, -0.21559716, -2.01998613, -0.92772951, -3.46085231, 13.292])
    law = ContactLaw(0.0, restitution=0.5)
    case = Case(Box((0.6, 0.4, 0.3), 0.05), Plane(), start, law, velocities)
    for _ in range(30):
        before, kinetic = case.energy(down(3)), case.body.kinetic_energy(case.state)
        case.step(0.01, down(3))
        assert case.energy(down(3)) < before + 1e-3 * kinetic


def test_a_thrown_box_comes_to_rest_on_its_largest_face() -> None:
    """Its centre is half of the shortest side above the plane; on the way some friction is exactly its largest."""
    start = Placement((0.0, 0.0, 0.6)).moved((0.0, 0.0, 0.0), (0.3, 0.5, 0.2))
    velocities = np.array([1.0, 0.5, -1.0, 2.0, 1.0, -3.0])
    case = Case(Box((0.6, 0.4, 0.3), 0.05), Plane(), start, ContactLaw(0.4), velocities)
    case.run(0.01, 0.8, down(3))
    assert case.state.place[2] == pytest.approx(0.15, abs=1e-9)
    assert np.abs(case.state.velocities).max() < 1e-9


def test_a_body_is_not_driven_through_its_bed_by_a_long_step() -> None:
    """Steps in which it would go many times its size end on the bed."""
    case = Case(
        Disc(0.1), Flat(), Placement((0.0, 5.0)), ContactLaw(0.3), np.array([3.0, -50.0, 0.0])
    )
    case.run(0.2, 1.0, down(2))
    assert case.state.place[1] == pytest.approx(0.05, abs=1e-8)
    assert abs(case.state.velocity[1]) < 1e-6


POCKETS = ("plane", "triangular")
STRENGTHS = (1.01, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0, 1000.0)
ROLLING = {
    "plane": 3.0 / 2.0,
    "triangular": 1.0 + 2.0 / 5.0 / 0.75,
}  # inertia over that without turning


@pytest.mark.slow
@pytest.mark.parametrize("pocket", POCKETS)
@pytest.mark.parametrize(
    ("strength", "friction"),
    [*((strength, 100.0) for strength in STRENGTHS), (1.1, 0.0), (2.0, 0.0), (1000.0, 0.0)],
)
def test_gusts_that_move_a_grain_out_of_its_pocket(
    pocket: str, strength: float, friction: float
) -> None:
    """The critical duration of a horizontal force, to 0.1%, in units of sqrt(m D/W).

    Over one fixed disc, or between two of three spheres: exact by quadrature (tests/reference/gust_in_vacuo.csv) of the
    equation of rolling without slip, kappa m R psi'' = W sin psi - F cos psi, F = `strength` times the static force,
    let go when the grain has the speed to reach the saddle. Without friction it does not turn: kappa = 1, and all
    durations are shorter by the root of kappa.
    """
    force, duration = _gust(pocket, strength)
    if friction == 0.0:
        duration /= np.sqrt(ROLLING[pocket])
    assert not _leaves(pocket, force, (1.0 - 1e-3) * duration, friction)
    assert _leaves(pocket, force, (1.0 + 1e-3) * duration, friction)


def _gust(pocket: str, strength: float) -> tuple[float, float]:
    """Force over weight and duration of a row of the table."""
    rows = csv.reader((REFERENCE / "gust_in_vacuo.csv").read_text().splitlines()[3:])
    return next(
        (float(force), float(duration))
        for case, over, force, duration, _ in rows
        if case.startswith(pocket) and float(over) == strength
    )


def _leaves(pocket: str, force: float, duration: float, friction: float) -> bool:
    """Whether a grain leaves a pocket of its own kind after a force over its weight for a duration."""
    if pocket == "plane":
        bed, saddle, place = HalfDiscs(0.5, 1.0, 0.0), 1.0, (0.5, float(np.sqrt(0.75)))
        case = Case(Disc(1.0), bed, Placement(place), ContactLaw(friction))
    else:
        array, saddle = SphereBed.array(0.5, 1.0, "triangular", (0.0, 0.0), 0.0, 0.5 * np.pi), 0.0
        centre = (-1.0 / float(np.sqrt(12.0)), 0.5, float(np.sqrt(2.0 / 3.0)))
        case = Case(Sphere(1.0), array, Placement(centre), ContactLaw(friction))
    push, unit = np.zeros(case.body.gdim), np.sqrt(1.0 / G)
    push[0] = force * case.body.inertia.mass * G
    steps = max(round(duration / 0.02), 20)
    for _ in range(steps):
        case.step(duration * unit / steps, down(case.body.gdim), push)
    while case.state.velocity[0] > 0.0 and case.state.place[0] < saddle:
        case.step(0.02 * unit, down(case.body.gdim))
    return bool(case.state.place[0] >= saddle)


def stuck(grain: object, bed: object, placement: Placement, law: ContactLaw) -> Case:
    """A grain at rest whose contacts cohesion holds."""
    case = Case(grain, bed, placement, law)
    case.contacts = case.moves.closed(placement)
    return case


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize(("excess", "velocity"), [(-0.2, 0.0), (0.2, G * 0.01 * (0.2 + 9 * 2.2))])
def test_cohesion_holds_a_round_grain_up_to_its_pull(
    gdim: int, excess: float, velocity: float
) -> None:
    """Pulled by twice its weight beyond it; torn off it accelerates freely, the pull acts in the first step."""
    *at_rest, _ = ROUND[gdim]
    weight = G * at_rest[0].volume
    case = stuck(*at_rest, ContactLaw(0.5, cohesion=2.0 * weight))
    for _ in range(10):
        case.step(0.01, down(gdim), np.array([*[0.0] * (gdim - 1), (3.0 + excess) * weight]))
    assert case.state.velocity[-1] == pytest.approx(velocity, abs=1e-12)
    assert len(case.contacts) == (excess < 0.0)


@pytest.mark.parametrize("force", [0.98, 1.2])
def test_cohesion_adds_to_the_pressure_of_friction_on_a_sliding_block(force: float) -> None:
    """It slides at mu (W + c), and with any further force by Newton's law; both of its corners last."""
    block, friction = Rectangle(1.0, 0.5), 0.3
    weight = G * block.volume
    held = friction * (weight + 1.5 * weight)
    law = ContactLaw(friction, cohesion=1.5 * weight)
    case = stuck(block, Flat(), Placement((0.0, 0.25)), law)
    for _ in range(10):
        case.step(0.01, down(2), np.array([force * held, 0.0]))
    velocity = 0.1 * max(force - 1.0, 0.0) * held / block.volume
    assert case.state.velocity[0] == pytest.approx(velocity, abs=1e-12)
    assert len(case.contacts) == 2 and case.work <= 1e-15


@pytest.mark.parametrize("excess", [-0.02, 0.02])
def test_a_block_topples_against_the_cohesion_of_its_rear_edge(excess: float) -> None:
    """Pushed at its centre, a height h/2: H h/2 = W b/2 + c b/2, as its two corners share the cohesion."""
    block = Rectangle(1.0, 0.5)
    weight = G * block.volume
    push = (1.0 + excess) * (0.5 * weight + 0.75 * weight) / 0.25
    case = stuck(block, Flat(), Placement((0.0, 0.25)), ContactLaw(50.0, cohesion=1.5 * weight))
    case.step(0.001, down(2), np.array([push, 0.0]))
    assert (float(case.state.spin[0]) < -1e-6) == (excess > 0.0)
    assert len(case.contacts) == (1 if excess > 0.0 else 2)


def test_contacts_of_an_impact_pull_from_the_next_step_on() -> None:
    """A disc that falls onto the plane and is pulled up afterwards by half of the cohesion stays."""
    disc = Disc(0.5)
    weight = G * disc.volume
    case = Case(disc, Flat(), Placement((0.0, 0.26)), ContactLaw(0.5, cohesion=4.0 * weight))
    for _ in range(20):
        case.step(0.01, down(2))
    for _ in range(10):
        case.step(0.01, down(2), np.array([0.0, 3.0 * weight]))
    assert len(case.contacts) == 1 and abs(case.state.velocity[1]) < 1e-12
