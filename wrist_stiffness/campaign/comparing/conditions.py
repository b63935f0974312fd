"""The conditions of a campaign as columns over its units, with the words for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.observations import Labels
from wrist_stiffness.mechanism.components import Array

FEWEST = 4
"""A condition varies if so many units differ from the commonest value."""

DECIMALS = 6
"""Of a condition's largest value to which its values are told apart: the rest is rounding."""

UNLOADED = 0.02
"""Share of the largest load up to which a unit counts as unloaded."""

LAGS_S = (300.0, 900.0)
"""Time constants with which a temperature may be felt late."""

OF_MOTORS = tuple(f"{name}_{motor}" for name in ("theta", "approach", "speed") for motor in (1, 2))
OWN = ("time_s", "held_s", "loaded_at_rest", "force", "moment", *OF_MOTORS)
FORCES, MOMENTS = ("fx", "fy", "fz"), ("mx", "my", "mz")


@dataclass(frozen=True, eq=False)
class Condition:
    """Something that the residual may depend on.

    Parameters
    ----------
    topic : str
        For a list of topics, as `approach direction`.
    name : str
        One word for this condition among those of the topic.
    lead : str
        First half of a sentence: what changes by one.
    columns : (n, q) float
        Over the units.
    subject : str
        What changes: the platform itself, or a gap or give that grows.
    swings : bool
        Whether the columns belong to a wave, of which only the part that was seen is told.
    axis : str
        What a picture shows it against, with unit.
    along : (n,) float, optional
        Its values; the first column where None.
    factor : (n,) float, optional
        What the columns are a wave times of: as slow as this is what they tell.
    """

    topic: str
    name: str
    lead: str
    columns: Array
    subject: str = "the platform"
    swings: bool = False
    axis: str = ""
    along: Array | None = None
    factor: Array | None = None


def conditions(observations: Observations) -> tuple[tuple[Condition, ...], tuple[str, ...]]:
    """List the conditions that vary, and the topics of which none does.

    Parameters
    ----------
    observations : Observations
        With the covariates of `observing.observe`.

    Returns
    -------
    tuple of Condition
        Those that vary.
    tuple of str
        Topics of which nothing can be said.
    """
    every = list(_every(observations.covariates, observations.sessions))
    varied = tuple(each for each in every if _varies(each.columns, observations.sessions))
    topics = {each.topic for each in varied}
    silent = dict.fromkeys(each.topic for each in every if each.topic not in topics)
    return varied, tuple(silent)


def _varies(columns: Array, sessions: Labels) -> bool:
    """Tell whether enough units differ from the rest of their session in every column."""
    for column in columns.T:
        size = np.abs(column).max()
        different = 0
        for session in np.unique(sessions):
            own = np.round(column[sessions == session] / (size or 1.0), DECIMALS)
            different += len(own) - np.unique(own, return_counts=True)[1].max()
        if different < FEWEST:
            return False
    return True


def _difference(column: Array, other: Array | np.floating) -> Array:
    """Return values (n,) minus others; zero where only rounding makes a difference."""
    left = column - other
    return np.where(np.abs(left) > 10.0**-DECIMALS * np.abs(column).max(), left, 0.0)


def _every(covariates: Mapping[str, Array], sessions: Labels) -> Iterator[Condition]:
    yield from _approaches(covariates)
    yield from _loads(covariates)
    at_rest = covariates["loaded_at_rest"] - 0.5
    loaded = covariates["force"] > UNLOADED * covariates["force"].max()
    yield Condition(
        "load put on at rest or carried",
        "loaded at rest",
        "When the load is put on at rest rather than carried through the move",
        (at_rest * loaded)[:, None],
        axis="carried (-0.5), unloaded (0), loaded at rest (0.5)",
    )
    yield Condition(
        "hold time",
        "hold time",
        "For every tenfold of the time that pose and load have been held",
        np.log10(np.maximum(covariates["held_s"], 0.1))[:, None],
        axis="log10 of the time held [s]",
    )
    yield from _motions(covariates)
    yield from _temperatures(covariates, sessions)
    yield Condition(
        "time in the session",
        "time",
        "For every minute of a session",
        (covariates["time_s"] - covariates["time_s"].min())[:, None] / 60.0,
        axis="time [min]",
    )
    for name, column in covariates.items():
        if name not in (*OWN, *FORCES, *MOMENTS) and not name.startswith("T_"):
            yield _other(name, column)


def _approaches(covariates: Mapping[str, Array]) -> Iterator[Condition]:
    force = covariates["force"]
    for motor in (1, 2):
        sense = 0.5 * covariates[f"approach_{motor}"]
        yield Condition(
            "approach direction",
            f"approach of motor {motor}",
            f"When motor {motor} is approached with rising rather than falling angle",
            sense[:, None],
            axis=f"approach of motor {motor} (-0.5 falling, 0.5 rising)",
        )
        yield Condition(
            "approach direction",
            f"approach of motor {motor} with load",
            "For every newton more of load",
            (sense * _difference(force, force.mean()))[:, None],
            f"the gap between both approaches of motor {motor}",
            axis=f"approach of motor {motor} x load above its mean [N]",
        )


