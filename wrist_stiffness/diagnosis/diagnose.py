"""Which physical effect is missing?  All steps of a diagnosis in their order."""

from dataclasses import replace

import numpy as np

from wrist_stiffness.diagnosis.candidates import Candidate, remembered
from wrist_stiffness.diagnosis.discrepancy import Discrepancy, find_discrepancy
from wrist_stiffness.diagnosis.errors_in_variables import without_attenuation
from wrist_stiffness.diagnosis.estimates import joint_fit
from wrist_stiffness.diagnosis.findings import Model, describe, with_values
from wrist_stiffness.diagnosis.fitted import fit_to
from wrist_stiffness.diagnosis.hypotheses import (
    Evidence,
    Hypothesis,
    all_hypotheses,
    gain,
    make_evidence,
)
from wrist_stiffness.diagnosis.identifiability import excited
from wrist_stiffness.diagnosis.noise import estimate_noise
from wrist_stiffness.diagnosis.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.diagnosis.observations import Array, Observations
from wrist_stiffness.diagnosis.outliers import lost_units
from wrist_stiffness.diagnosis.projection import Base, orthonormal
from wrist_stiffness.diagnosis.ranking import evidence_of
from wrist_stiffness.diagnosis.resampling import time_blocks
from wrist_stiffness.diagnosis.result import Diagnosis, Finding, NotExcited, Unexplained
from wrist_stiffness.diagnosis.sealed import HeldOut, held_out, refuted, sealed_units
from wrist_stiffness.diagnosis.selection import Entered, base_with, select
from wrist_stiffness.diagnosis.settings import CHANCE_OF_STRUCTURE, FEWEST_UNITS, Settings
from wrist_stiffness.diagnosis.structure import Excess, effective_dimension, lack_of_fit
from wrist_stiffness.errors import InputError

NOISE_KNOWN = {
    "replicates": "known from repeated measurements",
    "given": "as stated for the instrument",
    "residual": "estimated from what is left itself",
}
"""Where the size of the noise is known from, in words."""


def diagnose(
    observations: Observations,
    candidates: tuple[Candidate, ...],
    nuisances: tuple[Nuisance, ...],
    rng: np.random.Generator,
    settings: Settings | None = None,
) -> Diagnosis:
    """Find the effects that a model misses.

    Parameters
    ----------
    observations : Observations
        Measured minus predicted, with the conditions; one row per dwell or sample.
    candidates : tuple of Candidate
        The catalogue.
    nuisances : tuple of Nuisance
        What is refitted first.
    rng : numpy.random.Generator
        Source of chance for permutations and resamples.
    settings : Settings, optional
        Thresholds.

    Returns
    -------
    Diagnosis
        Verdict, findings and what remains open.

    Raises
    ------
    InputError
        If there are too few units or numbers, two candidates of one name, or unusable columns.
    """
    settings = settings or Settings()
    _refuse_unusable(observations, candidates)
    observations = replace(observations, row=None)
    original = {candidate.name: candidate for candidate in candidates}
    candidates = tuple(remembered(candidate, observations) for candidate in candidates)
    aside = sealed_units(observations, settings.sealed_share)
    _refuse_too_few(int(np.sum(~aside)), int(np.sum(aside)))
    training, n_lost = _cleaned(observations.take(~aside), candidates, nuisances, settings)
    evidence = _gather(training, candidates, nuisances)
    testable, silent = excited(evidence.base, all_hypotheses(evidence, candidates))
    dimension = effective_dimension(evidence.base, testable)
    entered = select(evidence, testable, dimension, settings, rng)

    sealed, n_lost_aside = _cleaned(observations.take(aside), candidates, nuisances, settings)
    kept, stages, broken = _opened(evidence, entered, sealed, nuisances)
    blocks = time_blocks(training.sessions, settings.blocks)
    model = Model(evidence, testable, kept, tuple(stages), blocks, dimension, settings)
    findings = tuple(describe(model, which, rng) for which in range(len(kept)))
    doubts = []
    while doubt := _first_doubt(findings, settings):
        which, sentence = doubt
        doubts.append(sentence)
        rest = kept[:which] + kept[which + 1 :]
        kept, stages, more = _opened(evidence, rest, sealed, nuisances)
        broken += more
        model = replace(model, effects=kept, stages=tuple(stages))
        findings = tuple(describe(model, which, rng) for which in range(len(kept)))
    base = base_with(evidence.base, kept)
    excess = lack_of_fit(base.energy, base.freedom, evidence.noise.dof)
    flexible = find_discrepancy(
        evidence, base, blocks, settings.permutations, CHANCE_OF_STRUCTURE, rng
    )
    unexplained = _unexplained(evidence, base.energy, excess, flexible, broken, doubts)
    if observations.covariate_std and kept:
        effects = [(original[each.name], each.hypothesis.shape) for each in kept]
        exact = without_attenuation(evidence, effects, nuisances, rng)
        findings = tuple(
            with_values(finding, values) for finding, values in zip(findings, exact, strict=True)
        )
    verdict = "effect" if findings else "none"
    if unexplained.energy_share >= settings.unexplained_share or broken or doubts:
        verdict = "unknown"
    return Diagnosis(
        verdict,
        "sample" if observations.samples is None else "dwell",
        training.rms(evidence.noise.variance(training)),
        {q.key: stages[0].rmse(q) for q in observations.reported},
        {q.key: stages[-1].rmse(q) for q in observations.reported},
        _absorbed(evidence, kept),
        findings,
        unexplained,
        tuple(NotExcited(c.effect, c.component, c.needs) for c in candidates if c.name in silent),
        n_lost + n_lost_aside,
        "another session" if len(np.unique(observations.sessions)) > 1 else "this session only",
    )


