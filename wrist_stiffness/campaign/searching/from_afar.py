"""Play, and what rubs beside it, sought where so much is left that no slope leads to it.

Between one wall and the other the sum of squares has a minimum for every pin that turns over.  With
rounded walls there are fewer, and a fit tells in which joint the play is.
"""

from __future__ import annotations

from dataclasses import replace

from wrist_stiffness.campaign.searching.base_fit import LOOSE, BaseFit
from wrist_stiffness.campaign.searching.candidates import WristCandidate
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.place import Candidates, Reached
from wrist_stiffness.model.effect import Effect

STICKING = frozenset(("joint_friction",))
"""Laws that hold a pin off its wall: beside play they explain what alone they do not."""

SMALL = 0.025
"""Share of its usual size from which what is added begins once more, where from its usual size it
ended higher than without it: small play in the right joint may not be reached from large play."""

MOST_SHARPENED = 2
"""So many that lead with rounded walls are fitted with the walls as they are."""


def from_afar(fitter: Fitter, begun: Reached, catalogue: Candidates) -> dict[str, Reached]:
    """Return fits with what leads furthest: play, and beside play a joint that rubs as well.

    Beside both nothing more is sought: each fit takes long by then.  Where nothing was found yet,
    play is tried beside the joint that explains most by rubbing.

    Parameters
    ----------
    fitter : Fitter
        Knows the model.
    begun : Reached
        What was found so far.
    catalogue : tuple of WristCandidate
        Laws at places; their columns are not asked for.

    Returns
    -------
    dict of str to Reached
        By the name of what was added, with the laws as they are.
    """
    there = {each.law.id for each in begun.effects.values()}
    laws = LOOSE
    if there & LOOSE:
        laws = frozenset() if there & STICKING else LOOSE | STICKING
    if not there:
        begun = _rubbing(fitter, begun, catalogue)
    tried = [e for e in catalogue if e.law.id in laws and e.name not in begun.effects]
    easy = {each.name: _with_rounded_walls(fitter, begun, each) for each in tried}
    leading = sorted(easy, key=lambda name: easy[name].total)[:MOST_SHARPENED]
    return {name: _sharpened(fitter, easy[name]) for name in leading}


def _rubbing(fitter: Fitter, begun: Reached, catalogue: Candidates) -> Reached:
    """Return a base alone with the joint that rubs, from the drawing, where one explains anything.

    Friction and play may each explain little, play in a wrong joint as much, and both together
    nearly all.
    """
    sessions = begun.base.problem.sessions
    trials = [
        _added(begun, each, fitter(sessions, [_usual(each)]))
        for each in catalogue
        if each.law.id in STICKING
    ]
    return min([begun, *trials], key=lambda each: each.total)


def _with_rounded_walls(fitter: Fitter, begun: Reached, more: WristCandidate) -> Reached:
    """Fit one more effect from its usual size, and everything else from where it was found.

    From the drawing, with what rubs at its usual size again, no more was found.
    """
    sessions, others = begun.base.problem.sessions, list(begun.effects.values())

    def fitted(share: float) -> BaseFit:
        extras = [*others, _usual(more, share)]
        return fitter(sessions, extras, begun.base, beside=True, walls="rounded")

    base = fitted(1.0)
    if base.cost > begun.base.cost:
        base = min(base, fitted(SMALL), key=lambda each: each.cost)
    return _added(begun, more, base)


def _usual(more: WristCandidate, share: float = 1.0) -> Effect:
    parameters = more.law.parameters(more.place)
    return more.effect_of({p.key: p.mean or share * p.scale for p in parameters})


def _added(begun: Reached, more: WristCandidate, base: BaseFit) -> Reached:
    price = len(more.law.parameters(more.place)) * base.unit_price
    return replace(begun, base=base, prices={**begun.prices, more.name: price})


def _sharpened(fitter: Fitter, easy: Reached) -> Reached:
    base, extras = easy.base, list(easy.effects.values())
    whole = fitter(base.problem.sessions, extras, base, beside=True, walls="rounded first")
    return replace(easy, base=whole)
