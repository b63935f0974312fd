"""The integrator's document says what the nodes do."""

import re
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.compensation.correction import correct
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.parameters import COMMON, CORRECTION, MONITOR, PREDICTION
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.ros.recorder import TOPICS

TEXT = (Path(__file__).parents[2] / "docs/integration.md").read_text(encoding="utf-8")
LAST_DIGIT = 0.02  # um or mdeg; the document has two digits


ENTRIES = {entry.name: entry for entry in (*COMMON, *PREDICTION, *CORRECTION, *MONITOR)}
ROWS = re.findall(r"^\| `(\w+)` \| `(.*?)` \| (.*?) ?\|(.*)\|$", TEXT, re.MULTILINE)


@pytest.mark.parametrize(("name", "shown", "limits", "text"), ROWS, ids=lambda text: text[:20])
def test_a_parameter_on_the_page_is_that_of_the_nodes(name, shown, limits, text):
    entry = ENTRIES[name]
    default = str(entry.default).lower() if isinstance(entry.default, bool) else entry.default
    assert shown == (str(default) or "empty")
    for choice in entry.choices:
        assert choice in limits
    if isinstance(entry.default, int | float) and not isinstance(entry.default, bool):
        least, largest = entry.limits
        assert limits == f"{least:g} … {largest:g}"
    assert ("(at the start only)" in text) is entry.fixed


def test_parameters_are_found_on_the_page():
    assert len(ROWS) > 10


@pytest.mark.parametrize(
    "name", sorted(set(re.findall(r"`([a-z]+_[a-z_]+_(?:deg|n|nm|s|hz))`", TEXT)))
)
def test_a_parameter_named_in_the_text_exists(name):
    assert name in ENTRIES


@pytest.mark.parametrize(
    "topic", [name for name in TOPICS if name.startswith(("/pose_error", "/motor", "/model"))]
)
def test_every_topic_is_described(topic):
    assert f"`{topic}`" in TEXT


def numbers(line):
    row = next(row for row in TEXT.splitlines() if row.startswith(line))
    return [float(number) for number in re.findall(r"-?\d+\.\d+", row.replace("−", "-"))]


def test_the_worked_case_is_what_the_shipped_model_gives(model):
    platform = model.table.geometry.platform
    objective = Objective("pointing", platform.normal, platform.tool_point)
    load = Load(np.array([0.0, 0.0, -3.0, 0.0, 0.0, 0.0]))
    found = correct(
        lambda theta: model.predict(theta, load),
        model.table.workspace,
        np.radians([20.0, -10.0]),
        objective,
    )
    before = model.predict(np.radians([20.0, -10.0]), load).twist
    for line, twist in (("| before", before), ("| after", found.after)):
        wanted = [*(1e6 * twist[:3]), *(1e3 * np.degrees(twist[3:]))]
        assert numbers(line) == pytest.approx(wanted, abs=LAST_DIGIT)
    delta = numbers("The motors turn by")[:2]
    assert delta == pytest.approx(1e3 * np.degrees(found.delta), abs=LAST_DIGIT)
