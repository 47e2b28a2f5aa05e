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

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh")},
    "abs": np.abs,
    "min": np.minimum,
    "max": np.maximum,
    "where": np.where,
}
_OPERATORS: dict[type[ast.AST], np.ufunc] = {
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
    b)``, with ``< <= > >= and or not`` in the condition. Raises SceneError, naming the `key`, for any other text, so
    that untrusted scenes are safe.
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

    def __call__(self, x: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Values (n,) at points x (3, n) and time t. Raises SceneError for values that are not finite."""
        names = {"x": x[0], "y": x[1], "z": x[2], "t": t, "pi": math.pi}
        with np.errstate(all="ignore"):  # a branch that `where` discards may well be undefined
            value = self._value(self._tree, names)
        values = np.array(np.broadcast_to(value, x.shape[1:]), dtype=float)
        if not np.isfinite(values).all():
            i = np.flatnonzero(~np.isfinite(values))[0]
            where = ", ".join(f"{name} = {c:g}" for name, c in zip("xyz", x[:, i], strict=True))
            remedy = "give a formula that is finite there, or guard it with where(condition, a, b)"
            raise self._refusal(f"is {values[i]:g} at {where}, t = {t:g}", remedy)
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

    def _value(self, node: ast.AST, names: dict[str, Any], is_condition: bool = False) -> Any:
        """A number at each point, or the truth of a condition."""
        value = np.asarray(self._applied(node, names))
        if is_condition and value.dtype != bool:
            why = f'takes "{ast.unparse(node)[:40]}" for a condition'
            raise self._refusal(why, "compare two numbers with < <= > or >=")
        if value.dtype == bool and not is_condition:
            why = "uses a comparison as a number"
            raise self._refusal(why, "write where(condition, a, b)")
        return value

    def _applied(self, node: ast.AST, names: dict[str, Any]) -> Any:
        match node:
            case ast.Name(id=name) if name in names:
                return names[name]
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                if not abs(value) <= sys.float_info.max:
                    raise self._refusal("contains a number that is too large", "give a smaller one")
                return float(value)
            case ast.BinOp(left=left, op=by, right=right) if type(by) in _OPERATORS:
                return _OPERATORS[type(by)](self._value(left, names), self._value(right, names))
            case ast.UnaryOp(op=by, operand=part) if type(by) in _OPERATORS:
                return _OPERATORS[type(by)](self._value(part, names, isinstance(by, ast.Not)))
            case ast.BoolOp(op=by, values=parts):
                return reduce(_OPERATORS[type(by)], [self._value(p, names, True) for p in parts])
            case ast.Compare(left, by, others) if {*map(type, by)} <= _OPERATORS.keys():
                sides = [self._value(side, names) for side in (left, *others)]
                pairs = zip(by, sides[:-1], sides[1:], strict=True)
                return reduce(np.logical_and, [_OPERATORS[type(op)](a, b) for op, a, b in pairs])
            case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in _FUNCTIONS:
                least = getattr(_FUNCTIONS[name], "nin", 3)
                if len(parts) < least or (len(parts) > least and least != 2):
                    count = f"{least}" if least != 2 else "at least 2"
                    raise self._refusal(
                        f"gives {name} {len(parts)} argument(s)", f"give it {count}"
                    )
                first = name == "where"
                values = [self._value(part, names, first and part is parts[0]) for part in parts]
                return reduce(_FUNCTIONS[name], values) if least == 2 else _FUNCTIONS[name](*values)
            case ast.Name(id=name) | ast.Call(func=ast.Name(id=name), keywords=[]) if (
                name not in _FUNCTIONS
            ):
                raise self._refusal(f'contains the unknown name "{name}"')
            case ast.BinOp(op=ast.BitXor()):
                raise self._refusal("contains ^", "write ** for a power")
        raise self._refusal(f'contains "{ast.unparse(node)[:40]}", which is not allowed')

    def _refusal(self, why: str, remedy: str = _VOCABULARY) -> SceneError:
        place = f"{self.key}: " if self.key else ""
        return SceneError(" ".join(f'{place}"{self.text}" {why}; {remedy}'.split()))


def expressions(texts: Sequence[str], key: str) -> list[Expression]:
    """Formulas of a list under a key."""
    return [Expression(text, f"{key}[{number}]") for number, text in enumerate(texts)]


def of_time(texts: Sequence[str], key: str) -> Callable[[float], Floats]:
    """Values (n,) over time of formulas in t."""
    formulas, origin = expressions(texts, key), np.zeros((3, 1))
    return lambda time: np.array([float(formula(origin, time)[0]) for formula in formulas])
