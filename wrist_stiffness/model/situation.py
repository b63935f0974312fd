"""n samples and what follows from them: configuration, operators, wrenches through the parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.table import Evaluation, Table
from wrist_stiffness.mechanism.compiled import CompiledWrist
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.contact import forces_of, solve_contacts
from wrist_stiffness.mechanism.energy import (
    component_wrench,
    component_wrenches,
    flange_screws,
)
from wrist_stiffness.mechanism.influence import IN_LIMB_1, Influence, influence
from wrist_stiffness.mechanism.statics import (
    ContactOperators,
    assembled_operators,
    changed_operators,
    component_rotations,
    platform_twist,
    slides,
    turned_flexibilities,
    weight_wrench,
)
from wrist_stiffness.mechanism.vectors import both_halves, dot
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.contribution import (
    NOTHING,
    Constants,
    Contribution,
    MissingSignalError,
    together,
)
from wrist_stiffness.model.places import BODY, LIMB, MOTOR_JOINT


@dataclass(frozen=True, eq=False)
class BlockStatics:
    """n samples at their configurations with elastic parts.

    Models that share it share the work: nothing is computed before it is asked for, or twice.
    """

    block: Block  # the samples, with speeds
    load: Array  # (n, 6), what the load sensor says, in F at O [N, N m]
    configuration: Configuration  # of shape (n,)
    evaluation: Evaluation  # `closed_form` or `spline`
    table: Table
    parts: ElasticComponents  # elastic parts as they are with a model's effects

    def with_parts(self, parts: ElasticComponents) -> BlockStatics:
        """Return the statics of the same samples with other parts."""
        if parts is self.parts:
            return self
        other = self.without_operators(parts)
        if (
            "operators" in vars(self)
            and "own_weight" in vars(other)
            and self.evaluation == "closed_form"
            and parts.contact.keys() == self.parts.contact.keys()
        ):
            vars(other)["_changed_from"] = self
        return other

    def without_operators(self, parts: ElasticComponents) -> BlockStatics:
        """Return the same, but for what takes much memory and rests on all parts."""
        other = replace(self, parts=parts)
        shared = ["influence", "jacobian"]
        weights = ("weight_motor_side", "weight_platform_side", "platform_weight")
        if all(getattr(parts, name) is getattr(self.parts, name) for name in weights):
            # The free slides make the wrist isostatic: own weight finds its way without springs.
            shared.append("own_weight")
        vars(other).update({name: vars(self)[name] for name in shared if name in vars(self)})
        return other

    @cached_property
    def operators(self) -> ContactOperators:
        """Elastic operators of shape (n,)."""
        if self.evaluation == "spline":
            return self.table.operators_at(self.configuration, "spline")
        own = self.table.geometry.gravity, self.own_weight
        known = vars(self).pop("_changed_from", None)
        if known is not None:
            return changed_operators(
                known.operators, self.configuration, known.parts, self.parts, *own
            )
        return assembled_operators(
            self.configuration, self.influence, self.parts, self.turned_flexibility, *own
        )

    @cached_property
    def influence(self) -> Influence:
        """Projectors of the configurations."""
        return influence(self.configuration)

    @cached_property
    def turned_flexibility(self) -> Array:
        """Flexibility of each component at O in F, (n, 8, 6, 6) [m/N, rad/N, rad/(N m)]."""
        return turned_flexibilities(self.configuration, self.parts)

    @cached_property
    def jacobian(self) -> Array:
        """Jacobian of the platform's angular velocity, (n, 3, 2)."""
        return self.table.mechanism.jacobian(self.configuration)

    @cached_property
    def own_weight(self) -> Array:
        """Wrench of own weight through the elastic components, (n, 8, 6) [N, N m]."""
        return weight_wrench(
            self.configuration, self.parts, self.table.geometry.gravity, self.influence
        )

    @cached_property
    def slide_flexibility(self) -> tuple[Array, Array]:
        """How far joint_2 to joint_4 slide, and turn, for a unit force, and torque, along the axis.

        Gives `slide` (n, 3): [m/N]; with all flanges open, and `turn` (n, 3): [rad/(N m)].
        """
        rows, flexibility = self.influence.slides_limb_1, self.turned_flexibility.sum(axis=1)
        parts = flexibility[:, :3, :3], flexibility[:, 3:, 3:]
        slide, turn = ((rows @ part * rows).sum(axis=2) for part in parts)
        return slide, turn

    @cached_property
    def told(self) -> tuple[Array, Array]:
        """Twist and gaps under the told load and own weight alone, slides free, (n, 6), (n, m)."""
        column, operators = self.load[..., None], self.operators
        twist = operators.weight_twist + (operators.compliance @ column)[..., 0]
        gap = operators.gap + (np.swapaxes(operators.force_twist, -1, -2) @ column)[..., 0]
        return twist, gap


