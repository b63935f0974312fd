"""The load to correct for: what the supervisor makes of the measured one."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.supervisor import Supervisor
from wrist_stiffness.errors import LoadRangeError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Load


def judged_load(
    supervisor: Supervisor,
    settings: StreamSettings,
    table: Table,
    stamp_ns: int,
    theta: Array,
    measured: Load,
) -> Load:
    """Return the load to correct for at a command's motor angles (2,) [rad].

    Raises `WristError` if the angles or the measured load are beyond the table.
    """
    if settings.supervisor.follow:
        supervisor.follow(stamp_ns, measured)
        return measured
    try:
        reading = supervisor.scales(table.geometry).read(table, theta, measured)
    except LoadRangeError:
        supervisor.overloaded(stamp_ns, theta.tolist())
        raise
    judged = supervisor.judge(
        stamp_ns, theta.tolist(), reading, settings.supervisor, settings.correction_limit
    )
    return Load(np.zeros(6) if judged is None else np.array(judged))
