"""The paper's modes of incipient motion and its table of outcomes 1-7 (end of section 3)."""

from enum import Enum


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
