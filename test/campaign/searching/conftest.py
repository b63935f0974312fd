"""A fitter whose fits are known, for what a search makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching import place, seeking
from wrist_stiffness.campaign.searching.place import Reached
from wrist_stiffness.campaign.searching.screening import FittedCandidate
from wrist_stiffness.model.parameters import Parameter

PRICE = 5.0

PLAY, CABLE = "joint_clearance@joint_1", "cable_wrench@platform"
BACKLASH, DELAY, CREEP = "backlash@motor_1", "time_delay@pose_sensor", "creep@joint_1"
OTHER_PLAY, FRICTION = "joint_clearance@joint_2", "joint_friction@joint_2"
THIRD_PLAY, OTHER_FRICTION = "joint_clearance@joint_3", "joint_friction@joint_3"
UNPROMISED = (PLAY, OTHER_PLAY, THIRD_PLAY, FRICTION, OTHER_FRICTION, CABLE)
PARAMETER = Parameter("shape", 0.0, 9.0, 1.0)
NUMBERS = 100
"""Measured numbers, so what noise alone would leave."""


class Wrist:
    """Stands for a fitter: knows what is left along with any effects.

    `afresh`, `beside` and `rounded` say what else is left of fits from the drawing, beside play,
    and with rounded walls; `done` lists the fits in turn, and
    `sizes` where their effects began (None: as found).  What columns promise is what whole fits
    keep, where `promised` does not list it; no tangent shows play and friction.
    """

    model = None

    def __init__(self):
        self.left, self.afresh, self.beside, self.rounded = {}, {}, {}, {}
        self.promised = dict.fromkeys(UNPROMISED, 0.0)
        self.done, self.sizes, self.strained, self.unmeasured = [], [], set(), []

    @staticmethod
    def leaves(**kept):
        """Return what is left along with sets of effects; letters stand for them."""
        alone = {frozenset(): kept.pop("alone")} if "alone" in kept else {}
        return alone | {
            frozenset(LETTERS[each] for each in key): left for key, left in kept.items()
        }

    @staticmethod
    def candidate(name):
        return candidate(name)

    @staticmethod
    def led(names, start):
        """Return what is left of fits from elsewhere, where that is not as is listed."""

    def tell(self, text):
        """Nobody listens."""

    def __call__(self, sessions, extras=(), start=None, beside=False, walls="sharp"):
        names = frozenset(each.name for each in extras)
        self.sizes.append({each.name: each.size for each in extras})
        self.done.append((names, start, walls if walls == "rounded" else beside))
        how = self.beside if beside else self.afresh if start is None else {}
        how = self.rounded if walls == "rounded" else how
        return self.base(self.led(names, start) or how.get(names, self.left[names]), extras)

    def base(self, cost, extras=()):
        table = SimpleNamespace(measured=np.ones(NUMBERS, dtype=bool))
        model = SimpleNamespace(effects=())
        residual = np.full((1, 6), float(cost))
        residual[:, self.unmeasured] = np.nan
        return SimpleNamespace(
            cost=cost,
            extras=tuple(each.name for each in extras),
            beyond=lambda: {each.name: each for each in extras},
            problem=SimpleNamespace(table=table, sessions=(), model=model),
            residual=residual,
            strain=cost,
            strained=cost in self.strained,
            unit_price=float(np.log(NUMBERS)),
            variance=cost / NUMBERS,
        )

    def reached(self, *names, first=0.0):
        extras = [effect(name) for name in names]
        base = self.base(self.left[frozenset(names)], extras)
        return Reached(base, dict.fromkeys(names, PRICE), first)

    def screen(self, base, point, without=None):
        """Stands for a screen: what candidates gain is what fits along with them leave less."""
        names = frozenset(base.extras) - {without}
        energy = self.left[names]

        def gain(each):
            kept = energy - self.left.get(names | {each.name}, energy) - PRICE
            return self.promised.get(each.name, kept)

        return SimpleNamespace(
            energy=energy,
            leaders=lambda known: sorted(
                ((gain(each), each, ()) for each in known), key=lambda found: -found[0]
            ),
            fitted=lambda each, shape, value: FittedCandidate(each, {}, value, PRICE),
        )


def effect(name, size=None):
    law, component = name.split("@")
    return SimpleNamespace(
        name=name,
        law=SimpleNamespace(id=law, parameters=lambda place: (PARAMETER,)),
        component=component,
        parameters=(PARAMETER,),
        estimates={},
        size=size,
    )


def candidate(name, **whole):
    return SimpleNamespace(
        name=name,
        usual=np.ones(1),
        law=effect(name).law,
        place=effect(name).component,
        effect_of=lambda values: effect(name, values.get(PARAMETER.key)),
        changed_by=lambda change, strain: candidate(name, change=change, strain=strain),
        **whole,
    )


@pytest.fixture
def wrist(monkeypatch):
    """A wrist whose catalogue is all that any of its fits knows."""
    wrist = Wrist()

    def catalogue(point, held, seen, laws=None):
        names = sorted(frozenset().union(*wrist.left))
        names = [name for name in names if laws is None or name.split("@")[0] in laws]
        return tuple(candidate(name) for name in names if name not in held)

    monkeypatch.setattr(seeking, "wrist_candidates", catalogue)
    for module in (place, seeking):
        monkeypatch.setattr(module, "point_of", lambda base, with_extras=False: None)
    monkeypatch.setattr(seeking, "free_base", lambda model: ((), ()))
    monkeypatch.setattr(place, "Screen", wrist.screen)
    return wrist


LETTERS = {"b": BACKLASH, "c": CREEP, "d": DELAY, "p": PLAY, "w": CABLE} | {
    "f": FRICTION,
    "g": OTHER_FRICTION,
    "q": OTHER_PLAY,
    "t": THIRD_PLAY,
}
