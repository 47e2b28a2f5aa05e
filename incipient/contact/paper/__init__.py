"""The paper's criteria of incipient motion at the significant reaction surface.

Equation numbers are the labels of the paper's source (docs/explanation/criteria.md); n points out
of the grain, r = x - c, and a force F presses a contact where n . F > 0.
"""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, Literal

import numpy as np

from incipient.arrays import Floats, cross
from incipient.contact.friction import FrictionCone, Law
from incipient.contact.paper import equations
from incipient.contact.paper.equations import (
    Away,
    Distribution,
    away,
    can_vanish,
    distribute,
    equal_fractions,
)
from incipient.contact.problem import Load, require_outward
from incipient.errors import SceneError
from incipient.files import plain, plain_fields
from incipient.geometry.contacts import Contacts


class Mode(Enum):
    """Outcome of the paper's table, with `row` and `wording`."""

    SLIDING = ("1a", "translation: sliding")
    LIFTING = ("1b", "translation: lifting")
    SLIDING_WITH_AWAY_ROTATION = ("2", "sliding with an ``away from the surface'' rotation")
    LIFTING_WITH_AWAY_ROTATION = ("3", "lifting with an ``away from the surface'' rotation")
    LIFTING_WITH_PIVOTTING = ("4", "pivotting combined with lifting")
    PIVOTTING = ("5a", "rotation only: pivotting")
    AWAY_ROTATION = ("5b", "rotation only: ``away from the surface'' rotation")
    SLIDING_AND_PIVOTTING = ("6", "sliding and pivotting")
    NO_INCIPIENT_MOTION = ("7", "no incipient motion")

    def __init__(self, row: str, wording: str) -> None:
        self.row = row
        self.wording = wording

    @property
    def label(self) -> str:
        """The name in words."""
        return self.name.lower().replace("_", " ")

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move."""
        return self is not Mode.NO_INCIPIENT_MOTION


class Category(Enum):
    """Item of the paper's list of possible modes, with two kinds of sliding and pivoting."""

    TRANSLATION_ONLY = ("1", "translation only (lifting or sliding)")
    SLIDING_WITH_AWAY_ROTATION = (
        "2",
        "sliding combined with an ``away from the surface'' rotation",
    )
    LIFTING_WITH_AWAY_ROTATION = (
        "3",
        "lifting combined with an ``away from the surface'' rotation",
    )
    PIVOTTING_WITH_LIFTING = ("4", "pivotting combined with lifting")
    ROTATION_ONLY = ("5", "rotation only (pivotting or an ``away from the surface'' rotation)")
    PIVOTTING_WITH_SLIDING = ("6(a)", "pivotting combined with sliding: about the same contact")
    PIVOTTING_WITH_SLIDING_APART = (
        "6(b)",
        "pivotting combined with sliding: about different contacts (less likely)",
    )

    def __init__(self, item: str, wording: str) -> None:
        self.item = item
        self.wording = wording


def category(mode: Mode, common_position: bool) -> Category | None:
    """Item of the paper's list for an outcome of its table; None without motion.

    `common_position`: the minima (2) and (7) share a contact.
    """
    if mode is Mode.SLIDING_AND_PIVOTTING and not common_position:
        return Category.PIVOTTING_WITH_SLIDING_APART
    item = mode.row[0]
    return next((listed for listed in Category if listed.item[0] == item), None)


class Criterion(Enum):
    """Applicable section of the paper: force, torque, or both."""

    NO_LOAD = "neither force nor torque acts"
    TRANSLATION_ONLY = "incipient translation only, (3): no torque acts"
    ROTATION_ONLY = "incipient rotation only, (6)-(8): no force acts"
    SIMULTANEOUS = "simultaneous incipient rotation and translation, (22)-(25)"


def simultaneous(force_sign: int, torque_sign: int, moves: bool, turns: bool) -> Mode:
    """Row of the table from the signs of minima (2) and (7), F != 0 (24) and tau != 0 (25).

    The table omits zero minima: (2) = 0 keeps the contact (sliding); (7) = 0 means pivoting where
    the force presses, away from the surface where it lifts.
    """
    if not turns:
        translation = Mode.LIFTING if force_sign > 0 else Mode.SLIDING
        return translation if moves else Mode.NO_INCIPIENT_MOTION
    if force_sign > 0:
        return Mode.LIFTING_WITH_PIVOTTING if torque_sign < 0 else Mode.LIFTING_WITH_AWAY_ROTATION
    if torque_sign > 0:
        return Mode.SLIDING_WITH_AWAY_ROTATION if moves else Mode.AWAY_ROTATION
    return Mode.SLIDING_AND_PIVOTTING if moves else Mode.PIVOTTING


