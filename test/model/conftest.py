"""Models of the shipped wrist with chosen effects, with and without flanges; a lively recording."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law

SIGNALS = ("ambient", "link_1", "joint_3", "motor_1", "motor_2")


def make_effect(name, **values):
    """Return `law@component` with values, each a number or (value, sigma)."""
    law, component = name.split("@")
    estimates = {
        key: Estimate(*value) if isinstance(value, tuple) else Estimate(value)
        for key, value in values.items()
    }
    return Effect(find_law(law), component, estimates)


def make_block(n=60, seed=0, **changes):
    """Return motion on both axes with reversals and rests, a changing load, temperatures."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.005, 0.05, n))
    phase = np.where(time % 1.0 < 0.7, time, np.floor(time) + 0.7)
    theta = np.radians(25.0) * np.stack([np.sin(4.0 * phase), np.cos(5.0 * phase)], axis=1)
    load = np.stack(
        [np.sin(3 * time), np.cos(2 * time), np.sin(7 * time), *np.zeros((3, n))], axis=1
    )
    load[:, 3:] = 0.01 * np.stack([np.cos(time), np.sin(5 * time), np.cos(3 * time)], axis=1)
    temperatures = {name: 20.0 + 8.0 * np.sin(time + i) for i, name in enumerate(SIGNALS)}
    values = {"time": time, "theta": theta, "load": load, "temperatures": temperatures, **changes}
    return Block(**values)


def rest_at(theta_deg, wrench, n=1, **changes):
    """Return n samples a second apart at one pose under one load."""
    load = np.array([*wrench, *[0.0] * (6 - len(wrench))])
    theta = np.tile(np.radians(theta_deg), (n, 1))
    return Block(np.arange(n, dtype=float), theta, np.tile(load, (n, 1)), **changes)


def compose(*motions):
    """Return the product of (rotation, shift) pairs."""
    rotation, shift = np.eye(3), np.zeros(3)
    for turn, move in motions:
        rotation, shift = rotation @ turn, shift + rotation @ move
    return rotation, shift


def added(model, effect, block):
    """Return what one effect adds to the platform's twist, (n, 6)."""
    return model.with_effects(effect).batch(block).twist - model.batch(block).twist


def motion(axis, turn, slide=0.0):
    """Return the motion of a cylindrical joint through O."""
    return exp_twist(np.concatenate([slide * axis, turn * axis]))


@pytest.fixture(scope="session")
def make():
    """Functions that tests of models share."""
    return SimpleNamespace(
        effect=make_effect,
        block=make_block,
        rest=rest_at,
        added=added,
        compose=compose,
        motion=motion,
    )


@pytest.fixture(scope="session")
def free_model(model):
    """The same wrist without flanges: its slides are free."""
    parts = replace(model.table.components, contact={})
    return replace(model, table=replace(model.table, components=parts))


@pytest.fixture(scope="session")
def weightless(free_model):
    """The same without flanges and without gravity."""
    table = free_model.table
    values = {**table.header.geometry}
    values["site"] = {**values["site"], "gravity_m_s2": [0.0, 0.0, 0.0]}
    return replace(free_model, table=replace(table, header=replace(table.header, geometry=values)))
