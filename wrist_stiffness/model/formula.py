"""A user's formula: parsed into a tree of allowed operations, never evaluated as code."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.memory import lagged, play

NO_UNITS: Mapping[str, float] = MappingProxyType({})


class UndefinedFormulaError(InputError):
    """A formula has no finite value at a sample.

    `message`: which term, and for what; `time_s`: stamp of the sample [s].
    """

    def __init__(self, message: str, time_s: float) -> None:
        super().__init__(message)
        self.time_s = time_s


Value = Any
"""A number or an array (n,)."""

FUNCTIONS: dict[str, tuple[int, Callable[..., Value]]] = {
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "sqrt": (1, np.sqrt),
    "abs": (1, np.abs),
    "tanh": (1, np.tanh),
    "sign": (1, np.sign),
    "floor": (1, np.floor),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
"""Number of arguments and meaning of each function."""


def _lag(x: Array, tau: float, time: Array, state: State | None) -> tuple[Array, State]:
    """Follow x late, with a time constant."""
    found, state = lagged(time, x[:, None], tau, state)
    return found[:, 0], state


def _play(x: Array, slack: float, time: Array, state: State | None) -> tuple[Array, State]:
    """Follow x as something that x pushes with play to both sides."""
    found = play(x, slack, np.asarray(state[0] if state else x[0]))
    return found, (float(found[-1]),)


State = tuple[Any, ...]
Remembering = Callable[[Array, float, Array, State | None], tuple[Array, State]]

MEMORIES: dict[str, Remembering] = {"lag": _lag, "play": _play}
"""Functions of a signal and a positive number that remember what was before: `lag(x, seconds)`, a
first-order lag, and `play(x, slack)`.  They begin settled at the first sample."""


@dataclass
class Past:
    """What a formula remembers while it is evaluated."""

    time: Array  # (n,), stamps [s]
    # of each remembering function by its line and column; empty before the first sample
    states: dict[tuple[int, int], State] = field(default_factory=dict)

    def follow(self, node: ast.Call, name: str, values: Sequence[Value]) -> Value:
        """Return what a remembering function makes of its arguments."""
        x = np.broadcast_to(np.asarray(values[0], dtype=float), self.time.shape)
        size = np.asarray(values[1], dtype=float)
        if size.ndim or not size > 0.0 or not np.isfinite(x).all():
            return np.full(x.shape, np.nan)
        at = node.lineno, node.col_offset
        found, self.states[at] = MEMORIES[name](x, float(size), self.time, self.states.get(at))
        return found


COUNTS = {**{name: count for name, (count, _) in FUNCTIONS.items()}, **dict.fromkeys(MEMORIES, 2)}
"""Number of arguments of each function."""

OPERATIONS: dict[type[ast.AST], Callable[..., Value]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}

LONGEST = 1000
"""Characters of a formula."""

DEEPEST = 50
"""Levels of a formula's tree."""


def names_in(text: str) -> frozenset[str]:
    """Return the names of variables in an expression.

    Raises `InputError` if it cannot be read, or is no formula whatever its names stand for.
    """
    names = _names(_parsed(text))
    Formula(text, tuple(names))
    return names


def _names(tree: ast.expr) -> frozenset[str]:
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return frozenset(used - COUNTS.keys())


def _parsed(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise InputError(f"formula: {len(text)} characters, at most {LONGEST}")
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise InputError(
            f"formula {text!r}, column {error.offset or len(text) + 1}: {error.msg}"
        ) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"formula {text!r}: cannot be read: {error}") from error