def rotation_only(torque_sign: int, turns: bool, leaves: bool) -> Mode:
    """Outcome without a force: row 5, or row 1 if friction prevents rotation, tau = 0 by (8).

    Minimum (7) = 0 means rotation away from the surface. `leaves`: the force of uncoupling points
    away from every contact.
    """
    if torque_sign >= 0:
        return Mode.AWAY_ROTATION
    if turns:
        return Mode.PIVOTTING
    return Mode.LIFTING if leaves else Mode.SLIDING


TOLERANCE = 1e-9
Located = Literal["force", "torque"]


@dataclass(frozen=True, eq=False)
class Minima:
    """Significant reaction surfaces of the force (2) and of the torque (7)."""

    # Minimised quantities at every contact, (n,).
    projections_2: Floats
    projections_7: Floats
    # Signs of the minima, 0 within the tolerance.
    sign_2: int
    sign_7: int
    # Minimising contacts.
    surface_2: tuple[int, ...]
    surface_7: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Classification:
    """Verdict of the paper's criteria with all intermediate quantities.

    Arrays (k, ...) belong to the contacts `significant`, x* in the paper, and include their
    `fraction`. Forces act on the grain; torques are about its centre.
    """

    mode: Mode
    category: Category | None  # item of the paper's list of modes, 6(a) and 6(b) separated
    criterion: Criterion
    force: Floats  # F of (3), (24), or the force of uncoupling below (8); (3,)
    torque: Floats  # tau of the formula below (3), of (8) or (25); (3,)
    F_flow_and_g: Floats  # (9), (3,)
    tau_flow_and_g: Floats  # (21) about the centre, (3,)
    minimum_2: float
    minimum_7: float
    minima: Minima
    located_by: Located
    common_position: (
        bool  # (2) and (7) have a contact in common, as the simultaneous criteria assume
    )
    away_from_surface: bool  # minimum (7) > 0: the torque presses on no contact
    significant: tuple[int, ...]
    fraction: Floats  # (k,)
    F_tau: Floats  # (6), (k, 3)
    F_flow_g_and_tau: Floats  # the force that presses on x*, (k, 3)
    quantity_22: Floats  # n_in . F_flow_g_and_tau, negative: pressed; (k,)
    quantity_23: Floats  # negative: the reaction at x* counters the torque; (k,)
    C_friction: Floats  # 1: sticks, below: slips, 0: not pressed; (k,)
    reaction: Floats  # (k, 3)
    friction_force: Floats  # (k, 3)
    torque_about_contact: (
        Floats  # tau - r ^ F of the load, zero: no tendency to turn about x*; (k, 3)
    )
    held_by_sharing: (
        bool  # an unequal sharing among the significant contacts makes the torque vanish
    )
    obstructed_by: tuple[int, ...]  # contacts that the resulting motion would have to pass through
    force_scale: float
    torque_scale: float
    friction: float
    tolerance: float
    load: Load
    contacts: Contacts

    @cached_property
    def distribution(self) -> Distribution:
        """Forces of the whole contact surface under F_flow&g, outside the table of outcomes."""
        zero = self.force_scale * self.tolerance
        arms = self.contacts.points - self.load.centre
        return distribute(self.load.force, self.contacts, arms, self.friction, zero)

    @cached_property
    def away(self) -> Away | None:
        """Whether contact normals exclude the torque's axis through the centre; None without a torque."""
        size, reach = (
            _norm(self.load.flow_couple),
            self.torque_scale / max(self.force_scale, 1e-300),
        )
        if size <= self.torque_scale * self.tolerance:
            return None
        return away(
            self.contacts, self.load.centre, self.load.flow_couple / size, self.tolerance * reach
        )

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move."""
        return self.mode.moves

    def to_dict(self) -> dict[str, Any]:
        """JSON data."""
        read = {"row": self.mode.row, "wording": self.mode.wording, "moves": self.moves}
        derived = {"away": plain(self.away), "distribution": plain(self.distribution)}
        return read | plain_fields(self) | derived


def classify(
    load: Load,
    contacts: Contacts,
    law: Law,
    tolerance: float = TOLERANCE,
) -> Classification:
    """Predict incipient motion of a grain at rest by the paper's outcomes 1-7.

    The friction coefficient of `law` is zeta. Under force and torque x* minimises (2), or (7) where
    the force lifts everywhere. Forces below `tolerance` times the sum of |flow force|, |weight| and
    |torque| / arm count as zero, torques below that times the longest arm |x - c|.

    Raises SceneError if friction is negative or not finite, a contact lies at the centre of mass,
    or all normals point into the grain.
    """
    friction = float(FrictionCone.of(law).coefficient)
    arms = _arms(load, contacts, friction)
    reach = float(np.linalg.norm(arms, axis=1).max())
    acting = (load.flow_force, load.weight, load.flow_couple / reach)
    force_scale = float(sum(np.linalg.norm(part) for part in acting))
    scales = (
        force_scale * tolerance,
        force_scale * reach * tolerance,
    )  # of a zero force and a zero torque
    criterion = _criterion(load, scales)
    minima = _minima(load, contacts, arms, scales, tolerance)
    lifts = criterion is Criterion.SIMULTANEOUS and minima.sign_2 > 0
    turns_alone = criterion is Criterion.ROTATION_ONLY
    located: Located = "torque" if lifts or turns_alone else "force"
    at = minima.surface_2 if located == "force" else minima.surface_7
    answer = _reaction_at(load, contacts, arms, list(at), friction)
    moves, turns = _norm(answer["force"]) > scales[0], _norm(answer["torque"]) > scales[1]
    # Resultant torques (k, 3) if each significant contact in turn carried the whole load.
    whole = (answer["reaction"] + answer["friction_force"]) / answer["fraction"][:, None]
    held = not turns or can_vanish(load.flow_couple + cross(arms[list(at)], whole), scales[1])
    leaves = bool((contacts.normals @ answer["force"] < -scales[0]).all())
    mode = _mode(criterion, minima, moves, turns, held, leaves)
    common = bool(set(minima.surface_2) & set(minima.surface_7))
    return Classification(
        mode=mode,
        category=category(mode, common),
        criterion=criterion,
        F_flow_and_g=load.force,
        tau_flow_and_g=load.flow_couple,
        minimum_2=float(minima.projections_2.min()),
        minimum_7=float(minima.projections_7.min()),
        minima=minima,
        located_by=located,
        common_position=common,
        away_from_surface=minima.sign_7 > 0,
        significant=at,
        held_by_sharing=held,
        obstructed_by=_obstacles(mode, contacts, list(at), answer, scales),
        force_scale=force_scale,
        torque_scale=force_scale * reach,
        friction=friction,
        tolerance=tolerance,
        load=load,
        contacts=contacts,
        **answer,
    )


def _arms(load: Load, contacts: Contacts, friction: float) -> Floats:
    if not (np.isfinite(friction) and friction >= 0.0):
        raise SceneError(
            f"friction {friction} is not a coefficient; give a finite number that is not negative"
        )
    arms = contacts.points - load.centre
    lengths = np.linalg.norm(arms, axis=1)
    if lengths.min() <= 1e-12 * lengths.max():
        raise SceneError(
            f"contact {int(np.argmin(lengths))} lies at the centre of mass; give surface points"
        )
    require_outward(arms, contacts.normals)
    return np.asarray(arms)


def _criterion(load: Load, scales: tuple[float, float]) -> Criterion:
    pushed, turned = _norm(load.force) > scales[0], _norm(load.flow_couple) > scales[1]
    if pushed:
        return Criterion.SIMULTANEOUS if turned else Criterion.TRANSLATION_ONLY
    return Criterion.ROTATION_ONLY if turned else Criterion.NO_LOAD


def _minima(
    load: Load, contacts: Contacts, arms: Floats, scales: tuple[float, float], tolerance: float
) -> Minima:
    toward = -contacts.normals @ load.force
    # (7) is -lever |lever| with the lever of the torque on the normal, and has the minimisers of -lever.
    lengths = np.linalg.norm(arms, axis=1)
    lever = lengths * (contacts.normals * _tangential_force(load.flow_couple, arms)).sum(axis=1)
    force_zero, torque_zero = scales
    if _norm(load.flow_couple) > torque_zero:
        torque_zero = tolerance * _norm(load.flow_couple)  # its sign depends on direction alone
    return Minima(
        projections_2=toward,
        projections_7=-lever * np.abs(lever),
        sign_2=_sign(toward.min(), force_zero),
        sign_7=_sign((-lever).min(), torque_zero),
        surface_2=_indices_of_least(toward, force_zero),
        surface_7=_indices_of_least(-lever, torque_zero),
    )


def _tangential_force(torque: Floats, arms: Floats) -> Floats:
    """F_tau = tau ^ r / |r|^2 of (6), (n, 3)."""
    return np.asarray(cross(torque, arms) / (arms * arms).sum(axis=1, keepdims=True))


def _reaction_at(
    load: Load, contacts: Contacts, arms: Floats, at: list[int], coefficient: float
) -> dict[str, Any]:
    """Quantities at x* and the resultants (24), (25); (3) without a torque, (8) without a force."""
    arm, normals = arms[at], contacts.normals[at]
    fraction = equal_fractions(contacts.points[at], normals)
    from_torque = _tangential_force(load.flow_couple, arm)
    pressing = load.force + from_torque
    toward = -(normals * pressing).sum(axis=1)
    against = (cross(arm, -normals) @ load.flow_couple) * np.abs(toward)
    reaction = fraction[:, None] * equations.reaction(pressing, normals)
    friction_force = fraction[:, None] * equations.friction(pressing, normals, coefficient)
    return {
        "fraction": fraction,
        "F_tau": from_torque,
        "F_flow_g_and_tau": pressing,
        "quantity_22": toward,
        "quantity_23": against,
        "C_friction": equations.C_friction(pressing, normals, coefficient),
        "reaction": reaction,
        "friction_force": friction_force,
        "torque_about_contact": load.flow_couple - cross(arm, load.force),
        "force": load.force + (reaction + friction_force).sum(axis=0),
        "torque": load.flow_couple + cross(arm, reaction + friction_force).sum(axis=0),
    }


def _mode(
    criterion: Criterion, minima: Minima, moves: bool, turns: bool, held: bool, leaves: bool
) -> Mode:
    if criterion is Criterion.NO_LOAD:
        return Mode.NO_INCIPIENT_MOTION
    if criterion is Criterion.TRANSLATION_ONLY:
        # Contact forces that no sharing lets balance the torque: the grain pivots.
        return simultaneous(minima.sign_2, -1, moves, not (moves or held))
    if criterion is Criterion.ROTATION_ONLY:
        return rotation_only(minima.sign_7, turns, leaves)
    return simultaneous(minima.sign_2, minima.sign_7, moves, turns)


def _obstacles(
    mode: Mode,
    contacts: Contacts,
    at: list[int],
    answer: dict[str, Any],
    scales: tuple[float, float],
) -> tuple[int, ...]:
    """Contacts that the motion would penetrate, where the paper's assumption fails."""
    if not mode.moves:
        return ()
    if (answer["C_friction"] < 1.0 - TOLERANCE).any():
        met = (contacts.normals @ answer["force"] > scales[0])[None]
    else:
        arms = contacts.points[None] - contacts.points[at][:, None]
        velocity = cross(answer["torque_about_contact"][:, None], arms)
        reach = max(float(np.linalg.norm(arms, axis=2).max()), 1e-300)
        met = (velocity * contacts.normals).sum(axis=2) > scales[1] * reach
    if not met.any(axis=1).all():
        return ()
    return tuple(int(k) for k in np.flatnonzero(met.any(axis=0)))


def _indices_of_least(values: Floats, tolerance: float) -> tuple[int, ...]:
    return tuple(int(k) for k in np.flatnonzero(values <= values.min() + tolerance))


def _sign(value: float, zero: float) -> int:
    return 0 if abs(value) <= zero else int(np.sign(value))


def _norm(value: Floats) -> float:
    return float(np.linalg.norm(value))
