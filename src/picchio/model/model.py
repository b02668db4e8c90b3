"""The model: a robot, and what it is taken to do under the tool."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.recent import Recent
from picchio.core.shown import Shown
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.pulse_train import PulseTrain
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Where
from picchio.model.effects.registry import from_dict
from picchio.model.linear_system import LinearSystem, modal_damping_matrix
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike

if TYPE_CHECKING:
    import pandas

    from picchio.model.geometry import Geometry
    from picchio.model.plant import Plant
    from picchio.model.sensing import Sensors
    from picchio.robot.dynamics.statics import RobotState
    from picchio.robot.flexible_robot import FlexibleRobot

ModelLike: TypeAlias = "RobotLike | Model"
"""What goes wherever a robot goes, or a model of one."""
_STRUCTURAL = ("structure", "over-time", "nonlinear")
# In which order effects are applied: what a later one reads, an earlier one has changed.
_ORDER = ("structure", "over-time", "nonlinear", "blows", "sensor", "motion")


@dataclass(frozen=True, eq=False)
class Model(Shown):
    """A robot as a vibrating system.

    Attributes:
        robot: geometry, masses and springs.
        gravity_stiffness: whether the springs' stiffness is joined by gravity's, dg/dq: about
            the loaded equilibrium the stiffness is K + dg/dq. Small for life (below 1 % on
            the 3-DoF arm), decisive when a simulation is held against a measurement.
        gravity_balanced: whether something beside the drives (a spring, a cylinder, a second
            arm) carries all of gravity, so that it leaves no torque in shaft and reducer. A
            balancer that is known belongs into the sidecar instead.
        effects: how the world departs from the robot's files; those of a saved model come first.
        geometries: where those of poses are kept, for what looks at the same poses once more.
    """

    LACKS: ClassVar = {"plot": "plot its robot, or a result"}

    robot: FlexibleRobot
    gravity_stiffness: bool = False
    gravity_balanced: bool = False
    effects: tuple[Effect, ...] = ()
    own: tuple[Effect, ...] = field(default=(), repr=False)
    geometries: Recent[Geometry] | None = field(default=None, repr=False)
    _keys: dict[tuple[Where, ...], tuple[object, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "robot", load_robot(self.robot))
        if self.robot.effect_tables and not self.own:
            try:
                own = tuple(from_dict(table, self.robot) for table in self.robot.effect_tables)
            except InputError as error:  # a saved model is the last file that was read
                raise error.placed(file=next(reversed(self.robot.files), None)) from None
            object.__setattr__(self, "own", own)
            object.__setattr__(self, "effects", (*own, *self.effects))

    @classmethod
    def of(
        cls,
        robot: ModelLike,
        *,
        gravity_stiffness: bool | None = None,
        gravity_balanced: bool | None = None,
        **loading: Any,
    ) -> Model:
        """The model itself, or that of a robot; a switch that is given overrides the model's.

        Args:
            robot: a robot as `load_robot` takes it (with the effects it was saved with), or a
                model, which is loaded already.
            gravity_stiffness: see the class; of a robot what its fit assumed, else off.
            gravity_balanced: likewise.
            **loading: how `load_robot` loads it, such as `flex`.
        """
        if not isinstance(robot, Model):
            loaded = load_robot(robot, **loading)
            model = cls(loaded, loaded.adds_gravity(gravity_stiffness, usual=False))
        else:
            model = robot
        if gravity_stiffness is not None:
            model = replace(model, gravity_stiffness=gravity_stiffness)
        if gravity_balanced is not None:
            model = replace(model, gravity_balanced=gravity_balanced)
        return model

    def with_effects(self, effects: Iterable[Effect]) -> Model:
        """The same robot, and the effects it was saved with, with these effects.

        Args:
            effects: beside those the robot was saved with; they replace any added since.
        """
        return replace(self, effects=(*self.own, *effects))

    def _seen(self) -> dict[str, Any]:
        return {"robot": self}

    def to_frame(self) -> pandas.DataFrame:
        """Its robot's joints as a table."""
        return self.robot.to_frame()

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        facts = {
            "gravity stiffness": self.gravity_stiffness,
            "gravity balanced": self.gravity_balanced,
            "effects": "; ".join(map(repr, self.effects)) or "none",
        }
        names = ", ".join(dict.fromkeys(effect.name for effect in self.effects))
        head = names or "no effects"
        return sheet(f"Model of {self.robot.name}", facts, head=head) + self.robot._repr_html_()

    def holding_torque(self, state: RobotState) -> FloatArray:
        """The torque (n,) that the joints hold against gravity, N m (N).

        Args:
            state: of the robot at a pose.
        """
        return (
            np.zeros_like(state.gravity_torque) if self.gravity_balanced else state.gravity_torque
        )

    def key(self, *where: Where) -> tuple[object, ...]:
        """What the effects of some kinds are: models with the same key do the same there.

        Args:
            *where: kinds of effects, such as "structure".
        """
        found = self._keys.get(where)
        if found is None:
            found = self._keys[where] = tuple(e.key for e in self.effects if e.where in where)
        return found

    @cached_property
    def ordered(self) -> list[Effect]:
        """The effects in the order in which they are applied."""
        return sorted(self.effects, key=lambda effect: _ORDER.index(effect.where))

    @property
    def moving(self) -> bool:
        """Whether any effect changes the motion, and not only what a sensor reads of it."""
        return any(e.where not in ("sensor", "motion") for e in self.effects)

    @property
    def nonlinear(self) -> bool:
        """Whether the response is not proportional to the force."""
        return any(effect.where == "nonlinear" for effect in self.effects)

    def plant(self, geometry: Geometry, conditions: Conditions | None = None) -> Plant:
        """The equations of motion about a pose, with the effects in them.

        Args:
            geometry: of the robot at the pose.
            conditions: when and how warm, and in which record.

        Raises:
            InputError: an effect whose target the robot does not have.
        """
        changing = [effect for effect in self.ordered if effect.where in _STRUCTURAL]
        return self._changed(geometry, conditions or Conditions(), changing)

    def _changed(
        self, geometry: Geometry, conditions: Conditions, effects: Sequence[Effect]
    ) -> Plant:
        """A plant with effects: of many that differ in the last one, the rest is made once."""
        from picchio.model.plant import Plant

        if not effects:
            return Plant(geometry, self.gravity_stiffness, conditions)
        *known, newest = effects
        when = conditions if any(effect.where == "over-time" for effect in known) else None
        key = (tuple(effect.key for effect in known), self.gravity_stiffness, when)
        begun = geometry.begun.get(key, lambda: self._changed(geometry, conditions, known))
        plant = begun.copy(conditions)
        newest.structure(plant)
        return plant

    def blows(self, blows: Blows, conditions: Conditions | None = None) -> Blows:
        """The blows with the effects in them.

        Args:
            blows: as programmed.
            conditions: when and how warm, and in which record.
        """
        for effect in self.ordered:
            blows = effect.blows(blows, conditions or Conditions())
        return blows

    def sensors(self, conditions: Conditions | None = None) -> Sensors:
        """The sensors with the effects in them.

        Args:
            conditions: when and how warm, and in which record.
        """
        from picchio.model.sensing import Sensors

        sensors = Sensors()
        for effect in self.ordered:
            effect.sense(sensors, conditions or Conditions())
        return sensors

    def force(self, excitation: Excitation, hits: int | None) -> PiecewiseForce:
        """The force F(t) with the effects in it: a burst, or one period of the steady train.

        Args:
            excitation: the blows as programmed.
            hits: of the burst; None for the steady train.

        Raises:
            InputError: an effect that has no steady state.
        """
        if hits is None:
            self.refuse("steady state")
        if not self.changes_blows:
            return excitation.one_period() if hits is None else excitation.burst(hits)
        blows = Blows.of(excitation, hits, np.array([0.0, 0.0, 1.0]))
        return self.blows(blows).force()

    def force_directions(self, tool_rotation: FloatArray) -> FloatArray:
        """What becomes of the programmed force direction: (3, 3), actual = matrix @ programmed.

        Args:
            tool_rotation: (3, 3), the tool frame's axes at rest, world.
        """
        if not self.changes_blows:
            return np.eye(3)
        still = PulseTrain(force=1.0, period=1.0, width=0.5)
        columns = [
            self.blows(Blows.of(still, 1, axis).change(tool_rotation=tool_rotation))
            for axis in np.eye(3)
        ]
        return np.array([blows.direction for blows in columns]).T

    @property
    def changes_blows(self) -> bool:
        """Whether any effect changes the blows."""
        return any(effect.where == "blows" for effect in self.effects)

    @property
    def changes_structure(self) -> bool:
        """Whether any effect changes the equations of motion."""
        return any(effect.where in _STRUCTURAL for effect in self.effects)

    def refuse(self, question: str) -> None:
        """Raise if an effect declares that a question has no answer.

        Args:
            question: a study or view, such as "map".

        Raises:
            InputError: with the effect and its reason.
        """
        for effect in self.effects:
            if question in effect.refused:
                raise InputError(f"no {question}: {effect.refused[question]}", value=effect.label)

    def without_load(self, conditions: Conditions | None = None) -> tuple[str, ...]:
        """The effects that leave the loads under the tool alone, a sentence each.

        Args:
            conditions: when and how warm, and in which record.
        """
        reasons = [(e.label, e.without_load(conditions or Conditions())) for e in self.effects]
        return tuple(f"{label} {reason}" for label, reason in reasons if reason is not None)

    def geometry(self, pose: FloatArray) -> Geometry:
        """Masses and kinematics at a pose, to second order; models of one robot share it.

        Args:
            pose: (nv,) rad or m.

        Returns:
            one that is kept, if any is.
        """
        from picchio.model.geometry import Geometry

        def make() -> Geometry:
            return Geometry.of(self.robot, pose)

        if self.geometries is None:
            return make()
        return self.geometries.get((id(self.robot), pose.tobytes()), make)

    def linear_system(self, pose: FloatArray) -> LinearSystem:
        """The linear equations of motion at a pose.

        Nonlinear effects are left out of it: `picchio.vibration.integration.integrate` has them.

        Args:
            pose: (nv,) rad or m.

        Raises:
            InputError: wrong length, a singular mass matrix.
        """
        if self.changes_structure:
            return self.plant(self.geometry(pose)).build(np.array([0.0, 0.0, 1.0])).linear()
        state = self.robot.state(pose)
        springs = state.stiffness
        damping = modal_damping_matrix(state.mass_matrix, springs, self.robot.damping_ratio)
        stiffness = np.diag(springs)
        if self.gravity_stiffness:
            gravity = self.robot.gravity_stiffness(pose)
            # At a pose that no static torque but the springs' holds, dg/dq is symmetric:
            # it is the Hessian of the potential energy. Rounding is taken out.
            stiffness = stiffness + 0.5 * (gravity + gravity.T)
        names = self.robot.flexible_names
        return LinearSystem(
            state.mass_matrix, damping, stiffness, state.jacobian.T, np.eye(len(names)), names
        )