@dataclass(frozen=True)
class Formula:
    """An expression in named variables.

    Raises `InputError` if it holds anything else; the message names the column.
    """

    text: str  # numbers, names, + - * / **, parentheses, `FUNCTIONS` and `MEMORIES`
    variables: tuple[str, ...]  # names that it may use

    def __post_init__(self) -> None:
        """Check the whole expression."""
        self._check(self._tree, 0)

    @cached_property
    def names(self) -> frozenset[str]:
        """Variables that the expression does use."""
        return _names(self._tree)

    @property
    def count(self) -> int:
        """Number of formulas that it has between commas."""
        return len(self._tree.elts) if isinstance(self._tree, ast.Tuple) else 1

    @cached_property
    def remembers(self) -> bool:
        """Whether its value depends on earlier samples."""
        calls = (node.func for node in ast.walk(self._tree) if isinstance(node, ast.Call))
        return any(isinstance(each, ast.Name) and each.id in MEMORIES for each in calls)

    def __call__(self, values: Mapping[str, Value], past: Past | None = None) -> Array:
        """Return the value for variables of n samples.

        `values`: at least the `names`; `past`: of a formula that remembers; brought up to the last
        sample.  Gives (n,) float or float, of r formulas between commas (n, r) or (r,): not finite
        where the formula is not defined.
        """
        with np.errstate(all="ignore"):
            return np.asarray(_value(self._tree, values, past or Past(np.zeros(1))), dtype=float)

    def undefined(self, values: Mapping[str, float], per_si: Mapping[str, float] = NO_UNITS) -> str:
        """Return the term that makes the formula undefined for one sample, and its variables.

        `values`: at least the `names`; `per_si`: by what those are told larger whose name ends in a
        unit.  Gives the innermost term without a finite value, as it was typed.
        """
        with np.errstate(all="ignore"):
            terms = [
                node
                for node in ast.walk(self._tree)
                if isinstance(node, ast.expr)
                and not (isinstance(node, ast.Name) and node.id in COUNTS)
                and not np.all(np.isfinite(_value(node, values, Past(np.zeros(1)))))
            ]
        if not terms:
            return f"{self.text} has no finite value after what was before"
        # A walk goes from the whole to its parts.
        term = terms[-1]
        used = sorted({node.id for node in ast.walk(term) if isinstance(node, ast.Name)})
        # Stamps count from 1970: six digits of them say nothing.
        digits = {"time": ".3f"}
        told = [
            f"{n} = {values[n] * per_si.get(n, 1.0):{digits.get(n, '.6g')}}"
            for n in used
            if n in values
        ]
        text = ast.get_source_segment(self.text, term) or self.text
        return f"{text} has no finite value" + (f" for {', '.join(told)}" if told else "")

    @cached_property
    def _tree(self) -> ast.expr:
        return _parsed(self.text)

    def _check(self, node: ast.expr, depth: int) -> None:
        if depth > DEEPEST:
            raise self._refusal(node, f"nested deeper than {DEEPEST} levels")
        parts: list[ast.expr] = []
        match node:
            case ast.Tuple(elts=[_, _, *_]) if depth == 0:
                parts = node.elts
            case ast.Constant(value=number):
                if isinstance(number, bool) or not isinstance(number, int | float):
                    raise self._refusal(node, f"{number!r} is not a number")
                if not abs(number) <= float(np.finfo(float).max):
                    raise self._refusal(node, "the number is too large")
            case ast.Name(id=name):
                if name not in self.variables:
                    known = ", ".join(self.variables)
                    raise self._refusal(node, f"unknown name {name}; known are {known}")
            case ast.BinOp() if type(node.op) in OPERATIONS:
                parts = [node.left, node.right]
            case ast.UnaryOp() if type(node.op) in OPERATIONS:
                parts = [node.operand]
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                parts = node.args
                if name not in COUNTS:
                    known = ", ".join(COUNTS)
                    raise self._refusal(node, f"unknown function {name}; known are {known}")
                if len(parts) != COUNTS[name]:
                    why = f"{name} takes {COUNTS[name]} values, not {len(parts)}"
                    raise self._refusal(node, why)
            case _:
                raise self._refusal(
                    node,
                    "only numbers, names, + - * / **, parentheses, the functions "
                    f"{', '.join(COUNTS)} and commas between whole formulas are allowed",
                )
        for part in parts:
            self._check(part, depth + 1)

    def _refusal(self, node: ast.expr, why: str) -> InputError:
        return InputError(f"formula {self.text!r}, column {node.col_offset + 1}: {why}")


def _value(node: ast.expr, values: Mapping[str, Value], past: Past) -> Value:
    match node:
        case ast.Tuple(elts=parts):
            own = [_value(part, values, past) for part in parts]
            return np.stack(np.broadcast_arrays(*own), axis=-1)
        case ast.Constant(value=number):
            return float(number)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return values[name]
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATIONS[type(op)](_value(left, values, past), _value(right, values, past))
        case ast.UnaryOp(op=op, operand=operand):
            return OPERATIONS[type(op)](_value(operand, values, past))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            found = [_value(argument, values, past) for argument in arguments]
            return (
                past.follow(node, name, found) if name in MEMORIES else FUNCTIONS[name][1](*found)
            )
    raise InputError(f"formula: {ast.dump(node)} was not checked")
