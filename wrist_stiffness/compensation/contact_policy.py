"""Correction in contact is feedback: what is done with a load that depends on the motion.

A payload does not change when the motors move; the force of a contact does, and a correction that
follows it closes a loop with the gain (assumed compliance) / (true compliance + 1/K_env).  What is
on when the correction is enabled is taken as payload and corrected in full.  A force that departs
from it by more than a threshold is a contact, and the policy says what of the departure is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import Load

PolicyName = Literal["freeze_in_contact", "gain", "load_lowpass"]
POLICIES: tuple[PolicyName, ...] = ("freeze_in_contact", "gain", "load_lowpass")

RELEASE = 0.5
"""A contact ends when the force departs by less than this part of the threshold ..."""

RELEASE_S = 0.5
"""... for this long [s]; else leaving and finding a contact could chatter."""


@dataclass(frozen=True)
class ContactSettings:
    """What is done with a load that depends on the motion.

    Parameters
    ----------
    policy : str
        In contact, `freeze_in_contact` uses the payload alone, `gain` adds a part of the
        departure, `load_lowpass` the same part of the slow departure.
    force : float
        Departure from the payload's force beyond which there is contact [N].
    gain : float
        Part of the departure that is used; at a loop gain L it raises a contact force by
        1/(1 - gain L), 0.1 by 1.2 at L = 1.5; 1 follows every load in full [-].
    lowpass_s : float
        Time constant of `load_lowpass` [s]; it calms the loop, but a steady loop gain stays.
    """

    policy: PolicyName = "freeze_in_contact"
    force: float = 0.2
    gain: float = 0.1
    lowpass_s: float = 2.0


class ContactGuard:
    """Follows the load of one corrector.

    Attributes
    ----------
    in_contact : bool
        Whether the load departs from the payload.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Take the next load as payload."""
        self.in_contact = False
        self._payload: Load | None = None
        self._slow: Array = np.zeros(6)
        self._stamp_ns = self._touched_ns = 0

    def load(self, stamp_ns: int, load: Load, settings: ContactSettings) -> Load:
        """Return the load to correct for.

        Parameters
        ----------
        stamp_ns : int
            Of the command [ns].
        load : Load
            Measured.
        settings : ContactSettings
            Policy and threshold.

        Returns
        -------
        Load
            The measured one where there is no contact.

        Raises
        ------
        InputError
            If it came in another frame than the payload.
        """
        if self._payload is None:
            self._payload, self._stamp_ns = load, stamp_ns
        if self._payload.on_platform != load.on_platform:
            raise InputError("load: comes in another frame than when the correction was enabled")
        departure = load.wrench - self._payload.wrench
        self._find_contact(stamp_ns, float(np.linalg.norm(departure[:3])), settings.force)
        seconds = max(stamp_ns - self._stamp_ns, 0) / NANOSECONDS
        self._stamp_ns = stamp_ns
        self._slow += (departure - self._slow) * -np.expm1(-seconds / settings.lowpass_s)
        if not self.in_contact:
            return load
        used = {
            "freeze_in_contact": np.zeros(6),
            "gain": settings.gain * departure,
            "load_lowpass": settings.gain * self._slow,
        }[settings.policy]
        return Load(self._payload.wrench + used, load.on_platform)

    def _find_contact(self, stamp_ns: int, departure: float, threshold: float) -> None:
        if departure > threshold:
            self.in_contact, self._touched_ns = True, stamp_ns
        elif departure > RELEASE * threshold:
            self._touched_ns = stamp_ns
        elif not 0 <= stamp_ns - self._touched_ns < RELEASE_S * NANOSECONDS:
            self.in_contact = False
