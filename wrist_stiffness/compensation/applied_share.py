"""Which part of a correction is applied: it comes in slowly, and goes where it does harm."""

from __future__ import annotations

from wrist_stiffness.compensation.payload import Row

RAMP_S = 1.0
"""A correction comes in over this time, and goes where nobody knows what is carried [s]."""

YIELD_S = 0.1
"""A correction that a contact works against is gone after this time, in which the default
slew limit takes back 50 mdeg [s]."""


class AppliedShare:
    """Part of a correction that is applied.

    While the moment of a contact works against the correction's turn, the part falls towards none.
    It comes back when the command has left that place, never before, so that nothing can oscillate.
    """

    def __init__(self) -> None:
        self.value = 1.0  # [-]
        # whether it is known what is carried; where it is not, the correction fades
        self.sure = False
        # (3,), moment of a contact, along u, v and down; None where there is none [N m]
        self.against: Row | None = None
        self.place: list[float] | None = None  # (2,), command at which the correction yielded [rad]

    @property
    def settled(self) -> bool:
        """Whether all is applied whatever the correction, and goes on to be."""
        return self.against is None and self.sure and self.value == 1.0

    def leave(self, theta: list[float], reach: float) -> None:
        """Hear of a command (2,) [rad]; one farther than `reach` [rad] has left the place."""
        if self.place is not None and apart(theta, self.place) > reach:
            self.place = None

    def after(self, seconds: float, turn: Row) -> float:
        """Let time [s] pass with a correction that turns the platform by (3,), along u, v, down."""
        if self.against is not None and _dot(self.against, turn) < 0.0:
            self.value = max(0.0, self.value - seconds / YIELD_S)
        elif not self.sure:
            self.value = max(0.0, self.value - seconds / RAMP_S)
        elif self.against is None and self.place is None:
            self.value = min(1.0, self.value + seconds / RAMP_S)
        return self.value


def apart(theta: list[float], other: list[float]) -> float:
    """Return how far two commands (2,) are apart, the larger of both motors [rad]."""
    return max(abs(theta[0] - other[0]), abs(theta[1] - other[1]))


def _dot(a: Row, b: Row) -> float:
    # Not `sum`, which rounds otherwise from Python 3.12 on.
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
