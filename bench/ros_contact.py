"""Correction in contact: `python bench/ros_contact.py [MODEL]`.

The tool moves into a one-sided spring and stays.  For every stiffness of the wall, every ratio of
assumed to true compliance and every delay of the load it is printed how much larger the contact
force becomes than without correction, where the load is judged and where it is followed.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.supervisor import State, SupervisorSettings
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.environment import EnvironmentSpring

STIFFNESS_N_UM = (0.0, 0.05, 0.2, 0.5, 2.0, 10.0)
RATIOS = (0.7, 1.0, 1.5)
DELAYS_S = (0.0, 0.1)
TOOL_MM = [0.0, 0.0, 60.0]
RATE_HZ = 50
SECONDS = 3.0
OVERLAP_DEG = 0.03
NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
SETTINGS = {"judge": SupervisorSettings(), "follow": SupervisorSettings(follow=True)}


def with_tool(table: Table, ratio: float) -> Table:
    """Return the wrist with a tool and its parts softer by a ratio."""
    geometry = dict(table.header.geometry)
    geometry["platform"] = {**geometry["platform"], "tool_point_mm": TOOL_MM}
    parts = replace(table.components, flexibility=ratio * table.components.flexibility)
    return replace(table, header=replace(table.header, geometry=geometry), components=parts)


class Contact:
    """One wrist that is driven into a wall."""

    def __init__(self, truth: Table, stiffness: float, delay_s: float) -> None:
        self.truth = truth
        self.tool = truth.geometry.platform.tool_point
        mechanism = truth.mechanism
        far, near = (mechanism.forward(np.array([0.0, a])).platform @ self.tool for a in (0, 0.01))
        normal = (far - near) / np.linalg.norm(far - near)
        self.wall = EnvironmentSpring(normal, float(normal @ far), stiffness)
        self.delay = round(delay_s * RATE_HZ)

    def forces(self, stream: CorrectionStream) -> tuple[float, bool]:
        """Return the largest force [N] and whether the corrector said that it is restricted."""
        start, end = np.radians([[0.0, -OVERLAP_DEG], [0.0, OVERLAP_DEG]])
        felt, sent, said = [np.zeros(6)] * (self.delay + 1), start, False
        for i in range(round(SECONDS * RATE_HZ)):
            at = self.truth.mechanism.forward(sent)
            felt.append(self.wall.wrench(self.truth, at, self.tool))
            stamp, load = SECOND + i * SECOND // RATE_HZ, felt[-1 - self.delay]
            stream.loads.add(stamp, "wrist_base", load[:3].tolist(), load[3:].tolist())
            desired = start + (end - start) * min(i / RATE_HZ, 1.0)
            sent = stream.on_command(stamp, "", NAMES, desired.tolist()).theta
            said |= stream.supervision.state is State.IN_CONTACT
        return max(float(np.linalg.norm(each[:3])) for each in felt), said


def main() -> None:
    """Print the grid."""
    path = sys.argv[1] if len(sys.argv) > 1 else shipped_file("config/palmieri2015_model.yaml")
    model = load_model(path)
    truth = with_tool(model.table, 1.0)
    print("K [N/um]  assumed/true  delay [s]  plain [N]   " + "  ".join(SETTINGS))
    for stiffness in STIFFNESS_N_UM:
        for ratio in RATIOS:
            assumed = replace(model, table=with_tool(model.table, ratio))
            for delay in DELAYS_S:
                contact = Contact(truth, 1e6 * stiffness, delay)
                plain, _ = contact.forces(CorrectionStream(assumed, StreamSettings(), False))
                cells = []
                for name, settings in SETTINGS.items():
                    stream = CorrectionStream(
                        assumed, StreamSettings(objective="tool_point", supervisor=settings), True
                    )
                    force, said = contact.forces(stream)
                    share = f"{force / plain:.2f}" if plain else "-"
                    cells.append(f"{share + (' says so' if said else ''):>{len(name)}}")
                print(
                    f"{stiffness:8.2f}  {ratio:12.1f}  {delay:9.1f}  {plain:9.3f}   "
                    + "  ".join(cells)
                )


if __name__ == "__main__":
    main()