def _first_doubt(findings: tuple[Finding, ...], settings: Settings) -> tuple[int, str] | None:
    """Return which finding cannot be named, the least stable first, and why; None if all can."""
    for which in sorted(range(len(findings)), key=lambda each: findings[each].stability):
        finding = findings[which]
        if len(finding.names) > settings.most_members:
            others = len(finding.names) - 1
            return which, f"{others} others explain it about as well as {finding.name}"
        if finding.stability < settings.least_stability:
            share = f"{100 * finding.stability:.0f} % of the resamples"
            return which, f"{finding.name} explains it best, but only {share} choose it again"
    return None


def _refuse_unusable(observations: Observations, candidates: tuple[Candidate, ...]) -> None:
    names = [candidate.name for candidate in candidates]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InputError(f"candidate {sorted(twice)[0]} is listed twice")
    if not observations.measured.any():
        raise InputError("nothing was measured: every value is NaN")


def _refuse_too_few(left: int, aside: int) -> None:
    if left < FEWEST_UNITS:
        raise InputError(
            f"{left + aside} units are too few for a diagnosis: {aside} are put aside to judge by, "
            f"and of the {left} that are left it needs {FEWEST_UNITS}"
        )


def _structure(observations: Observations, candidates: tuple[Candidate, ...]) -> Array:
    """Columns of the whole catalogue on all its grids, (n, m, q)."""
    columns = [np.empty((*observations.values.shape, 0))]
    columns += [c.evaluate(observations, shape) for c in candidates for shape in c.shapes]
    return np.concatenate(columns, axis=2)


def _cleaned(
    observations: Observations,
    candidates: tuple[Candidate, ...],
    nuisances: tuple[Nuisance, ...],
    settings: Settings,
) -> tuple[Observations, int]:
    """Observations without lost units, and how many were lost; of few units none can be told."""
    if observations.n_units < FEWEST_UNITS:
        return observations, 0
    everything = np.concatenate(
        [
            nuisance_columns(observations, nuisances).columns,
            _structure(observations, candidates),
        ],
        axis=2,
    )
    lost = lost_units(observations, everything, settings.outlier_limit)
    return observations.take(~lost), int(lost.sum())


def _gather(
    training: Observations, candidates: tuple[Candidate, ...], nuisances: tuple[Nuisance, ...]
) -> Evidence:
    nuisance = nuisance_columns(training, nuisances)
    measured = training.measured
    seen = np.where(measured[:, :, None], nuisance.columns, 0.0).reshape(measured.size, -1)
    refitted = orthonormal(seen).shape[1]
    if measured.sum() <= refitted:
        raise InputError(
            f"{measured.sum()} measured numbers are too few for a diagnosis: "
            f"the base alone fits {refitted}"
        )
    noise = estimate_noise(training, nuisance.columns, _structure(training, candidates))
    return make_evidence(training, noise, nuisance)


def _opened(
    evidence: Evidence,
    entered: tuple[Entered, ...],
    sealed: Observations,
    nuisances: tuple[Nuisance, ...],
) -> tuple[tuple[Entered, ...], list[HeldOut], list[str]]:
    """Judge each effect, in the order of entry, on the sealed part."""
    kept: list[Entered] = []
    stages = [held_out(fit_to(evidence, [], nuisances), sealed)]
    broken: list[str] = []
    for each in entered:
        alone = base_with(evidence.base, tuple(kept))
        if broken and _worthless(alone, each.hypothesis):
            # It entered only beside an effect that did not hold.
            continue
        trial = [other.hypothesis for other in kept] + [each.hypothesis]
        stage = held_out(fit_to(evidence, trial, nuisances), sealed)
        if refuted(stages[-1], stage):
            broken.append(each.name)
        else:
            kept.append(each)
            stages.append(stage)
    return tuple(kept), stages, broken


def _worthless(base: Base, hypothesis: Hypothesis) -> bool:
    """Tell whether an effect explains less than its freedom costs."""
    return evidence_of(base, hypothesis, gain(base, hypothesis)) < 0


def _unexplained(
    evidence: Evidence,
    energy: float,
    excess: Excess,
    flexible: Discrepancy,
    broken: list[str],
    doubts: list[str],
) -> Unexplained:
    remaining = max(excess.energy, flexible.energy)
    explained = evidence.base.energy - energy
    share = remaining / (remaining + explained) if remaining > 0 else 0.0
    sentences = []
    if excess.energy > 0:
        sentences.append(
            f"more is left than the noise, {NOISE_KNOWN[evidence.noise.source]}, would leave "
            f"(chance {excess.p_value:.1g})"
        )
    if flexible.energy > 0:
        sentences.append(
            f"the conditions foretell a part of what is left where they were not fitted (chance "
            f"{flexible.p_value:.1g})"
        )
    sentences += [f"{name} fitted here makes the sealed part worse" for name in broken]
    sentences += doubts
    return Unexplained(flexible.depends_on, float(share), "; ".join(sentences))


def _absorbed(evidence: Evidence, kept: tuple[Entered, ...]) -> tuple[str, ...]:
    """Tell what each nuisance group took up, as root mean square of each quantity."""
    nuisance = evidence.nuisance
    parameters, _ = joint_fit(evidence, [each.hypothesis for each in kept])
    sentences = []
    for group in dict.fromkeys(name for name, _, _ in nuisance.keys):
        own = np.array([name == group for name, _, _ in nuisance.keys])
        taken = nuisance.columns[:, :, own] @ parameters[own]
        sizes = [
            f"{np.sqrt(np.mean(np.sum(taken[:, list(q.components)] ** 2, axis=1))) * q.per_si:.3g}"
            f" {q.unit} of {q.name}"
            for q in evidence.observations.reported
        ]
        sentences.append(f"{group}: {', '.join(sizes)}")
    return tuple(sentences)
