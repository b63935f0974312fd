"""The made-up arm of the benchmark, and small tables."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from wrist_stiffness.inference import Observations


@pytest.fixture(scope="session")
def arm() -> ModuleType:
    path = Path(__file__).parents[2] / "bench" / "diagnosis_arm.py"
    spec = importlib.util.spec_from_file_location("diagnosis_arm", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20150601)


def plain_table(rng: np.random.Generator, n: int = 60, m: int = 2, **more) -> Observations:
    """White unit noise over two random conditions."""
    conditions = {"x": rng.uniform(-1, 1, n), "z": rng.uniform(-1, 1, n)}
    return Observations(rng.normal(size=(n, m)), conditions, **more)


@pytest.fixture
def table(rng: np.random.Generator) -> Observations:
    return plain_table(rng)
