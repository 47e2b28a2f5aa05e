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

# Number of arguments: (least, most); None is no limit.
_FUNCTIONS: dict[str, tuple[int, int | None]] = {
    **dict.fromkeys(("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "abs"), (1, 1)),
    "min": (2, None),
    "max": (2, None),
    "where": (3, 3),
}
_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "add",
    ast.Sub: "subtract",
    ast.Mult: "multiply",
    ast.Div: "divide",
    ast.Pow: "power",
    ast.USub: "negative",
    ast.UAdd: "positive",
    ast.Lt: "less",
    ast.LtE: "less_equal",
    ast.Gt: "greater",
    ast.GtE: "greater_equal",
    ast.And: "logical_and",
    ast.Or: "logical_or",
}
_VOCABULARY = (
    f"use numbers, {', '.join(VARIABLES)}, pi, + - * / **, "
    f"{', '.join(name for name in _FUNCTIONS if name != 'where')} and where(condition, a, b)"
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
        try:
            self._at(dict.fromkeys((*VARIABLES, "pi"), np.zeros(1)))
        except RecursionError:
            raise _refusal(self.text, "is too deeply nested", "simplify it") from None

    def __call__(self, x: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Values (n,) at points x (3, n) and time t. Raises SceneError for values that are not finite."""
        value = self._at({"x": x[0], "y": x[1], "z": x[2], "t": t, "pi": math.pi})
        values = np.array(np.broadcast_to(value, x.shape[1:]), dtype=float)
        undefined = np.flatnonzero(~np.isfinite(values))
        if len(undefined):
            i = undefined[0]
            where = ", ".join(
                f"{name} = {value:g}" for name, value in zip("xyz", x[:, i], strict=True)
            )
            raise _refusal(
                self.text,
                f"is {values[i]:g} at {where}, t = {t:g}",
                "give a formula that is finite there, or guard it with where(condition, a, b)",
                self.key,
            )
        return values

    @property
    def variables(self) -> frozenset[str]:
        names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(names & set(VARIABLES))

    def _at(self, names: dict[str, Any]) -> Any:
        with np.errstate(all="ignore"):  # a branch that `where` discards may well be undefined
            return _number(self._tree, names, self.text)

    @cached_property
    def _tree(self) -> ast.expr:
        return _parse(self.text)


def _parse(text: str) -> ast.expr:
    if len(text) > MAXIMUM_LENGTH:
        raise SceneError(
            f'the formula "{text[:20]}..." has {len(text)} characters; shorten it to {MAXIMUM_LENGTH}'
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # the error that follows says it
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "too deeply nested or not text"
        raise _refusal(text, f"is not a formula ({reason})") from None


def _refusal(text: str, why: str, remedy: str = _VOCABULARY, key: str = "") -> SceneError:
    place = f"{key}: " if key else ""
    return SceneError(" ".join(f'{place}"{text}" {why}; {remedy}'.split()))


def expressions(texts: Sequence[str], key: str) -> list[Expression]:
    """Formulas of a list under a key."""
    return [Expression(text, f"{key}[{number}]") for number, text in enumerate(texts)]


def of_time(texts: Sequence[str], key: str) -> Callable[[float], Floats]:
    """Values (n,) over time of formulas in t."""
    formulas, origin = expressions(texts, key), np.zeros((3, 1))
    return lambda time: np.array([float(formula(origin, time)[0]) for formula in formulas])


def _number(node: ast.AST, names: dict[str, Any], text: str) -> Any:
    match node:
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in _OPERATORS:
            return _function(operator)(_number(left, names, text), _number(right, names, text))
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _constant(value, text)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _called(name, arguments, names, text)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as operator, operand=operand):
            return _function(operator)(_number(operand, names, text))
        case ast.Name(id=name) if name in _FUNCTIONS:
            raise _refusal(text, f"uses the function {name} as a number", f"write {name}(...)")
        case ast.Name(id=name):
            raise _refusal(text, f'contains the unknown name "{name}"')
        case ast.BinOp(op=ast.BitXor()):
            raise _refusal(text, "contains ^", "write ** for a power")
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            raise _refusal(text, "uses a comparison as a number", "write where(condition, a, b)")
    raise _refusal(text, f'contains "{_source(node)}", which is not allowed')


def _condition(node: ast.AST, names: dict[str, Any], text: str) -> Any:
    match node:
        case ast.Compare(ops=operators) if all(
            type(operator) in _OPERATORS for operator in operators
        ):
            sides = [_number(side, names, text) for side in (node.left, *node.comparators)]
            pairs = zip(operators, sides[:-1], sides[1:], strict=True)
            return reduce(np.logical_and, [_function(operator)(a, b) for operator, a, b in pairs])
        case ast.BoolOp(op=operator, values=parts):
            return reduce(_function(operator), [_condition(part, names, text) for part in parts])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return np.logical_not(_condition(operand, names, text))
    remedy = "compare two numbers with < <= > or >="
    raise _refusal(text, f'takes "{_source(node)}" for a condition', remedy)


def _constant(value: int | float, text: str) -> np.float64:
    if not abs(value) <= sys.float_info.max:
        raise _refusal(text, "contains a number that is too large", "give a smaller number")
    return np.float64(value)


def _called(name: str, arguments: list[ast.expr], names: dict[str, Any], text: str) -> Any:
    if name not in _FUNCTIONS:
        raise _refusal(text, f'calls the unknown function "{name}"')
    least, most = _FUNCTIONS[name]
    if len(arguments) < least or (most is not None and len(arguments) > most):
        count = f"{least}" if least == most else f"at least {least}"
        raise _refusal(text, f"gives {name} {len(arguments)} argument(s)", f"give it {count}")
    first = _condition if name == "where" else _number
    values = [first(arguments[0], names, text)]
    values += [_number(argument, names, text) for argument in arguments[1:]]
    if name in ("min", "max"):
        return reduce(np.minimum if name == "min" else np.maximum, values)
    return getattr(np, name)(*values)


def _source(node: ast.AST) -> str:
    return ast.unparse(node)[:40]


def _function(operator: ast.AST) -> Callable[..., Any]:
    return getattr(np, _OPERATORS[type(operator)])
