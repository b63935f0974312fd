"""Play, and what rubs beside it, sought where so much is left that no slope leads to it.

Between one wall and the other the sum of squares has a minimum for every pin that turns over.  With
rounded walls there are fewer, and a fit tells in which joint the play is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.campaign.searching.base_fit import LOOSE
from wrist_stiffness.campaign.searching.candidates import WristCandidate
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.place import Candidates, Reached

STICKING = frozenset(("joint_friction",))
"""Laws that hold a pin off its wall: beside play they explain what alone they do not."""

MOST_SHARPENED = 2
"""So many that lead with rounded walls are fitted with the walls as they are."""


def from_afar(fitter: Fitter, begun: Reached, catalogue: Candidates) -> dict[str, Reached]:
    """Return fits with what leads furthest: play, and beside play a joint that rubs as well.

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
    loose = any(each.law.id in LOOSE for each in begun.effects.values())
    laws = LOOSE | STICKING if loose else LOOSE
    tried = [e for e in catalogue if e.law.id in laws and e.name not in begun.effects]
    easy = {each.name: _with_rounded_walls(fitter, begun, each) for each in tried}
    leading = sorted(easy, key=lambda name: easy[name].total)[:MOST_SHARPENED]
    return {name: _sharpened(fitter, easy[name]) for name in leading}


def _with_rounded_walls(fitter: Fitter, begun: Reached, added: WristCandidate) -> Reached:
    """Fit one more effect from its usual size, and everything else from where it was found.

    From the drawing, with what rubs at its usual size again, no more was found (ten wrists).
    """
    parameters = added.law.parameters(added.place)
    usual = added.effect_of({p.key: p.mean or p.scale for p in parameters})
    sessions, extras = begun.base.problem.sessions, [*begun.effects.values(), usual]
    base = fitter(sessions, extras, begun.base, beside=True, walls="rounded")
    price = len(parameters) * float(np.log(base.problem.table.measured.sum()))
    return replace(begun, base=base, prices={**begun.prices, added.name: price})


def _sharpened(fitter: Fitter, easy: Reached) -> Reached:
    base, extras = easy.base, list(easy.effects.values())
    whole = fitter(base.problem.sessions, extras, base, beside=True, walls="rounded first")
    return replace(easy, base=whole)
