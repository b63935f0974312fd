"""The answer to the question which physical effect is missing, as it is told and written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from wrist_stiffness.inference.search import Ended

SCHEMA = 2

CHANCE = 1.0
"""Gain of log evidence below which a candidate explains no more than chance would (assumed)."""

Verdict = Literal["effect", "none", "undecided", "unknown"]


@dataclass(frozen=True)
class Standing:
    """How a candidate stands.

    Parameters
    ----------
    name : str
        `effect@component`.
    probability : float or None
        That it is missing in the model; None where the search ended before it was fitted.
    log_gain : float
        Gain of log evidence by the best set with it over the nominal model; to first order where no
        set with it was worth a fit.
    fitted : bool
        Whether one was.
    why_not : str
        Why it is not named; empty where it is.
    """

    name: str
    probability: float | None
    log_gain: float
    fitted: bool
    why_not: str


@dataclass(frozen=True)
class Finding:
    """One effect that is missing, or a class of effects that these data cannot tell apart.

    Parameters
    ----------
    members : tuple of (str, str, float)
        Effect, component and probability to be the one, most probable first.
    probability : float
        That one of them is missing.
    parameters : dict
        Estimate and one standard uncertainty of the most probable member, by name.
    log_gain : float
        Natural logarithm of the evidence with it over that without it.
    explains : float
        Share of the error above the noise that it explains.
    buys : dict
        Fall of the held-out error and its standard uncertainty, by quantity and unit.
    compensable, evidence, check : str
        For the technician.
    gives : dict
        In which ways its law gives, `asymmetry` or `growth`, with one standard uncertainty.
    """

    members: tuple[tuple[str, str, float], ...]
    probability: float
    parameters: Mapping[str, tuple[float, float]]
    log_gain: float
    explains: float
    buys: Mapping[str, tuple[float, float]]
    compensable: str
    evidence: str
    check: str
    gives: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Most probable member as ``effect@component``."""
        return self.names[0]

    @property
    def names(self) -> tuple[str, ...]:
        """All members as ``effect@component``."""
        return tuple(f"{effect}@{component}" for effect, component, _ in self.members)


@dataclass(frozen=True)
class NotExcited:
    """A candidate that these data could not have shown.

    Parameters
    ----------
    effect, component : str
        Which.
    needs : str
        What to record.
    """

    effect: str
    component: str
    needs: str


@dataclass(frozen=True)
class Diagnosis:
    """Answer to the question which physical effect is missing.

    Parameters
    ----------
    verdict : str
        ``effect``, ``none``, ``undecided`` or ``unknown``.
    probability : float
        Of the verdict.
    noise : dict
        Scatter of one unit as instrument and dwells tell it, root mean square by quantity and unit.
    discrepancy : dict
        What the model with the findings leaves above that noise, likewise.
    before, after : dict
        Error on the held-out units, without and with the findings, likewise.
    findings : tuple of Finding
        The surest first.
    suspects : tuple of Finding
        What is not sure enough to be named.
    depends_on : dict of str to float
        On what that which is left depends, with its share.
    unexplained : float
        Share of the error above the noise that no finding explains.
    standings : tuple of Standing
        Every candidate, most probable first.
    not_excited : tuple of NotExcited
        What these data cannot tell.
    absorbed : tuple of str
        What calibration took up, largest first.
    scope : str
        What the held-out units are.
    ended : str
        What ended the search before every candidate worth a fit was fitted: "the time was over", or
        "the limit of fits was reached"; empty where nothing did.
    held_out_noise : dict
        Scatter of one held-out unit, as `noise`, where these are of another session.
    unforeseen : dict
        Error on these units, in times noise and drift, where what explains all others leaves much.
    contradicted : dict
        Likewise, what then a fit to all leaves there; empty where that explains them.
    noise_known : bool
        Whether the noise is stated or shown by readings that repeat; else it is at most so large.
    """

    verdict: Verdict
    probability: float
    noise: Mapping[str, float]
    discrepancy: Mapping[str, float]
    before: Mapping[str, float]
    after: Mapping[str, float]
    findings: tuple[Finding, ...]
    suspects: tuple[Finding, ...]
    depends_on: Mapping[str, float]
    unexplained: float
    standings: tuple[Standing, ...]
    not_excited: tuple[NotExcited, ...]
    absorbed: tuple[str, ...] = ()
    scope: str = ""
    ended: Ended = ""
    held_out_noise: Mapping[str, float] = field(default_factory=dict)
    unforeseen: Mapping[str, float] = field(default_factory=dict)
    contradicted: Mapping[str, float] = field(default_factory=dict)
    noise_known: bool = True

    @property
    def noise_of_judge(self) -> Mapping[str, float]:
        """Scatter of one of the units that judge."""
        return self.held_out_noise or self.noise

    @property
    def complete(self) -> bool:
        """Whether every candidate worth a fit was fitted; else more may change the answer."""
        return not self.ended

    @property
    def promising(self) -> tuple[Standing, ...]:
        """Candidates that were not fitted, though to first order they explain something."""
        left = [each for each in self.standings if not each.fitted and each.log_gain >= CHANCE]
        return tuple(sorted(left, key=lambda each: -each.log_gain))

    def as_json(self, ranking: bool = False) -> dict[str, Any]:
        """Return plain containers for `json.dump`.

        Parameters
        ----------
        ranking : bool
            Whether every candidate is told.
        """
        found: dict[str, Any] = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "complete": self.complete,
            "ended": self.ended,
            "probability": self.probability,
            "scope": self.scope,
            "unforeseen": dict(self.unforeseen),
            "contradicted": dict(self.contradicted),
            "noise": dict(self.noise),
            "held_out_noise": dict(self.held_out_noise),
            "noise_known": self.noise_known,
            "discrepancy": dict(self.discrepancy),
            "before": {f"rms_{key}": value for key, value in self.before.items()},
            "after": {f"rms_{key}": value for key, value in self.after.items()},
            "findings": [_finding(each) for each in self.findings],
            "suspects": [_finding(each) for each in self.suspects],
            "unexplained": {"share": self.unexplained, "depends_on": dict(self.depends_on)},
            "not_excited": [
                {"effect": each.effect, "component": each.component, "needs": each.needs}
                for each in self.not_excited
            ],
            "absorbed": list(self.absorbed),
        }
        if ranking:
            found["ranking"] = [
                {
                    "candidate": each.name,
                    "probability": each.probability,
                    "log_gain": each.log_gain,
                    "fitted": each.fitted,
                    "why_not": each.why_not,
                }
                for each in self.standings
            ]
        return found


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "class": [
            {"effect": effect, "component": component, "probability": probability}
            for effect, component, probability in finding.members
        ],
        "probability": finding.probability,
        "parameters": {name: list(value) for name, value in finding.parameters.items()},
        "gives": {way: list(value) for way, value in finding.gives.items()},
        "log_gain": finding.log_gain,
        "explains": finding.explains,
        "buys": {key: list(gain) for key, gain in finding.buys.items()},
        "compensable": finding.compensable,
        "evidence": finding.evidence,
        "check": finding.check,
    }