@dataclass(frozen=True)
class Situation:
    """A block at its configurations; everything that a law may ask for."""

    # samples, configurations, and what the table says of them with the model's elastic parts
    statics: BlockStatics
    constants: Constants = Constants()  # sum of what the model's constant effects add
    given: Contribution = NOTHING  # sum of what its other effects added in earlier stages
    guess: NDArray[np.bool_] | None = None  # (m,) or (n, m), first guess of the contact state
    wrist: CompiledWrist | None = None  # the compiled formulas with the model's constants

    @property
    def block(self) -> Block:
        """The samples, with speeds."""
        return self.statics.block

    @property
    def load(self) -> Array:
        """What the load sensor says, in F at O, (n, 6) [N, N m]."""
        return self.statics.load

    @property
    def configuration(self) -> Configuration:
        """Configurations of shape (n,)."""
        return self.statics.configuration

    @property
    def table(self) -> Table:
        """Geometry and mechanism."""
        return self.statics.table

    @property
    def parts(self) -> ElasticComponents:
        """Elastic parts as they are with the model's effects."""
        return self.statics.parts

    @property
    def operators(self) -> ContactOperators:
        """Elastic operators of shape (n,)."""
        return self.statics.operators

    @property
    def influence(self) -> Influence:
        """Projectors of the configurations."""
        return self.statics.influence

    @property
    def jacobian(self) -> Array:
        """Jacobian of the platform's angular velocity, (n, 3, 2)."""
        return _held(self.statics.jacobian)

    @cached_property
    def acting(self) -> Contribution:
        """All that constant effects and earlier stages added."""
        return self.given + self.constants.at(self.configuration)

    @property
    def speed(self) -> Array:
        """Motor speeds, (n, 2) [rad/s]."""
        speed = self.block.theta_dot
        return np.zeros_like(self.block.theta) if speed is None else speed

    @property
    def wrench(self) -> Array:
        """Wrench on the platform at O in F with all that earlier stages added, (n, 6) [N, N m]."""
        wrench = self.load
        for added in (self.constants.wrench, self.given.wrench):
            wrench = wrench if added is None else wrench + added
        return wrench

    @property
    def sensor(self) -> tuple[Array | None, Array | None]:
        """X and Y of the pose sensor with all that earlier stages added, (n, 6) or (6,) in F."""
        left, right = self.constants.sensor(self.configuration)
        return together(left, self.given.sensor_left), together(right, self.given.sensor_right)

    def temperature(self, name: str) -> Array:
        """Return the temperature of a component or of `ambient` above reference, (n,) [K]."""
        if name not in self.block.temperatures:
            raise MissingSignalError(f"temperature of {name}")
        return self.block.temperatures[name] - self.table.geometry.reference_temperature

    def body(self, place: str) -> Array:
        """Rotation from home of the body that a place turns with, (n, 3, 3)."""
        return self.configuration.bodies[..., BODIES.index(BODY[place]), :, :]

    def at_home(self, place: str, six: Array) -> Array:
        """Return 6-vectors (n, 6) at O in F in the place's body, turned back home."""
        return both_halves(np.swapaxes(self.body(place), -1, -2), six)

    def in_base(self, place: str, six: Array) -> Array:
        """Return 6-vectors (n, 6) or (6,) at O in the place's home frame at O in F."""
        # A user's own law may give a list.
        return both_halves(self.body(place), np.asarray(six))

    def screw(self, place: str, home: Array) -> Contribution:
        """Return a screw (n, 6) or (6,) at O in the place's home frame as a contribution."""
        return Contribution(**{LIMB[place]: self.in_base(place, home)})

    def motor_turn(self, motor: str, angle: Array) -> Contribution:
        """Return an angle (n,) [rad] added to a motor's as the screw about its axis."""
        axis = self.table.geometry.axes[MOTOR_JOINT[motor]]
        screw = np.zeros((len(angle), 6))
        screw[:, 3:] = angle[:, None] * axis
        return Contribution(**{LIMB[motor]: screw})

    @cached_property
    def free(self) -> tuple[Array, Array]:
        """Twist and gaps under all that earlier stages added, slides free, (n, 6), (n, m)."""
        (twist, gap), added = self.statics.told, self.carried(self.acting)
        return twist + added[0], gap + added[1]

    @cached_property
    def contact(self) -> tuple[Array, NDArray[np.bool_]]:
        """Forces (n, m) [N] and state (n, m) of the flanges under all that was added so far."""
        if self.solved:
            return self.solved[1:]
        return solve_contacts(self.operators.approach, self.free[1], self.guess)

    @cached_property
    def answer(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Twist (n, 6) under all that was added so far, and the `contact` that belongs to it."""
        if self.solved:
            return self.solved
        force, active = self.contact
        twist = self.free[0] + (self.operators.force_twist @ force[..., None])[..., 0]
        return twist, force, active

    @cached_property
    def solved(self) -> tuple[Array, Array, NDArray[np.bool_]] | None:
        """The same by the compiled formulas, None where they do not serve."""
        if self.wrist is None:
            return None
        given = self.given
        limb_1, limb_2, gap = given.limb_1, given.limb_2, given.gap
        if given.through is not None:
            bent = (self.statics.turned_flexibility @ given.through[..., None])[..., 0]
            limb_1 = together(limb_1, bent[:, IN_LIMB_1].sum(axis=1))
            limb_2 = together(limb_2, bent[:, ~IN_LIMB_1].sum(axis=1))
            gap = together(gap, self._opened(given.through))
        found = self.wrist.respond(self.configuration, self.wrench, self.guess, limb_1, limb_2, gap)
        if found is None or given.both is None:
            return found
        return found[0] + given.both, *found[1:]

    @property
    def contact_force(self) -> Array:
        """Force of the flange sectors under all that earlier stages added, (n, m) [N]."""
        return _held(self.contact[0])

    def with_more(self, added: Contribution) -> Situation:
        """Return the situation after a further stage that added this, with what is known of it."""
        if added is NOTHING:
            return self
        known, guess = vars(self), self.guess
        if "contact" in known:
            guess = self.contact[1]
        other = Situation(self.statics, self.constants, self.given + added, guess, self.wrist)
        if "acting" in known:
            vars(other)["acting"] = self.acting + added
        if "free" in known:
            (twist, gap), more = self.free, self.carried(added)
            vars(other)["free"] = twist + more[0], gap + more[1]
        return other

    @cached_property
    def through(self) -> Array:
        """Wrench through the elastic components under all that earlier stages added.

        Own weight and contact included, (n, 8, 6) at O in F [N, N m].
        """
        through = self.statics.own_weight + component_wrenches(
            self.influence, self.parts, self.wrench, self.contact_force
        )
        added = self.acting.through
        return _held(through if added is None else through + added)

    def through_place(self, place: str) -> Array:
        """Return the wrench through a joint, link, motor, the frame or the platform, (n, 6).

        At O in F [N, N m]; what it does to the platform side of the place.
        """
        if place == "frame":
            return self.through_place("motor_1") + self.through_place("motor_2")
        if place == "platform":
            return self.wrench
        k = ELASTIC.index(MOTOR_JOINT.get(place, place))
        if "through" in vars(self):
            return self.through[:, k]
        through = self.statics.own_weight[:, k] + component_wrench(
            self.influence, self.parts, k, self.wrench, self.contact_force
        )
        return through if self.acting.through is None else through + self.acting.through[:, k]

    def elastic_screw(self, place: str) -> Array:
        """Return C_k W_k of a link or bushing, (n, 6) at O in F [m, rad]."""
        bent = self.statics.turned_flexibility[:, ELASTIC.index(place)]
        return (bent @ self.through_place(place)[..., None])[..., 0]

    def elastic_share(self, place: str, fraction: Array) -> Contribution:
        """Return fractions (n,) of the elastic screw of a link or bushing as a contribution."""
        return Contribution(**{LIMB[place]: fraction[:, None] * self.elastic_screw(place)})

    def screws_under(self, through: Array, force: Array) -> Array:
        """Return the elastic screw of each component; a bushing's flanges belong to it.

        `through` (n, 8, 6): wrench through the components at O in F [N, N m]; `force` (n, m): of
        the flange sectors [N].  Gives (n, 8, 6): at O in F [m, rad].
        """
        screws: Array = (self.statics.turned_flexibility @ through[..., None])[..., 0]
        return screws + flange_screws(self.configuration, self.parts, force)

    @cached_property
    def slides(self) -> Array:
        """Slides of joint_2 to joint_4 under all that earlier stages added, (n, 3) [m]."""
        bent = self.screws_under(self.through, self.contact_force)
        moved = slides(self.influence, bent)
        relative = _difference(self.acting.limb_1, self.acting.limb_2)
        if relative is not None:
            moved = moved + (self.influence.slides_limb_1 @ relative[:, :3, None])[..., 0]
        return moved

    def turn(self, joint: str) -> Array:
        """Turn of a passive joint from home, platform side against motor side, (n,) [rad]."""
        return self.configuration.turn(joint, self.table.geometry.axes[joint])

    def carried(self, added: Contribution) -> tuple[Array, Array]:
        """Carry a contribution to the platform and to the flange gaps, with slides free.

        `added`: of n samples; what it says of the pose sensor is left out.  Gives `twist` (n, 6):
        of the platform [m, rad], and `gap` (n, m): opening of the sectors [m].
        """
        projectors, sectors = self.influence, self.parts.sectors
        n = len(self.block)
        twist, gap = np.zeros((n, 6)), np.zeros((n, len(sectors.gap)))
        for six, g in ((added.limb_1, projectors.limb_1), (added.limb_2, projectors.limb_2)):
            if six is not None:
                twist += both_halves(g, six)
        if added.both is not None:
            twist += added.both
        relative = _difference(added.limb_1, added.limb_2)
        if relative is not None:
            slid = (projectors.slides_limb_1 @ relative[:, :3, None])[..., 0]
            gap += slid @ sectors.slide.T
        if added.wrench is not None:
            column = added.wrench[..., None]
            twist += (self.operators.compliance @ column)[..., 0]
            gap += (np.swapaxes(self.operators.force_twist, -1, -2) @ column)[..., 0]
        if added.through is not None:
            bent = (self.statics.turned_flexibility @ added.through[..., None])[..., 0]
            twist += platform_twist(projectors, bent)
            gap += slides(projectors, bent) @ sectors.slide.T
            gap += self._opened(added.through)
        if added.gap is not None:
            gap += added.gap
        return twist, gap

    def _opened(self, through: Array) -> Array:
        """Return by how much the bushings' own screws under wrenches (n, 8, 6) open flanges."""
        sectors = self.parts.sectors
        back = np.swapaxes(component_rotations(self.configuration), -1, -2)
        home = both_halves(back, through)
        return dot(home.take(sectors.component, axis=1), sectors.screw)

    def with_contact(self, twist: Array, gap: Array, closed: NDArray[np.bool_]) -> Array:
        """Return what a carried contribution does where the closed sectors hold: the tangent.

        `twist` (n, 6): carried with slides free [m, rad]; `gap` (n, m): opening that the sectors do
        not let happen [m]; `closed` (n, m): contact state.  Gives (n, 6): twist of the platform [m,
        rad].
        """
        force = forces_of(self.operators.approach, gap, closed)
        return twist + (self.operators.force_twist @ force[..., None])[..., 0]

    def joint_push(self, joint: str, force: Array, torque: Array) -> Contribution:
        """Return a force (n,) [N] and torque (n,) [N m] of a passive joint on its platform side.

        Both are along the axis, with their reactions on the motor side.
        """
        row = self.influence.slides()[..., PASSIVE_JOINTS.index(joint), :]
        return Contribution(
            through=np.concatenate(
                [row * force[:, None, None], row * torque[:, None, None]], axis=-1
            )
        )

    def covariate(self, name: str) -> Array:
        """Return a covariate, (n,)."""
        if name not in self.block.covariates:
            raise MissingSignalError(f"covariate {name}")
        return self.block.covariates[name]


def _held(known: Array) -> Array:
    """Return a view into which no law can write what others read."""
    view = known.view()
    view.flags.writeable = False
    return view


def _difference(first: Array | None, second: Array | None) -> Array | None:
    if first is None:
        return None if second is None else -second
    return first if second is None else first - second


def lengths(vectors: Array) -> Array:
    """Return the length of (..., 3) vectors."""
    return np.sqrt(dot(vectors, vectors))
