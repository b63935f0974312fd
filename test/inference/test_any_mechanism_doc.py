"""The documented example runs as it is printed, on a lever with known faults."""

import re
from pathlib import Path

import numpy as np
import pytest

DOC = Path(__file__).parents[2] / "docs" / "diagnose-any-mechanism.md"
BENDING_UM_PER_N, BACKLASH_UM, NOISE_UM = 0.4, 6.0, 1.0


def write_lever(path, rng, n=160):
    """Bending and backlash on two days, the gauge zero anew on each; every fourth row returns."""
    angle, load = rng.uniform(-60, 60, n), rng.choice([0.0, 5.0, 10.0], n)
    approach, again = rng.choice([-1, 1], n), np.full(n, -1)
    day = np.repeat([0, 1], [120, 40])
    for row in range(6, n, 4):
        origin = row - 5
        if day[origin] == day[row]:
            again[[origin, row]] = row
            for column in (angle, load, approach):
                column[row] = column[origin]
    tip = BENDING_UM_PER_N * load * np.cos(np.radians(angle)) - BACKLASH_UM * approach / 2
    tip += np.where(day == 0, 130.0, -75.0) + rng.normal(0, NOISE_UM, n)
    columns = (30.0 * np.arange(n), angle, load, approach, day, again, tip)
    header = "time_s,angle_deg,load_N,approach,day,again,tip_um"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")


@pytest.fixture
def example():
    (block,) = re.findall(r"```python\n(.*?)```", DOC.read_text(), re.DOTALL)
    return block


def test_the_example_names_both_faults_with_their_sizes(example, rng, tmp_path, monkeypatch):
    write_lever(tmp_path / "lever.csv", rng)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(example, str(DOC), "exec"), names)
    result = names["result"]
    assert result.verdict == "effect"
    assert {f.names for f in result.findings} == {("backlash@gear",), ("bending@lever",)}
    truth = {"width_m": BACKLASH_UM * 1e-6, "m_per_N": BENDING_UM_PER_N * 1e-6}
    for finding in result.findings:
        for name, (value, error) in finding.parameters.items():
            assert abs(value - truth[name]) < 4 * error
            assert error < 0.1 * truth[name]
    assert result.after["tip_um"] < 1.4 * NOISE_UM < result.before["tip_um"]
    assert result.noise["tip_um"] == pytest.approx(NOISE_UM, rel=0.4)
    for day in (slice(0, 120), slice(120, 160)):
        assert np.sqrt(np.mean(names["corrected"][day] ** 2)) < 1.3e-6 * NOISE_UM


def test_the_example_stays_short(example):
    code = [line for line in example.splitlines() if line.strip()]
    assert len(code) <= 36
