"""Dry friction of a cylindrical joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from wrist_stiffness.mechanism.components import PASSIVE_JOINTS
from wrist_stiffness.model.columns import Recipe, share_of_shape
from wrist_stiffness.model.law import Law, Outcome, Situation, SIValues
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.rubbing import Rubbing, slip


class JointFriction(Law):
    """One Coulomb budget shared by turn and slide, with pre-sliding.

    The pin's surface moves along (radius times turn, slide).  It is held by a bristle before it
    slips, in series with the limb's own flexibility.  The bristle bends by a distance, as rough
    surfaces do whose contacts grow with the load (Greenwood and Williamson), and by so much a
    newton, as a lining does and the bristles of Dahl and LuGre of one stiffness; the force
    never exceeds coefficient times (pressing forces + preload).  While the joint turns the budget
    is spent there and the slide is free; at rest it locks.  In the situation that it gets its own
    force acts already, as in the pass before: see `evaluation.PASSES`.
    """

    id = "joint_friction"
    stage = "friction"
    places = PASSIVE_JOINTS
    sentence = "{place} rubs: the pose depends on the way it was reached"
    check = "turn the joint by hand; clean it; compare an approach under load with a load at rest"
    excited_by = "approaches from both sides, and loads applied at rest against carried through"
    smooth = False
    own = (
        Parameter("coefficient", 0.0, 2.0, 0.1, linear=False, grid=(0.03, 0.15, 0.6)),
        Parameter("preload_N", 0.0, 100.0, 1.0, linear=False),
        Parameter("presliding_um", 0.01, 200.0, 5.0, mean=5.0, linear=False),
        Parameter("bristle_um_per_N", 0.0, 1000.0, 10.0, linear=False, grid=(0.0, 30.0)),
    )

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return what friction of several sizes does, of short and soft bristles, times a share."""
        return share_of_shape(self.own, "coefficient", {"preload_N": 0.0, "presliding_um": 3.0})

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the friction force and torque; the state is the bristle's foot."""
        rubbing = Rubbing(place, *(values[each.key] for each in self.own))
        own = sum(each.force for each in at.given.rubbing or () if each.joint == place)
        rubbing = replace(rubbing, force=own)
        bristles = rubbing.bristles(at)
        force, feet = slip(bristles, bristles.moved[0] if state is None else state)
        push = rubbing.push(at, force)
        return replace(push, rubbing=(replace(rubbing, force=force),)), feet[-1]