def _loads(covariates: Mapping[str, Array]) -> Iterator[Condition]:
    force, moment = covariates["force"], covariates["moment"]
    for name in FORCES:
        yield Condition(
            "load direction",
            f"force along {name[1]}",
            f"For every newton of load along +{name[1]}",
            covariates[name][:, None],
            axis=f"{name} [N]",
        )
    for name in MOMENTS:
        yield Condition(
            "load direction",
            f"moment about {name[1]}",
            f"For every 0.01 N m of load about +{name[1]}",
            100.0 * covariates[name][:, None],
            axis=f"{name} [0.01 N m]",
        )
    for name in FORCES:
        yield Condition(
            "load size",
            f"give along {name[1]} with load",
            "For every newton more of load",
            (covariates[name] * _difference(force, force.mean()))[:, None],
            f"the give per newton along {name[1]}",
            axis=f"{name} x load above its mean [N^2]",
        )
    yield Condition(
        "load size",
        "size of the force",
        "For every newton of load, whatever its direction",
        force[:, None],
        axis="size of the force [N]",
    )
    yield Condition(
        "load size",
        "size of the moment",
        "For every 0.01 N m of load, whatever its direction",
        100.0 * moment[:, None],
        axis="size of the moment [0.01 N m]",
    )
    loaded = (force > UNLOADED * force.max()) | (moment > UNLOADED * moment.max())
    yield Condition(
        "zero load",
        "zero load",
        "Without any load",
        (~loaded).astype(float)[:, None],
        axis="loaded (0) or not (1)",
    )


def _motions(covariates: Mapping[str, Array]) -> Iterator[Condition]:
    for motor in (1, 2):
        speed = np.degrees(covariates[f"speed_{motor}"])
        lead = f"For every degree per second of motor {motor}"
        axis = f"speed of motor {motor} [deg/s]"
        yield Condition("speed", f"speed of motor {motor}", lead, speed[:, None], axis=axis)
        yield Condition(
            "speed",
            f"speed of motor {motor} either way",
            f"{lead}, either way",
            np.abs(speed)[:, None],
            axis=axis,
        )
    for motor in (1, 2):
        theta = covariates[f"theta_{motor}"]
        for order, times in ((1, "once"), (2, "twice"), (4, "four times")):
            yield Condition(
                "motor angle",
                f"angle of motor {motor}, {times} a turn",
                f"With the angle of motor {motor}, like a wave {times} a turn",
                np.stack([np.cos(order * theta), np.sin(order * theta)], axis=1),
                swings=True,
                axis=f"angle of motor {motor} [deg]",
                along=np.degrees(theta),
            )


def _temperatures(covariates: Mapping[str, Array], sessions: Labels) -> Iterator[Condition]:
    found = False
    time = covariates["time_s"]
    longest = max(float(np.ptp(time[sessions == session])) for session in np.unique(sessions))
    for name, column in covariates.items():
        if not name.startswith("T_"):
            continue
        found = True
        place = name[2:].replace("_", " ")
        axis = f"temperature of {place} [degC]"
        yield Condition(
            "temperature",
            f"temperature of {place}",
            f"For every kelvin that {place} is warmer",
            column[:, None],
            axis=axis,
        )
        for motor in (1, 2):
            theta = covariates[f"theta_{motor}"]
            turned = np.stack([np.cos(theta), np.sin(theta)], axis=1)
            yield Condition(
                "temperature",
                f"temperature of {place} with the angle of motor {motor}",
                f"With the temperature of {place} and the angle of motor {motor} together",
                _difference(column, column.mean())[:, None] * (turned - turned.mean(axis=0)),
                swings=True,
                axis=axis,
                along=column,
                factor=column,
            )
        # In a shorter session the lag of a thermometer's step is a drift and nothing else.
        for lag in (lag for lag in LAGS_S if lag <= longest):
            late = _lagged(column, time, sessions, lag)
            minutes = f"{lag / 60.0:g} min"
            yield Condition(
                "temperature lag",
                f"temperature of {place}, {minutes} late",
                f"For every kelvin that {place} was warmer, felt about {minutes} late",
                # What the temperature itself tells is not asked twice.
                _difference(late, column)[:, None],
                axis=f"lagged minus present temperature of {place} [K]",
            )
    if not found:
        yield Condition("temperature", "none", "", np.zeros((len(sessions), 1)))


def _lagged(column: Array, time: Array, sessions: Labels, lag: float) -> Array:
    """First-order lag of a signal, (n,), beginning each session in balance."""
    late = column.copy()
    for i in range(1, len(column)):
        if sessions[i] == sessions[i - 1]:
            keep = np.exp(-(time[i] - time[i - 1]) / lag)
            late[i] = keep * late[i - 1] + (1.0 - keep) * column[i]
    return late


def _other(name: str, column: Array) -> Condition:
    values = np.unique(column)
    if len(values) == 2:
        return Condition(
            name,
            name,
            f"With {name} at {values[1]:g} rather than {values[0]:g}",
            (column == values[1]).astype(float)[:, None],
            axis=name,
            along=column,
        )
    return Condition(name, name, f"For every unit more of {name}", column[:, None], axis=name)
