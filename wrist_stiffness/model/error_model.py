"""Predict the platform's pose error at a pose under a load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Evaluation, Table
from wrist_stiffness.mechanism.compiled import (
    CompiledWrist,
    Flags,
    compilable,
    native,
)
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.vectors import dot
from wrist_stiffness.model.batch import Recent, predicted
from wrist_stiffness.model.block import Block, Load, Sample
from wrist_stiffness.model.contribution import Constants
from wrist_stiffness.model.effect import Effect, spread_of
from wrist_stiffness.model.evaluation import constant_of, evaluate, home_of
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.prediction import BlockPrediction, Prediction
from wrist_stiffness.model.session import Session
from wrist_stiffness.model.situation import Situation, lengths
from wrist_stiffness.model.users_law import changed_by

IN_F, IN_U = np.zeros(1, dtype=bool), np.ones(1, dtype=bool)


@dataclass(frozen=True)
class ErrorModel:
    """A table and the effects that were added to it.

    Parameters
    ----------
    name : str
        What people call it.
    table : Table
        Elastic lookup of the wrist.
    evaluation : str
        `closed_form` or `spline`.
    effects : tuple of Effect
        In the order in which they entered.
    table_file : path, optional
        Where the table was read.
    lineage : tuple of Step
        How the model came about, oldest first.
    joint : JointUncertainty, optional
        Of the effects that a fit estimated together.

    Raises
    ------
    InputError
        If an effect is there twice, or changes the elastic parts of which a spline knows nothing.
    """

    name: str
    table: Table
    evaluation: Evaluation
    effects: tuple[Effect, ...] = ()
    table_file: Path | None = None
    lineage: tuple[Step, ...] = ()
    joint: JointUncertainty | None = None

    def __post_init__(self) -> None:
        """Check that the effects go together and with the evaluation."""
        names = [effect.name for effect in self.effects]
        for effect in self.effects:
            if names.count(effect.name) > 1:
                raise InputError(f"model {self.name}: {effect.name} is there twice")
            if self.evaluation == "spline" and effect.stage == "parts":
                raise InputError(
                    f"model {self.name}: {effect.name} changes the elastic parts, which needs "
                    "evaluation: closed_form"
                )

    def with_evaluation(self, evaluation: Evaluation) -> ErrorModel:
        """Return the same model with the other evaluation of its table."""
        return replace(self, evaluation=evaluation)

    def with_effects(self, *effects: Effect) -> ErrorModel:
        """Return the model with these effects instead of its own.

        What follows from effects that both have is the same object: so an evaluation knows it.
        """
        other = replace(self, effects=effects)
        if self._of_parts != other._of_parts:
            return other
        known = {id(effect): added for effect, added in self._at_home}
        constants = tuple(
            (each, known.get(id(each)) or constant_of(each, self.home))
            for each in effects
            if each.law.constant
        )
        vars(other).update(parts=self.parts, home=self.home, _at_home=constants)
        vars(other)["_compiled_parts"] = self._compiled_parts
        if {id(effect) for effect, _ in constants} == known.keys():
            vars(other)["constants"] = self.constants
        return other

    @property
    def _of_parts(self) -> list[Effect]:
        return [effect for effect in self.effects if effect.stage == "parts"]

    @cached_property
    def parts(self) -> ElasticComponents:
        """Elastic parts of the table with the effects that change them."""
        parts = self.table.components
        for effect in self._of_parts:
            parts = changed_by(effect, parts)
        return parts

    @cached_property
    def home(self) -> Situation:
        """The wrist with these parts at home, unloaded and at rest."""
        return home_of(self.table, self.parts)

    @cached_property
    def _at_home(self) -> tuple[tuple[Effect, Constants], ...]:
        """What each constant effect adds."""
        return tuple((e, constant_of(e, self.home)) for e in self.effects if e.law.constant)

    @cached_property
    def constants(self) -> Constants:
        """What the constant effects add together."""
        return sum((added for _, added in self._at_home), Constants())

    @cached_property
    def changing(self) -> dict[str, list[int]]:
        """Positions of the effects that are neither constant nor of the elastic parts, by stage."""
        found: dict[str, list[int]] = {}
        for n, effect in enumerate(self.effects):
            if not (effect.law.constant or effect.stage == "parts"):
                found.setdefault(effect.stage, []).append(n)
        return found

    @cached_property
    def _load_shares(self) -> tuple[float | None, ...]:
        """What the changing effects add as a share of the said load, None for anything else."""
        changing = [self.effects[n] for own in self.changing.values() for n in own]
        return tuple(None if e.law.foreign else e.law.load_share(e.si) for e in changing)

    @cached_property
    def compiled(self) -> CompiledWrist | None:
        """The closed form with all that is constant, compiled; None where that cannot be had."""
        if self._compiled_parts is None:
            return None
        own = self.constants
        scale = 1.0 + sum(share or 0.0 for share in self._load_shares)
        return self._compiled_parts.with_constants(own.screws, own.gap, scale, own.wrench)

    @cached_property
    def _compiled_parts(self) -> CompiledWrist | None:
        if self.evaluation == "spline" or not compilable(self.parts):
            return None
        return CompiledWrist(
            self.table.workspace.constants, self.parts, self.table.geometry.gravity
        )

    @cached_property
    def variations(self) -> tuple[ErrorModel, ...]:
        """The model with each uncertain parameter moved as `Effect.varied` moves it.

        Those of effects in `joint` are left out.
        """
        together = () if self.joint is None else self.joint.effects
        return tuple(
            self.with_effects(*self.effects[:number], other, *self.effects[number + 1 :])
            for number, effect in enumerate(self.effects)
            if effect.name not in together
            for other in effect.varied
        )

    @cached_property
    def relative_error(self) -> float:
        """Error of the table over the whole domain, relative to the size of s and of phi [-].

        A spline errs most outside the operative workspace, of which alone the table's own statement
        speaks, and a model may use the spline of a table that was made for the closed form.
        """
        errors = self.table.header.errors
        if self.evaluation == "closed_form":
            return float(errors["stated_relative"])
        # Added up they are no less than what is stated for the parts together.
        parts = sum(
            errors.get(f"{part}_relative", 0.0)
            for part in ("mesh", "contact", "walls", "second_order")
        )
        return float(parts + max(errors["predicted"]["domain"].values()))

    @cached_property
    def certain(self) -> bool:
        """Whether no parameter adds to the covariance."""
        return self.joint is None and not self.variations

    def session(self) -> Session:
        """Return a fresh memory for a stream of samples."""
        return Session(self)

    def predict(
        self, theta: Array, load: Load, active: NDArray[np.bool_] | None = None
    ) -> Prediction:
        """Predict the pose error of one sample, at rest and with nothing before it.

        Parameters
        ----------
        theta : (2,) float
            Motor angles [rad].
        load : Load
            What acts on the platform, own weight aside.
        active : (m,) bool, optional
            First guess of the flange sectors in contact; changes the cost, not the result beyond
            rounding.

        Returns
        -------
        Prediction
            Twist, covariance and contact state.

        Raises
        ------
        UnreachablePoseError, SingularPoseError
            If the pose is outside the table's domain.
        LoadRangeError
            If the load is outside the table's range.
        """
        if not self.stateless:
            return self.session().advance(Sample(0.0, theta, load))
        theta, compiled = np.asarray(theta, dtype=float), self.compiled
        if compiled is not None:
            closed = np.zeros(compiled.sectors, dtype=bool) if active is None else active.copy()
            in_u = IN_U if load.on_platform else IN_F
            wrench = np.asarray(load.wrench, dtype=float, order="C")
            rows = compiled.predict(theta, wrench, in_u, closed, None)
            if not rows.status[0]:
                twist, row, states, _ = rows
                return self.prediction_of(twist[0], row[0], states[0], load)
        # The formulas for blocks say what is wrong.
        configuration = self.table.workspace.configuration(theta)
        self.table.check_load(load.wrench)
        found = evaluate(self, Sample(0.0, theta, load).block, None)
        return self.prediction_of(found.twist[0], configuration.row, found.active[0], load)

    def prediction_of(self, twist: Array, row: Array, active: Flags, load: Load) -> Prediction:
        """Return the prediction that these numbers belong to.

        `twist` (6,): of the platform at O in F [m, rad]; `row` (66,): as `Configuration.of_row`
        takes it; `active` (m,): sectors in contact; `load`: on the platform.
        """
        configuration = Configuration.of_row(row)
        of_parameters = None
        if not self.certain:

            def of_parameters() -> Array:
                theta = configuration.theta
                moved = [other.predict(theta, load, active).twist for other in self.variations]
                return self.parameter_covariance(twist, moved)

        constants = self.constants
        return Prediction(
            twist,
            configuration,
            active,
            self.table_covariance,
            constants.sensor(configuration),
            of_parameters,
            warnings=constants.warnings,
        )

    @cached_property
    def stateless(self) -> bool:
        """Whether no sample depends on another, nor an effect on what others do."""
        if self.evaluation == "spline":
            return not self.effects
        return None not in self._load_shares

    def parameter_covariance(self, twist: Array, moved: Sequence[Array]) -> Array:
        """Covariance (6, 6) from the parameters: those fitted together, and the variations.

        `twist` (6,): predicted [m, rad]; `moved`, (6,) each: the same as each of `variations`
        predicts it [m, rad].  Translation first, in F.
        """
        spread = spread_of(twist, moved)
        alone: Array = spread.T @ spread
        return alone if self.joint is None else alone + self.joint.covariance

    def batch(self, block: Block) -> BlockPrediction:
        """Predict the pose error of a whole recording, in bounded memory.

        Parameters
        ----------
        block : Block
            n samples.

        Returns
        -------
        BlockPrediction
            The same as a session's predictions sample by sample.
        """
        return self.batch_with(block, [()])[0]

    def batch_with(
        self,
        block: Block,
        additions: Sequence[Sequence[Effect]],
        recent: Recent | None = None,
        slopes: bool = False,
    ) -> list[BlockPrediction]:
        """Predict a whole recording once for each of several additions to the model's effects.

        What the models have in common is computed once; so a row of candidates costs far less than
        as many batches.

        Parameters
        ----------
        block : Block
            n samples.
        additions : sequence of sequences of Effect
            Further effects of each model; an empty one for the model as it is.
        recent : Recent, optional
            What was done at this block the last time: it changes the cost alone.
        slopes : bool
            Whether the models differ from the first one by little, for slopes: then constants are
            carried to first order, which is far quicker.

        Returns
        -------
        list of BlockPrediction
            One for each addition.
        """
        first = self.with_effects(*self.effects, *additions[0])
        if recent is not None:
            first = recent.like(first)
        models = [first, *(first.with_effects(*self.effects, *e) for e in additions[1:])]
        return predicted(models, block, self.accepts(block), recent, slopes)

    def accepts(self, block: Block) -> NDArray[np.bool_]:
        """Tell which samples of a block are finite, in the domain and in the load range, (n,)."""
        limits = self.table.geometry.limits
        finite = np.isfinite(block.time) & np.isfinite(block.theta).all(axis=1)
        if block.theta_dot is not None:
            finite &= np.isfinite(block.theta_dot).all(axis=1)
        finite[finite] = self.table.workspace.domain(block.theta[finite])
        force, moment = lengths(block.load[:, :3]), lengths(block.load[:, 3:])
        most_force, most_moment = limits.most_load
        return finite & (force <= most_force) & (moment <= most_moment)

    def table_covariance(self, configuration: Configuration, twist: Array) -> Array:
        """Variance of the table's stated error and of an encoder count spread over its step.

        `configuration`: of one pose, or of rows; `twist` (..., 6): predicted there [m, rad].  Gives
        (..., 6, 6): translation first, in F.
        """
        covariance = np.zeros((*twist.shape, 6))
        of_size = self.relative_error**2 / 3.0
        of_step = self.table.geometry.limits.encoder_step**2 / 12.0
        if native is not None:
            own = self.table.workspace.constants, configuration.row, twist
            native.table_covariance(*own, covariance, of_size, of_step)
            return covariance
        jacobian = self.table.mechanism.jacobian(configuration)
        covariance[..., 3:, 3:] = of_step * (jacobian @ np.swapaxes(jacobian, -1, -2))
        for half in (slice(0, 3), slice(3, 6)):
            square = dot(twist[..., half], twist[..., half])
            covariance[..., half, half] += of_size * square[..., None, None] * np.eye(3)
        return covariance


__all__ = ["ErrorModel", "Load", "Prediction"]
