"""Formulas in x, y, z and t from a scene, evaluated on arrays without running anything the scene says."""

import ast
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

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
    ast.Not: "logical_not",
}
_VOCABULARY = (
    f"use numbers, {', '.join(VARIABLES)}, pi, + - * / **, "
    f"{', '.join(name for name in _FUNCTIONS if name != 'where')} and where(condition, a, b)"
)


@dataclass(frozen=True)
class Expression:
    """A formula such as ``"where(y < 0.5, sin(pi*t)*y, 0)"``, vectorised over points.

    Known are numbers, ``x y z t pi``, ``+ - * / **``, ``sin cos tan exp log sqrt tanh abs min max``
    and ``where(condition, a, b)`` whose condition is made of ``< <= > >=`` with ``and``, ``or``, ``not``.
    Nothing else is accepted, so a formula from an untrusted scene can compute but not act. `key` is where the scene
    has it, which a refused value names.

    Raises SceneError if the text is not such a formula.
    """

    text: str
    key: str = ""

    def __post_init__(self) -> None:
        try:
            _check_number(self._tree, self.text)
        except RecursionError:
            raise _refusal(self.text, "is too deeply nested", "simplify it") from None

    def __call__(self, x: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Values (n,) at points x (3, n) and time t. Not collective.

        Raises SceneError if a value is infinite or not a number.
        """
        names = {"x": x[0], "y": x[1], "z": x[2], "t": t, "pi": math.pi}
        with np.errstate(all="ignore"):  # a branch that `where` discards may well be undefined
            value = _evaluate(self._tree, names, np)
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
        """The variables among x, y, z and t on which the formula depends."""
        names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(names & set(VARIABLES))

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
    """The formulas that a scene has in a list under a key."""
    return [Expression(text, f"{key}[{number}]") for number, text in enumerate(texts)]


def _check_number(node: ast.AST, text: str) -> None:
    """Refuse anything but the vocabulary where a number is expected."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            _check_constant(value, text)
        case ast.Name(id=name):
            _check_name(name, text)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check_number(operand, text)
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in _OPERATORS:
            _check_number(left, text)
            _check_number(right, text)
        case ast.BinOp(op=ast.BitXor()):
            raise _refusal(text, "contains ^", "write ** for a power")
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            _check_call(name, arguments, text)
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            raise _refusal(text, "uses a comparison as a number", "write where(condition, a, b)")
        case _:
            raise _refusal(text, f'contains "{_source(node)}", which is not understood')


def _check_condition(node: ast.AST, text: str) -> None:
    """Refuse anything but comparisons where a condition is expected."""
    match node:
        case ast.Compare(ops=operators) if all(
            type(operator) in _OPERATORS for operator in operators
        ):
            for side in (node.left, *node.comparators):
                _check_number(side, text)
        case ast.BoolOp(values=parts):
            for part in parts:
                _check_condition(part, text)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            _check_condition(operand, text)
        case _:
            raise _refusal(
                text,
                f'takes "{_source(node)}" for a condition',
                "compare two numbers with < <= > or >=",
            )


def _check_constant(value: int | float, text: str) -> None:
    try:
        finite = math.isfinite(value)
    except OverflowError:
        finite = False
    if not finite:
        raise _refusal(text, "contains a number too large", "give a smaller number")


def _check_name(name: str, text: str) -> None:
    if name in _FUNCTIONS:
        raise _refusal(text, f"uses the function {name} as a number", f"write {name}(...)")
    if name not in (*VARIABLES, "pi"):
        raise _refusal(text, f'contains the unknown name "{name}"')


def _check_call(name: str, arguments: list[ast.expr], text: str) -> None:
    if name not in _FUNCTIONS:
        raise _refusal(text, f'calls the unknown function "{name}"')
    least, most = _FUNCTIONS[name]
    if len(arguments) < least or (most is not None and len(arguments) > most):
        count = f"{least}" if least == most else f"at least {least}"
        raise _refusal(text, f"gives {name} {len(arguments)} argument(s)", f"give it {count}")
    if name == "where":
        _check_condition(arguments[0], text)
        arguments = arguments[1:]
    for argument in arguments:
        _check_number(argument, text)


def _source(node: ast.AST) -> str:
    return ast.unparse(node)[:40]


def _evaluate(node: ast.AST, names: dict[str, Any], np: Any) -> Any:
    """The value of a checked formula: a number, a condition, or an array (n,) of either."""
    match node:
        case ast.Constant(value=value):
            return np.float64(value)
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=operator, operand=operand):
            return _function(operator, np)(_evaluate(operand, names, np))
        case ast.BinOp(op=operator, left=left, right=right):
            return _function(operator, np)(_evaluate(left, names, np), _evaluate(right, names, np))
        case ast.BoolOp(op=operator, values=parts):
            return reduce(_function(operator, np), (_evaluate(part, names, np) for part in parts))
        case ast.Compare(ops=operators):
            sides = [_evaluate(side, names, np) for side in (node.left, *node.comparators)]
            pairs = zip(operators, sides[:-1], sides[1:], strict=True)
            return reduce(
                np.logical_and, [_function(operator, np)(a, b) for operator, a, b in pairs]
            )
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _apply(name, [_evaluate(argument, names, np) for argument in arguments], np)
    raise AssertionError(f"unchecked formula node {node}")


def _function(operator: ast.AST, np: Any) -> Callable[..., Any]:
    return getattr(np, _OPERATORS[type(operator)])


def _apply(name: str, arguments: list[Any], np: Any) -> Any:
    if name in ("min", "max"):
        return reduce(np.minimum if name == "min" else np.maximum, arguments)
    return getattr(np, name)(*arguments)
