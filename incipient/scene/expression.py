"""Formulas in x, y, z and t, evaluated on arrays without executing code of the scene."""

import ast
import math
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError

VARIABLES = ("x", "y", "z", "t")
MAXIMUM_LENGTH = 500

_FUNCTIONS: dict[str, Any] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh")},
    "abs": np.abs,
    "min": np.minimum,
    "max": np.maximum,
    "where": np.where,
}
_OPERATIONS: dict[Any, Any] = {
    **_FUNCTIONS,
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
    ast.Not: np.logical_not,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
}
_VOCABULARY = (
    f"use numbers, {', '.join(VARIABLES)}, pi, + - * / **, "
    f"{', '.join(name for name in _FUNCTIONS if name != 'where')} and "
    "where(condition, a, b) with < <= > >= and or not"
)


@dataclass(frozen=True)
class Expression:
    """Formula such as ``"where(y < 0.5, sin(pi*t)*y, 0)"``, vectorised over points.

    Numbers, ``x y z t pi``, ``+ - * / **``, ``sin cos tan exp log sqrt tanh abs min max`` and ``where(condition, a,
    b)``, with ``< <= > >= and or not`` in the condition, which is 1 where it holds and 0 elsewhere. Raises SceneError,
    naming the `key`, for any other text, so that untrusted scenes are safe.
    """

    text: str
    key: str = ""

    def __post_init__(self) -> None:
        if len(self.text) > MAXIMUM_LENGTH:
            why = f"has {len(self.text)} characters; shorten it to {MAXIMUM_LENGTH}"
            raise SceneError(f'the formula "{self.text[:20]}..." {why}')
        try:
            self(np.zeros((3, 0)))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            reason = getattr(error, "msg", "too deeply nested or not text")
            raise self._refusal(f"is not a formula ({reason})") from None

    def __call__(self, x: np.ndarray, t: float | Floats = 0.0) -> np.ndarray:
        """Values (n,) at points x (3, n) and times t. Raises SceneError for values that are not finite."""
        names = {"x": x[0], "y": x[1], "z": x[2], "t": t, "pi": math.pi}
        with np.errstate(all="ignore"):  # a branch that `where` discards may well be undefined
            value = self._value(self._tree, names)
        values = np.array(np.broadcast_to(value, x.shape[1:]), dtype=float)
        if not np.isfinite(values).all():
            i = np.flatnonzero(~np.isfinite(values))[0]
            place = {
                **dict(zip("xyz", x[:, i], strict=True)),
                "t": np.broadcast_to(t, values.shape)[i],
            }
            where = ", ".join(f"{name} = {c:g}" for name, c in place.items())
            remedy = "give a formula that is finite there, or guard it with where(condition, a, b)"
            raise self._refusal(f"is {values[i]:g} at {where}", remedy)
        return values

    @property
    def variables(self) -> frozenset[str]:
        names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(names & set(VARIABLES))

    @cached_property
    def _tree(self) -> ast.expr:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # the error that follows says it
            return ast.parse(self.text.strip(), mode="eval").body

    def _value(self, node: ast.AST, names: dict[str, Any]) -> Any:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            if not abs(node.value) <= sys.float_info.max:  # type: ignore[arg-type]
                raise self._refusal("contains a number that is too large", "give a smaller one")
            return node.value
        if isinstance(node, ast.Name) and node.id in names:
            return names[node.id]
        kind, parts = _operation(node)
        if (function := _OPERATIONS.get(kind)) is None:
            what = f'"{ast.unparse(node)[:40]}", which is not allowed'
            what = f'the unknown name "{kind}"' if isinstance(kind, str) else what
            raise self._refusal(f"contains {what}")
        values = [np.asarray(self._value(part, names), dtype=float) for part in parts]
        number = getattr(function, "nin", 3)
        if len(values) < number or (len(values) > number and number != 2):
            why = f"gives {kind} {len(values)} argument(s)"
            raise self._refusal(why, f"give it {number if number != 2 else 'at least 2'}")
        return reduce(function, values) if number == 2 else function(*values)

    def _refusal(self, why: str, remedy: str = _VOCABULARY) -> SceneError:
        place = f"{self.key}: " if self.key else ""
        return SceneError(" ".join(f'{place}"{self.text}" {why}; {remedy}'.split()))


def _operation(node: ast.AST) -> tuple[Any, Sequence[ast.AST]]:
    """A key of the operations, and the operands; None for what is no operation."""
    match node:
        case ast.BinOp(left, by, right) | ast.Compare(left, [by], [right]):
            return type(by), (left, right)
        case ast.Compare(left, [by, *more], [right, *others]):
            return ast.And, (ast.Compare(left, [by], [right]), ast.Compare(right, more, others))
        case ast.UnaryOp(by, part):
            return type(by), (part,)
        case ast.BoolOp(by, parts):
            return type(by), parts
        case ast.Call(ast.Name(name), parts, []):
            return name, parts
        case ast.Name(name):
            return name, ()
    return None, ()


def expressions(texts: Sequence[str], key: str) -> list[Expression]:
    """Formulas of a list under a key."""
    return [Expression(text, f"{key}[{number}]") for number, text in enumerate(texts)]


def of_time(texts: Sequence[str], key: str) -> Callable[[float | Floats], Floats]:
    """Values (n,) at a time, or (n, times), of formulas in t."""
    formulas = expressions(texts, key)

    def values(times: float | Floats) -> Floats:
        origin = np.zeros((3, np.size(times)))
        rows = np.array([formula(origin, times) for formula in formulas])
        return rows.reshape(-1, *np.shape(times))

    return values


def kinks(values: Floats, times: Floats) -> Floats:
    """Times at which the slope of values (times, ...) jumps by more than twice its change in ten of the times."""
    bends = np.pad(np.abs(_changes(values, 2)).max(axis=1), 2)
    # Second differences at a kink are large, on both sides as in smooth motion.
    around = bends[:-4] + bends[4:] + 1e-10 * np.abs(values).max()
    return times[1:-1][bends[2:-2] > 10.0 * around]


def landmarks(values: Floats, times: Floats) -> Floats:
    """Times between which sixteenths of all changes of values (times, ...) lie."""
    changed = np.abs(_changes(values, 1)).sum(axis=1).cumsum()
    return times[np.searchsorted(changed, np.linspace(0.0, changed[-1], 17))]


def _changes(values: Floats, order: int) -> Floats:
    return np.diff(values.reshape(len(values), -1), order, axis=0)
