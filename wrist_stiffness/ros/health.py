"""What a node says about itself once a second in `/diagnostics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from wrist_stiffness.errors import WristError


class Health:
    """Counts of good samples and of faults by reason."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._good = self._good_before = 0
        self._faults: Counter[str] = Counter()
        self._faults_before = 0
        self._newest = ""
        self._last: dict[str, str] = {}
        self._fresh: dict[str, str] = {}

    @property
    def faults(self) -> int:
        """How many samples were refused since the start."""
        return self._faults.total()

    def good(self) -> None:
        """Count a sample that went well."""
        self._good += 1

    def fault(self, error: Exception) -> None:
        """Count a fault by the kind of error."""
        kind = type(error).__name__
        self._faults[kind] += 1
        # By kind: a load that is refused is soon followed by many samples without a load.
        text = str(error) if isinstance(error, WristError) else repr(error)
        self._last[kind] = self._fresh[kind] = self._newest = text

    def report(self, facts: Mapping[str, str], missing: str, restriction: str) -> DiagnosticStatus:
        """Return the state since the last report.

        `facts`: what else to say.  `missing`: what the node cannot work without, where that is
        missing: an error.  `restriction`: what keeps it from its full work, a warning; empty for
        nothing.  Gives `DiagnosticStatus`: ERROR where something is missing, WARN where samples
        were refused or work is restricted, STALE where none came, else OK.
        """
        good = self._good - self._good_before
        faults = self.faults - self._faults_before
        self._good_before, self._faults_before = self._good, self.faults
        said, self._fresh = list(self._fresh.values()), {}
        if missing:
            level, message = DiagnosticStatus.ERROR, missing
        elif faults:
            level, message = DiagnosticStatus.WARN, f"{faults} refused: {'; '.join(said)}"
        elif restriction:
            level, message = DiagnosticStatus.WARN, restriction
        elif not good:
            level, message = DiagnosticStatus.STALE, "no input"
        else:
            level, message = DiagnosticStatus.OK, f"{good} samples"
        values = {
            "samples": str(self._good),
            **{f"refused {reason}": str(count) for reason, count in sorted(self._faults.items())},
            "last fault": self._newest,
            **{f"last {reason}": text for reason, text in sorted(self._last.items())},
            **facts,
        }
        return DiagnosticStatus(
            level=level,
            name=self._name,
            message=message,
            hardware_id="wrist",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
