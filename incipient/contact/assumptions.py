"""Where the paper's criteria assume what mechanics confirms: when both judges must say the same.

Rest needs no assumption: force and couple vanish with contact forces in their friction cones, so statics holds.
For motion there must be a turn and shift of the grain on which its load works, and which no contact can hinder:
every contact is left, n . v < 0, at least as steeply as friction could follow, -n . v >= zeta |v along|. That it
moves is then certain, whatever the contact forces are. How it moves follows from forces alone where it slides on a
plane; where it lifts or pivots its mass and inertia have a say, and the paper's motion must be theirs, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.judge import MassAndInertia
from incipient.contact.model import Load
from incipient.contact.paper import friction as coulomb
from incipient.contact.paper.criteria import Classification, classify
from incipient.contact.paper.modes import Criterion, Mode
from incipient.geometry.contacts import Contacts

NORMALS_ALIKE = 1e-9
SLACK = 1e-9  # of a contact's speed


class Assumption(Enum):
    """What the paper takes for granted when it judges by one significant reaction surface."""

    ONE_SURFACE = "the contacts that the load presses most are one place, or lie in one plane"
    NOTHING_IN_THE_WAY = (
        "the motion found leaves every contact that was not asked, too steeply for friction to hold"
    )
    NO_COUPLE_PRESSES = (
        "no couple acts on a grain that is pressed to a contact; there the paper answers F + F_tau"
    )
    FRICTION_TURNS_NOTHING = "friction that slips has no couple about the centre of mass"
    INERTIA_FOLLOWS = "with its mass and inertia the grain lifts off every contact, or the contact it turns about holds"


@dataclass(frozen=True, eq=False)
class Twist:
    """A virtual motion: velocity (3,) of the centre of mass and angular velocity (3,)."""

    velocity: Floats
    angular: Floats

    def at(self, arms: Floats) -> Floats:
        """Velocities (n, 3) at the ends of arms (n, 3) from the centre."""
        return np.asarray(self.velocity + np.cross(self.angular, arms))


def assumptions_hold(
    load: Load, contacts: Contacts, friction: float, mass_and_inertia: MassAndInertia | None = None
) -> bool:
    """Whether a case meets all that the paper assumes, so that both judges must agree.

    Without mass and inertia that is on rest or motion only. Raises SceneError as `criteria.classify` does.
    """
    return not broken(classify(load, contacts, friction), mass_and_inertia)


def broken(
    paper: Classification, mass_and_inertia: MassAndInertia | None = None
) -> tuple[Assumption, ...]:
    """The assumptions that a case judged by the paper breaks; none if the grain is found at rest.

    Without mass and inertia INERTIA_FOLLOWS is not tested.
    """
    if not paper.moves:
        return ()
    normals = paper.contacts.normals[list(paper.significant)]
    pressed = _pressed(paper)
    couple_acts = paper.criterion is not Criterion.TRANSLATION_ONLY
    kept = pressed or (paper.criterion is Criterion.SIMULTANEOUS and paper.minima.sign_2 <= 0)
    plane = bool(np.ptp(normals, axis=0).max() <= NORMALS_ALIKE)
    slips_and_turns = pressed and paper.mode is Mode.SLIDING and not paper.held_by_sharing
    checks = {
        Assumption.ONE_SURFACE: plane or not pressed,
        Assumption.NOTHING_IN_THE_WAY: certain_motion(paper) is not None,
        Assumption.NO_COUPLE_PRESSES: not (couple_acts and kept),
        Assumption.FRICTION_TURNS_NOTHING: not slips_and_turns,
        Assumption.INERTIA_FOLLOWS: mass_and_inertia is None or _follows(paper, *mass_and_inertia),
    }
    return tuple(assumption for assumption, holds in checks.items() if not holds)


def certain_motion(paper: Classification) -> Twist | None:
    """A twist on which the load works and that no contact can hinder, among those the paper's verdict suggests."""
    return next((twist for twist in _suggested(paper) if _unhindered(twist, paper)), None)


def _pressed(paper: Classification) -> bool:
    """Whether force and couple together press the significant contacts."""
    return bool((paper.quantity_22 < -paper.tolerance * paper.force_scale).any())


def _follows(paper: Classification, mass: float, inertia: Floats) -> bool:
    """Whether lifting and pivoting as the paper finds them are motions of this mass and inertia."""
    if not _pressed(paper):
        free = Twist(paper.load.force / mass, np.linalg.solve(inertia, paper.load.couple))
        return _leaves(free, paper, keeping=None)
    if paper.mode is not Mode.PIVOTTING:
        return True
    return any(_pivots(paper, contact, mass, inertia) for contact in paper.significant)


def _pivots(paper: Classification, contact: int, mass: float, inertia: Floats) -> bool:
    """Whether the grain turns about one contact as about a joint: the force there is in its friction cone."""
    arm, normal = (
        paper.contacts.points[contact] - paper.load.centre,
        paper.contacts.normals[contact],
    )
    about_contact = inertia + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    angular = np.linalg.solve(about_contact, paper.load.couple - np.cross(arm, paper.load.force))
    turn = Twist(-np.cross(angular, arm), angular)
    answer = mass * turn.velocity - paper.load.force
    pressing = float(-normal @ answer)
    along = float(np.linalg.norm(answer + pressing * normal))
    return along <= paper.friction * pressing and _leaves(turn, paper, keeping=contact)


def _leaves(twist: Twist, paper: Classification, keeping: int | None) -> bool:
    """Whether all contacts, but one that is kept, move away from the bed."""
    velocity = twist.at(paper.contacts.points - paper.load.centre)
    leaving = -(velocity * paper.contacts.normals).sum(axis=1)
    zero = paper.tolerance * float(np.abs(velocity).max(initial=0.0))  # grazing is not leaving
    return bool((np.delete(leaving, [] if keeping is None else [keeping]) > zero).all())


def _suggested(paper: Classification) -> Iterator[Twist]:
    """Lifting along F, turning with tau about the centre or about each x*, sliding along x*."""
    still, load, at = np.zeros(3), paper.load, list(paper.significant)
    yield Twist(load.force, still)
    yield Twist(still, load.couple)
    for contact, couple in zip(at, paper.couple_about_contact, strict=True):
        arm = paper.contacts.points[contact] - load.centre
        yield Twist(-np.cross(couple, arm), couple)
    normals = paper.contacts.normals[at]
    for normal, along in zip(normals, coulomb.tangential(load.force, normals), strict=True):
        size = float(np.linalg.norm(along))
        if size > 0.0:
            # The shallowest way to leave a plane that friction cannot follow.
            yield Twist(along / size - paper.friction * normal, still)


def _unhindered(twist: Twist, paper: Classification) -> bool:
    load, contacts = paper.load, paper.contacts
    power = float(load.force @ twist.velocity + load.couple @ twist.angular)
    reach = paper.couple_scale / paper.force_scale
    speed = float(np.linalg.norm(twist.velocity) + reach * np.linalg.norm(twist.angular))
    velocity = twist.at(contacts.points - load.centre)
    leaving = -(velocity * contacts.normals).sum(axis=1)
    along = np.linalg.norm(velocity + leaving[:, None] * contacts.normals, axis=1)
    free = (leaving >= paper.friction * along - SLACK * speed).all()
    return bool(power > 1e-6 * paper.force_scale * speed and free)
