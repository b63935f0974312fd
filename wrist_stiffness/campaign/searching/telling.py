"""What an answer says once what it names was fitted with its own laws.

Slopes say what they would explain; these values, errors and sentences are those of the laws.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from wrist_stiffness.campaign.fitting.result import FAR
from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.searching.candidates import SHARE
from wrist_stiffness.diagnosis import Diagnosis
from wrist_stiffness.diagnosis.result import Finding
from wrist_stiffness.diagnosis.sealed import HeldOut, bought
from wrist_stiffness.model.effect import Effect

CLEARLY = 2.0
"""Standard uncertainties of a gain by which the part put aside is worse, and not by chance."""


def withdrawn(result: Diagnosis, kept: Collection[str]) -> Diagnosis:
    """Return an answer without the findings that do not hold, and say so.

    Parameters
    ----------
    result : Diagnosis
        With all its findings.
    kept : collection of str
        Names of those that stay.
    """
    stay = tuple(each for each in result.findings if each.name in kept)
    gone = [each.name for each in result.findings if each.name not in kept]
    if not gone:
        return result
    after = {
        key: error - sum(finding.buys[key][0] for finding in stay)
        for key, error in result.before.items()
    }
    sentences = [result.unexplained.evidence] if result.unexplained.evidence else []
    sentences += [
        f"{name} with its own law explains no more than chance, or makes the sealed part worse"
        for name in gone
    ]
    unexplained = replace(result.unexplained, evidence="; ".join(sentences))
    return replace(result, verdict="unknown", findings=stay, after=after, unexplained=unexplained)


def buys_anything(finding: Finding) -> bool:
    """Tell whether a finding makes the part put aside better, or at least not clearly worse."""
    gains = finding.buys.values()
    worse = any(gain < -CLEARLY * sigma for gain, sigma in gains)
    return not worse or any(gain > sigma for gain, sigma in gains)


def valued(result: Diagnosis, fitted: BaseFit, whole: Collection[str] = ()) -> Diagnosis:
    """Return an answer with the parameters of whole fits where slopes do not say them.

    Where a finding stands for a whole fit, and where its own law ends so far from what the slopes
    said that these do not hold there: of a bushing that is many times as soft they tell a part.

    Parameters
    ----------
    result : Diagnosis
        With its findings.
    fitted : BaseFit
        The base along with all of them.
    whole : collection of str, optional
        Names of findings of which slopes leave much that their fits explain.
    """
    found = []
    for each in result.findings:
        values = fitted.values_on_top(each.name)
        stands_for_a_fit = SHARE in each.parameters or each.name in whole
        slopes_hold = not stands_for_a_fit and all(
            abs(values[key][0] - value) < FAR * sigma
            for key, (value, sigma) in each.parameters.items()
            if key in values
        )
        found.append(each if slopes_hold else replace(each, parameters=values))
    return replace(result, findings=tuple(found))


def sized(result: Diagnosis, effects: Sequence[Effect]) -> Diagnosis:
    """Return an answer that says of each finding if it is far beyond the usual.

    Parameters
    ----------
    result : Diagnosis
        With its findings.
    effects : sequence of Effect
        What was fitted for each of them.
    """
    told = []
    for finding, effect in zip(result.findings, effects, strict=True):
        # What is told of a finding below its sentence, and of the rest what was fitted.
        values = {key: each.value for key, each in effect.estimates.items()}
        values |= {k: v for k, (v, _) in finding.parameters.items() if k in values}
        by_size = {p.key: p.usual_sizes(values[p.key]) for p in effect.parameters}
        key = max(by_size, key=lambda each: by_size[each])
        sentence = finding.evidence
        if by_size[key] > FAR:
            sentence += f"; far beyond its usual size: {key} = {values[key]:.3g}"
        told.append(replace(finding, evidence=sentence))
    return replace(result, findings=tuple(told))


def rejudged(result: Diagnosis, stages: Sequence[HeldOut]) -> Diagnosis:
    """Return an answer with the errors of fits that had not seen the part put aside.

    Parameters
    ----------
    result : Diagnosis
        With as many findings as hold.
    stages : sequence of HeldOut
        Before the first of them and after each; none where the errors hold as they are.
    """
    if not stages:
        return result
    reported = [q for q in QUANTITIES if q.key in result.before]
    findings = tuple(
        replace(
            each,
            heldout_rmse_ratio=float(np.sqrt(after.energy / before.energy)),
            buys={q.key: bought(before, after, q) for q in reported},
        )
        for each, before, after in zip(result.findings, stages[:-1], stages[1:], strict=True)
    )
    return replace(
        result,
        before={q.key: stages[0].rmse(q) for q in reported},
        after={q.key: stages[-1].rmse(q) for q in reported},
        findings=findings,
    )


def explained(result: Diagnosis, effects: Sequence[Effect]) -> Diagnosis:
    """Return a rejudged answer whose findings say what their laws explain, not their slopes.

    Parameters
    ----------
    result : Diagnosis
        Rejudged by stages.
    effects : sequence of Effect
        What was fitted for each of its findings.
    """
    told = [
        replace(
            each,
            evidence=f"{effect.law.sentence.format(place=effect.component)}: its own law explains "
            f"{100.0 * max(1.0 - each.heldout_rmse_ratio**2, 0.0):.1f} % of what is left without "
            "it of the part put aside",
        )
        for each, effect in zip(result.findings, effects, strict=True)
    ]
    return replace(result, findings=tuple(told))
