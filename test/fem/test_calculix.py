"""The whole wrist against CalculiX, a solver that nobody here wrote."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
from whole_wrist.calculix import run_deck, write_deck
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import Disturbance, solve_pose

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.material import OrthotropicMaterial

AGREEMENT = 1e-4
"""CalculiX prints seven digits; own weight is integrated differently in curved elements."""

LOAD = np.array([1.0, -2.0, 1.5, 0.02, 0.01, -0.03])
GRAVITY = np.array([3.0, -2.0, -9.0])

needs_ccx = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="needs CalculiX: apt-get install calculix-ccx"
)


LAYERS = OrthotropicMaterial(
    young=(2.0e9, 9.0e9, 3.5e9),
    poisson=(0.1, 0.2, 0.4),
    shear=(0.9e9, 0.6e9, 1.7e9),
    density=1400.0,
    expansion=3e-5,
)


@pytest.fixture(scope="module", params=["rigid", "sliding", "layers"])
def model(make_wrist, coarse, request):
    wrist = make_wrist(gap=2e-6, skew=0.15)
    if request.param == "layers":
        wrist = replace(
            wrist,
            links={**wrist.links, "link_2": replace(wrist.links["link_2"], material=LAYERS)},
            bushings={key: replace(part, material=LAYERS) for key, part in wrist.bushings.items()},
        )
    pose = mechanism_of(wrist).forward([0.3, -0.2])
    return factor_pose(build_wrist(wrist, coarse, request.param == "sliding"), pose)


@needs_ccx
@pytest.mark.slow
@pytest.mark.parametrize("state", ["open", "in contact"])
def test_calculix_agrees(model, tmp_path, state):
    if state == "open":
        model = replace(model, gaps=np.full_like(model.gaps, 1.0))
    solution = solve_pose(model, LOAD, Disturbance(gravity=GRAVITY))
    closed = solution.forces > 0.0
    assert closed.any() == (state == "in contact")
    deck = tmp_path / "pose.inp"
    write_deck(model, deck, LOAD, GRAVITY, closed)
    twist = run_deck(deck)
    for half in (slice(0, 3), slice(3, 6)):
        miss = np.linalg.norm(twist[half] - solution.twist[half])
        assert miss < AGREEMENT * np.linalg.norm(solution.twist[half])


@needs_ccx
def test_a_failing_job_is_one_clear_line(tmp_path):
    deck = tmp_path / "broken.inp"
    deck.write_text("*NODE\n1,0.,0.,0.\n*STEP\n*STATIC\n*END STEP\n")
    with pytest.raises(InputError, match=r"broken\.(inp|dat)"):
        run_deck(deck)


def test_a_missing_solver_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="calculix-ccx"):
        run_deck(tmp_path / "pose.inp")


def test_calculix_can_read_the_deck(model, tmp_path):
    """It drops what follows the twentieth character of a number without a word.

    And it refuses a deck in which the first terms of two equations are one unknown.
    """
    other = mechanism_of(model.wrist.geometry).forward([-0.5, 0.4])
    for pose in (model, factor_pose(model.wrist, other)):
        deck = tmp_path / "pose.inp"
        write_deck(pose, deck, LOAD, GRAVITY, np.ones(len(pose.gaps), dtype=bool))
        lines = deck.read_text().splitlines()
        numbers = [line for line in lines if not line.startswith("*")]
        assert max(len(item) for line in numbers for item in line.split(",")) <= 20
        assert max(map(len, numbers)) <= 132
        assert math.isclose(float(numbers[0].split(",")[1]), pose.placed[0].nodes[0, 0] * 1e3)
        first = [
            tuple(lines[k + 2].split(",")[:2])
            for k, line in enumerate(lines)
            if line == "*EQUATION"
        ]
        assert len(first) > 100
        assert len(set(first)) == len(first)
