"""What a diagnosis says, and its form in a file."""

from dataclasses import dataclass
from typing import Any

SCHEMA = 1


@dataclass(frozen=True)
class Finding:
    """One effect that is missing, or a class of effects that these data cannot tell apart.

    Parameters
    ----------
    members : tuple of (str, str)
        Effect and component, best first.
    parameters : dict
        Estimate and one standard uncertainty of the best member, by name.
    heldout_rmse_ratio : float
        Whitened residual on sealed units with the effect over without it.
    delta_bic : float
        Evidence for the effect, above zero if it speaks for it: twice the logarithm of the Bayes
        factor, with the width of the prior that suits it best, against noise and the structure
        that is left.  Where a parameter has no usual size, the Bayesian information criterion
        stands for that.
    p_value : float
        Chance that the best of all candidates looks as good without any effect.
    stability : float
        Share of block resamples that choose this class.
    buys : dict
        Fall of the held-out error and its standard uncertainty, by quantity and unit.
    compensable, evidence, check : str
        For the technician.
    """

    members: tuple[tuple[str, str], ...]
    parameters: dict[str, tuple[float, float]]
    heldout_rmse_ratio: float
    delta_bic: float
    p_value: float
    stability: float
    buys: dict[str, tuple[float, float]]
    compensable: str
    evidence: str
    check: str

    @property
    def name(self) -> str:
        """Best member as ``effect@component``."""
        return "@".join(self.members[0])

    @property
    def names(self) -> tuple[str, ...]:
        """All members as ``effect@component``, best first."""
        return tuple("@".join(member) for member in self.members)


@dataclass(frozen=True)
class Unexplained:
    """Structure that no known effect explains.

    Parameters
    ----------
    depends_on : tuple of str
        Conditions that predict it.
    energy_share : float
        Part of the initial excess over the noise, in [0, 1].
    evidence : str
        One sentence.
    """

    depends_on: tuple[str, ...]
    energy_share: float
    evidence: str


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
        ``effect``, ``none`` or ``unknown``.
    unit_of_analysis : str
        ``dwell`` or ``sample``.
    noise_floor, before, after : dict
        Root mean square of each quantity, by quantity and unit.
    absorbed : tuple of str
        What the base took up.
    findings : tuple of Finding
        In the order in which they enter.
    unexplained : Unexplained
        What is left.
    not_excited : tuple of NotExcited
        What these data cannot tell.
    lost_units : int
        Units left out as outliers.
    scope : str
        Where the held-out errors hold.
    """

    verdict: str
    unit_of_analysis: str
    noise_floor: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]
    absorbed: tuple[str, ...]
    findings: tuple[Finding, ...]
    unexplained: Unexplained
    not_excited: tuple[NotExcited, ...]
    lost_units: int
    scope: str

    def as_json(self) -> dict[str, Any]:
        """Plain containers for `json.dump`."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "unit_of_analysis": self.unit_of_analysis,
            "scope": self.scope,
            "lost_units": self.lost_units,
            "noise_floor": self.noise_floor,
            "before": {f"rmse_{key}": value for key, value in self.before.items()},
            "absorbed": list(self.absorbed),
            "findings": [_finding(each) for each in self.findings],
            "unexplained": {
                "depends_on": list(self.unexplained.depends_on),
                "energy_share": self.unexplained.energy_share,
                "evidence": self.unexplained.evidence,
            },
            "not_excited": [
                {"effect": each.effect, "component": each.component, "needs": each.needs}
                for each in self.not_excited
            ],
            "after": {f"rmse_{key}": value for key, value in self.after.items()},
        }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "class": [{"effect": effect, "component": part} for effect, part in finding.members],
        "parameters": {name: list(value) for name, value in finding.parameters.items()},
        "heldout_rmse_ratio": finding.heldout_rmse_ratio,
        "delta_bic": finding.delta_bic,
        "p_value": finding.p_value,
        "stability": finding.stability,
        # One key per unit, as there is one quantity per unit in a pose error.
        **{f"buys_{key.split('_', 1)[-1]}": list(gain) for key, gain in finding.buys.items()},
        "compensable": finding.compensable,
        "evidence": finding.evidence,
        "check": finding.check,
    }
