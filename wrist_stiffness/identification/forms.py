"""A small library of physical forms over the recorded signals, for a law that nobody wrote yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.formula import Formula, Past
from wrist_stiffness.model.formula_law import TEMPERATURE, TURNS, WRENCH

Shape = tuple[float, ...]

WAVES = tuple(0.5 * n for n in range(1, 21))
"""Waves over the range of an angle that are tried: from a bow to a tenth of it."""

PHASES = tuple(np.pi * n / 4.0 for n in range(4))

MOMENTS = 24
"""Moments at which a step is tried, in all recordings together."""

CENTRES, WIDTHS = 5, (0.15, 0.3)
"""Centres of zones along each angle, and widths of zones in the range of the angles."""

SPOTS, WIDTHS_OF_SPOTS = 12, (0.04, 0.1)
"""Places and widths of a bump along one angle, the widths in its range."""

LINES, AWAY, SHARP = 8, 5, 0.1
"""Directions of a line across the workspace, distances from its middle, and how sharp a jump is, in
half ranges of the angles."""

SLACKS = (0.05, 0.2, 0.5)
"""Slacks of play that are tried, in half ranges of the signal."""

SHARPNESS, BEATS = (4.0, 15.0), tuple(1.0 + n / 6.0 for n in range(37))
"""How sharp a pulse may be, 0.16 and 0.08 of a period long, and how often what is sharp may repeat
in a recording: in steps that move its last one hardly farther than its length."""

WHOLE_TURN = "6.2832"
"""2 pi, as a formula has it."""

RESTS = (0.01, 0.05, 0.2)
"""Speeds below which a motor may rest, in half ranges of the speed."""

LATE = 6
"""Time constants that are tried, from a second to half of the longest recording."""

EVERYWHERE = "poses all over the workspace"

LINEAR = ("a share", "a late follower", "a passing answer")
"""Sorts of law that answer to a vector whatever the axes that it is written in; so does a product
with another signal."""

VECTORS = (
    ("theta_dot_1", "theta_dot_2"),
    ("theta_1", "theta_2"),
    *(tuple(f"{on}{kind}{axis}" for axis in "xyz") for on in ("", "W_") for kind in "fm"),
)
"""Signals that are the parts of one vector: speeds and angles of both motors, forces, moments."""

USUAL_RANGES = {"K": 5.0, "N": 1.0, "N m": 0.03, "rad": 0.3, "rad/s": 1.0}
"""How much a signal usually changes, by its unit: a motor that warms up, what a cell's tool pushes,
the same at the distance of a bearing, a move and its speed (assumed).  A law has its usual size
there; what hardly changes does hardly anything."""


@dataclass(frozen=True)
class Span:
    """A number inside a form, with the values to try first.

    Parameters
    ----------
    grid : tuple of float
        Increasing.
    positive : bool
        Whether its logarithm is what is evenly spread.
    fixed : bool
        Whether only values of the grid are tried.
    """

    grid: Shape
    positive: bool = False
    fixed: bool = False


@dataclass(frozen=True, eq=False)
class Form:
    """How the size of an error may follow from signals.

    Parameters
    ----------
    kind : str
        Sort of law.
    of : tuple of str
        Signals.
    spans : tuple of Span
        Numbers inside it.
    write : callable
        shape -> formula for a size of 1, in the grammar of `model.formula`.
    tell : callable
        shape -> the same in words, after a size.
    needs : str
        What a recording must have to show it.
    usual : float
        Value of the formula at which the law has its usual size.
    parts : tuple of Form
        Of a vector the form of each of its signals, which act along directions of their own; what
        is written, told and needed is theirs.
    """

    kind: str
    of: tuple[str, ...]
    spans: tuple[Span, ...]
    write: Callable[[Shape], str]
    tell: Callable[[Shape], str]
    needs: str
    usual: float = 1.0
    parts: tuple[Form, ...] = ()

    @property
    def each(self) -> tuple[Form, ...]:
        """Itself, or those of the signals of a vector."""
        return self.parts or (self,)

    @property
    def shapes(self) -> list[Shape]:
        """All points of the grid."""
        return list(product(*(each.grid for each in self.spans)))

    @property
    def name(self) -> str:
        """Sort and signals, as a person reads them."""
        *others, last = self.of
        return f"{self.kind} of {', '.join(others)}{' and ' if others else ''}{last}"


def evaluated(text: str, signals: Sequence[Mapping[str, Array]]) -> list[Array]:
    """Return the values of a formula at the kept moments of each session."""
    found = []
    for own in signals:
        value = Formula(text, tuple(own))(own, Past(own["time"]))
        found.append(np.broadcast_to(value, own["time"].shape))
    return found


def number(value: float) -> str:
    """Return a number as it stands in a formula."""
    return f"{value:.4g}"


def _beyond(name: str, value: float, digits: Callable[[float], str] = number) -> str:
    return f"({name} {'-' if value >= 0.0 else '+'} {digits(abs(value))})"


def _moment(value: float) -> str:
    return f"{value:.2f}"


def unit_of(name: str) -> str:
    """Return the unit of a signal, `1` where its name does not say."""
    if name == "time":
        return "s"
    if name in ("theta_dot_1", "theta_dot_2"):
        return "rad/s"
    if "theta" in name or name in TURNS:
        return "rad"
    if (axis := name.removeprefix("W_")) in WRENCH:
        return "N" if axis[0] == "f" else "N m"
    if name.startswith((TEMPERATURE, f"({TEMPERATURE}")):
        return "K"
    return name.rpartition("_")[2] if "_" in name else "unit"


def forms(signals: Sequence[Mapping[str, Array]]) -> list[Form]:
    """Return the forms that recordings may show.

    Parameters
    ----------
    signals : sequence of dict of str to (k,) float
        Values at the kept moments of each session, `time` [s] among them.
    """
    pooled = {name: np.concatenate([own[name] for own in signals]) for name in signals[0]}
    length = max(float(np.ptp(own["time"])) for own in signals)
    late = Span(tuple(np.geomspace(1.0, max(0.5 * length, 4.0), LATE)), positive=True)
    moving = [name for name, own in pooled.items() if name != "time" and _moves(own)]
    motors = [name for name in moving if name in ("theta_1", "theta_2")]
    angles = [name for name in moving if name in (*motors, *TURNS)]
    warm = [name for name in moving if name.startswith(TEMPERATURE)]
    others = [name for name in moving if name not in (*angles, *warm)]
    found: list[Form] = [each for name in others for each in _of_signal(name, pooled[name], late)]
    found += [each for name in angles for each in _of_angle(name, pooled[name], late)]
    found += [each for name in warm for each in _of_warmth(name, pooled[name], late)]
    for pair in combinations(warm, 2):
        if _moves(apart := pooled[pair[0]] - pooled[pair[1]]):
            found += _of_warmth(f"({' - '.join(pair)})", apart, late)
    if {"theta_dot_1", "theta_dot_2"} <= set(moving):
        speeds = ("theta_dot_1", "theta_dot_2")
        found.append(_rest(speeds, max(_half_range(pooled[name]) for name in speeds)))
    if len(motors) == 2:
        one, two = (pooled[name] for name in motors)
        found += [_wave("(theta_1 - theta_2)", one - two), _wave("(theta_1 + theta_2)", one + two)]
        found += [_zone(one, two), *_across(one, two)]
    found += _of_time(pooled["time"], length) if length else []
    slow = [name for name in moving if "dot" not in name and name not in TURNS]
    found += [_together(*pair, pooled) for pair in combinations((*slow, "time"), 2)]
    vectors = [(kind, [{name} for name in vector]) for kind in LINEAR for vector in VECTORS]
    for by, vector in product((*warm, "time"), VECTORS):
        vectors.append(("a product", [{name, by} for name in vector]))
    for kind, signals_of in vectors:
        parts = tuple(each for each in found if each.kind == kind and set(each.of) in signals_of)
        if len(parts) > 1:
            # What all of them have in common comes last.
            names = dict.fromkeys(name for each in parts for name in each.of)
            common = set.intersection(*(set(each.of) for each in parts))
            of = tuple(sorted(names, key=common.__contains__))
            found.append(replace(parts[0], of=of, parts=parts))
    return found


def _moves(values: Array) -> bool:
    return bool(np.std(values) > 1e-6 * (np.abs(values).max() + 1e-300))


def _half_range(values: Array) -> float:
    low, high = np.percentile(values, (1.0, 99.0))
    return float(max(high - low, 1e-3 * np.ptp(values))) / 2.0


def _of_signal(name: str, values: Array, late: Span) -> list[Form]:
    unit, half, of, u = unit_of(name), _half_range(values), (name,), _usual(name, values)
    every = f"for every {unit} of {name}"
    slack = Span(tuple(half * each for each in SLACKS), positive=True)
    sizes = Span(tuple(half * each for each in (0.1, 0.3, 1.0)), positive=True)
    low, high = np.percentile(values, (5.0, 95.0))
    ends = Span(tuple(np.linspace(low, high, 7)[1:-1]))
    needs = f"{name} over its whole range, at one pose and load"
    in_turn = f"{name} raised and lowered in turn at one pose"
    slowly = f"{name} changed and then held for minutes"
    found = [
        Form("a share", of, (), lambda s: name, lambda s: every, needs, u),
        Form("a square", of, (), lambda s: f"{name} ** 2", lambda s: f"{every} squared", needs,
             u**2),
        Form("a saturating function", of, (sizes,), lambda s: f"tanh({name} / {number(s[0])})",
             lambda s: f"as {name} leaves 0, saturating from {number(s[0])} {unit} on", needs),
        Form("what lies beyond a limit", of, (ends,), lambda s: f"max({_beyond(name, s[0])}, 0)",
             lambda s: f"{every} above {number(s[0])}", needs, u),
        Form("a late follower", of, (late,), lambda s: f"lag({name}, {number(s[0])})",
             lambda s: f"{every}, {number(s[0])} s late", slowly, u),
    ]  # fmt: skip
    if "dot" not in name:
        # Nothing plays against a speed.
        found += [
            Form("play", of, (slack,), lambda s: f"play({name}, {number(s[0])})",
                 lambda s: f"{every}, with a slack of {number(s[0])} {unit} to both sides",
                 in_turn, u),
            Form("hysteresis", of, (slack,), lambda s: f"({name} - play({name}, {number(s[0])}))",
                 lambda s: f"{every} since it turned, {number(s[0])} {unit} at most", in_turn,
                 SLACKS[1] * half),
            Form("a passing answer", of, (late,),
                 lambda s: f"({name} - lag({name}, {number(s[0])}))",
                 lambda s: f"{every} when it changes, dying away in {number(s[0])} s", slowly, u),
        ]  # fmt: skip
    if values.min() < 0.0 < values.max():
        found.append(
            Form("the size", of, (), lambda s: f"abs({name})",
                 lambda s: f"{every} of either sign", needs, u)
        )  # fmt: skip
    if "dot" in name:
        found.append(_rest((name,), half))
        found.append(
            Form("warmth by motion", of, (late,), lambda s: f"lag({name} ** 2, {number(s[0])})",
                 lambda s: f"{every} squared, {number(s[0])} s late",
                 f"minutes of fast motion of motor {name[-1]}, then minutes of rest", u**2)
        )  # fmt: skip
    return found


def _rest(of: tuple[str, ...], half: float) -> Form:
    """Return what is there at rest alone: of a brake, of a controller, of air that stands."""
    slow = Span(tuple(half * each for each in RESTS), positive=True)
    squares = " + ".join(f"{name} ** 2" for name in of)
    who = "both motors" if len(of) > 1 else f"motor {of[0][-1]}"
    return Form(
        "a rest",
        of,
        (slow,),
        lambda s: f"exp(-({squares}) / {number(s[0] ** 2)})",
        lambda s: f"below {number(s[0])} rad/s of {who}",
        f"moves and rests of {who} in turn, at the same poses",
    )


def _usual(name: str, values: Array) -> float:
    """Return how much a signal usually changes; one of which nobody knows, as much as it did."""
    return USUAL_RANGES.get(unit_of(name), float(values.std()))


def _of_warmth(name: str, values: Array, late: Span) -> list[Form]:
    """Return the forms of a temperature, or of how much one part is warmer than another."""
    x, every, u = _zeroed(name, values), f"for every K of {name}", USUAL_RANGES["K"]
    slowly, of = f"{name} changed and then held for minutes", (name.strip("()"),)
    return [
        Form("a share", of, (), lambda s: x, lambda s: every, slowly, u),
        Form("a square", of, (), lambda s: f"{x} ** 2", lambda s: f"{every} squared", slowly, u**2),
        Form("a late follower", of, (late,), lambda s: f"lag({x}, {number(s[0])})",
             lambda s: f"{every}, {number(s[0])} s late", slowly, u),
    ]  # fmt: skip


def _zeroed(name: str, values: Array) -> str:
    """Return a signal as a formula has it; time and temperatures count from where they began."""
    if name == "time":
        return _beyond(name, float(values.min()), _moment)
    return _beyond(name, float(values[0])) if name.startswith(TEMPERATURE) else name


def _of_angle(name: str, values: Array, late: Span) -> list[Form]:
    half, motor = _half_range(values), TURNS.get(name, f"motor {name[-1]}")
    slack = Span(tuple(half * each for each in (0.01, 0.05, 0.2)), positive=True)
    return [
        _wave(name, values),
        _spot(name, values),
        Form("hysteresis", (name,), (slack,), lambda s: f"({name} - play({name}, {number(s[0])}))",
             lambda s: f"for every rad since {motor} turned back, {number(s[0])} rad at most",
             f"every pose from both sides of {motor}", slack.grid[1]),
        Form("a passing answer", (name,), (late,),
             lambda s: f"({name} - lag({name}, {number(s[0])}))",
             lambda s: f"for every rad that {motor} moved, dying away in {number(s[0])} s",
             f"dwells of minutes after moves of {motor}", USUAL_RANGES["rad"]),
    ]  # fmt: skip


def _wave(x: str, values: Array) -> Form:
    whole = 2.0 * _half_range(values)
    rates = Span(tuple(2.0 * np.pi * waves / whole for waves in WAVES))
    names = {"(theta_1 - theta_2)": "the difference of the motor angles"}
    names["(theta_1 + theta_2)"] = "the sum of the motor angles"
    told = names.get(x, f"the angle of {TURNS.get(x, f'motor {x[-1]}')}")
    return Form(
        "a wave",
        (x.strip("()"),),
        (rates, Span(PHASES)),
        lambda s: f"sin({number(s[0])} * {x} + {number(s[1])})",
        lambda s: f"as a wave of {number(360.0 / s[0])} deg in {told}",
        f"{told} in steps far below the wave",
    )


def _spot(name: str, values: Array) -> Form:
    """Return a bump at one place of an angle: of a tooth, a ball, a dent in a bore."""
    low, high = np.percentile(values, (5.0, 95.0))
    widths = tuple(2.0 * _half_range(values) * each for each in WIDTHS_OF_SPOTS)
    of = TURNS.get(name, f"motor {name[-1]}")
    return Form(
        "a spot",
        (name,),
        (Span(tuple(np.linspace(low, high, SPOTS))), Span(widths, positive=True)),
        lambda s: f"exp(-{_beyond(name, s[0])} ** 2 / {number(2.0 * s[1] ** 2)})",
        lambda s: f"near {np.rad2deg(s[0]):.1f} deg of {of}, {np.rad2deg(s[1]):.2g} deg wide",
        f"the angle of {of} in steps far below the width",
    )


def _zone(one: Array, two: Array) -> Form:
    spans = []
    for values in (one, two):
        low, high = np.percentile(values, (5.0, 95.0))
        spans.append(Span(tuple(np.linspace(low, high, CENTRES))))
    wide = 2.0 * max(_half_range(one), _half_range(two))
    spans.append(Span(tuple(wide * each for each in WIDTHS), positive=True))

    def write(s: Shape) -> str:
        square = f"{_beyond('theta_1', s[0])} ** 2 + {_beyond('theta_2', s[1])} ** 2"
        return f"exp(-({square}) / {number(2.0 * s[2] ** 2)})"

    def tell(s: Shape) -> str:
        at = ", ".join(f"{np.rad2deg(each):.1f}" for each in s[:2])
        return f"in a zone of poses near motor angles ({at}) deg, {np.rad2deg(s[2]):.2g} deg wide"

    return Form("a zone", ("theta_1", "theta_2"), tuple(spans), write, tell, EVERYWHERE)


def _across(one: Array, two: Array) -> list[Form]:
    """Return what begins, or is otherwise, beyond a line across the workspace: a stop, a switch."""
    middle = [float(np.mean(np.percentile(values, (1.0, 99.0)))) for values in (one, two)]
    half = max(_half_range(one), _half_range(two))
    ways = Span(tuple(np.arange(LINES) * 2.0 * np.pi / LINES))
    away = Span(tuple(half * np.linspace(-0.8, 0.8, AWAY)))

    def parts(s: Shape) -> tuple[float, float, float]:
        a, b = float(np.cos(s[0])), float(np.sin(s[0]))
        return a, b, a * middle[0] + b * middle[1] + s[1]

    def line(s: Shape) -> str:
        a, b, c = parts(s)
        return _beyond(f"{number(a)} * theta_1 + {number(b)} * theta_2", c)

    def where(s: Shape) -> str:
        a, b, c = parts(s)
        return f"{a:.2f} theta_1 {'-' if b < 0.0 else '+'} {abs(b):.2f} theta_2 is above {c:.3f}"

    of = ("theta_1", "theta_2")
    return [
        Form("what lies beyond a line", of, (ways, away), lambda s: f"max({line(s)}, 0)",
             lambda s: f"for every rad by which {where(s)} rad", EVERYWHERE, USUAL_RANGES["rad"]),
        Form("a jump", of, (ways, away), lambda s: f"tanh({line(s)} / {number(SHARP * half)})",
             lambda s: f"to either side of where {where(s)} rad", EVERYWHERE),
    ]  # fmt: skip


def _of_time(time: Array, length: float) -> list[Form]:
    first, of = float(time.min()), ("time",)
    since = _beyond("time", first, _moment)
    moments = Span(tuple(np.quantile(time, np.linspace(0.0, 1.0, MOMENTS + 2)[1:-1])), fixed=True)
    rates = Span(tuple(2.0 * np.pi * 0.5 * n / length for n in range(2, 41)))
    late = Span(tuple(np.geomspace(max(2.0, 0.02 * length), length, LATE)), positive=True)
    beats = Span(tuple(2.0 * np.pi * n / length for n in BEATS))
    turns = Span(tuple(np.pi * n / 3.0 for n in range(6)))
    again = "the same poses over and over, for as long as possible"

    def turn(s: Shape) -> str:
        return f"({number(s[0])} * {since} + {number(s[1])})"

    return [
        Form("a drift", of, (), lambda s: f"{since} / 3600", lambda s: "for every hour", again,
             float(time.std()) / 3600.0),
        Form("a step", of, (moments,),
             lambda s: f"0.5 * (1 + sign{_beyond('time', s[0], _moment)})",
             lambda s: f"since {s[0] - first:.0f} s after the start", again),
        Form("a wave", of, (rates, Span(PHASES)),
             lambda s: f"sin({number(s[0])} * {since} + {number(s[1])})",
             lambda s: f"as a wave of {number(2.0 * np.pi / s[0])} s in time", again),
        Form("a passing answer", of, (late,), lambda s: f"exp(-{since} / {number(s[0])})",
             lambda s: f"dying away in {number(s[0])} s from the start", again),
        Form("a pulse", of, (beats, turns, Span(SHARPNESS, positive=True)),
             lambda s: f"exp({number(s[2])} * (cos({turn(s)}) - 1))",
             lambda s: f"as a pulse of {number(2.0 / s[0] / np.sqrt(s[2]))} s every "
             f"{number(2.0 * np.pi / s[0])} s", again),
        Form("a saw-tooth", of, (beats, turns),
             lambda s: f"({turn(s)} / {WHOLE_TURN} - floor({turn(s)} / {WHOLE_TURN}))",
             lambda s: f"as a ramp that begins anew every {number(2.0 * np.pi / s[0])} s", again),
    ]  # fmt: skip


def _together(one: str, two: str, pooled: Mapping[str, Array]) -> Form:
    x, y = (_zeroed(name, pooled[name]) for name in (one, two))
    every = f"for every {unit_of(one)} of {one} and {unit_of(two)} of {two} together"
    needs = f"{one} and {two} changed one without the other"
    usual = _usual(one, pooled[one]) * _usual(two, pooled[two])
    return Form("a product", (one, two), (), lambda s: f"{x} * {y}", lambda s: every, needs, usual)
