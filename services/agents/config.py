# SPDX-License-Identifier: Apache-2.0
"""Configuration of an agent: the settings of the library's agents, and the task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import prod
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS
from mobee.learning.lattice import Lattice
from mobee.learning.learner import CuriousSettings
from mobee.learning.object_space import Grid, ObjectSpace
from mobee.learning.reaching.learner import ReachSettings
from mobee.learning.reaching.predictors import PREDICTORS
from mobee.learning.reaching.strategies import STRATEGIES
from mobee.learning.space import MAX_STATES, Space
from mobee.learning.transitions import DIVERGENCES
from mobee.reach import RADIUS
from mobee.robot.robot import Robot
from mobee.settings import Range, Settings, hints_of, require_name
from services.common.config import ServiceConfig
from services.common.hands import hand_of, moved_markers

ARM_JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
NAMED: dict[str, Mapping[str, object]] = {"explorer": EXPLORERS, "divergence": DIVERGENCES, "predictor": PREDICTORS, "strategy": STRATEGIES}
TASK = ("goal", "goal_weight")  # settings of other types in a file, see Config


def _of_file(hint: Any) -> Any:
    """Return the type of a setting in a scenario file, made from the type hint of the setting in the library.

    A setting for which the library takes a name or an object is text (str). The bounds of a `Range` are translated to those of msgspec.
    """
    if str in get_args(hint):
        return str
    kind, *valid = get_args(hint) if hasattr(hint, "__metadata__") else (hint,)
    bounds = [{name: getattr(one, name) for name in ("ge", "gt", "le", "lt")} for one in valid if isinstance(one, Range)]
    return Annotated[kind, Meta(**bounds[0])] if bounds else kind


def _fields_of(settings: type[Settings]) -> dict[str, tuple[str, Any, Any]]:
    """Return name, type and default of each setting."""
    hints = hints_of(settings)
    return {one.name: (one.name, _of_file(hints[one.name]), one.default) for one in fields(settings) if one.name not in TASK}


if TYPE_CHECKING:
    LearningConfig = ServiceConfig
else:  # a field for each setting of the library's agents; `seed` is one of every service
    _FIELDS = _fields_of(ReachSettings) | _fields_of(CuriousSettings)
    _FIELDS.pop("seed")
    LearningConfig = msgspec.defstruct(
        "LearningConfig", _FIELDS.values(), bases=(ServiceConfig,), frozen=True, kw_only=True, module=__name__
    )
    LearningConfig.__doc__ = "\n".join([ReachSettings.__doc__, *CuriousSettings.__doc__.partition("Args:\n")[2:]])


class Config(LearningConfig, frozen=True, kw_only=True):
    """The configuration of an agent. The joints default to the published ones of the agent's part (thesis 7.4)."""

    part: str = "left_arm"
    """Part that the agent moves."""
    joints: tuple[str, ...] = ()
    """Motors that span the state space. Empty: those that `levels` names; if it names none, all motors of the part, or shoulder and elbow
    of a part that has a motor called elbow."""
    levels: tuple[float, ...] | Mapping[str, tuple[float, ...]] = (0.25, 0.5, 0.75)
    """Fractions of each joint's range at which the states lie; or the fractions for each joint, as { l_elbow = [0.5, 0.8] }."""
    neighbours: Annotated[int, Meta(ge=0)] | Literal["equidistant"] = 0
    """Number of nearest states to which each state has actions, or "equidistant": the states one step away along one joint. 0: the
    published numbers, 8 for the torso and 16 for an arm."""
    tie_seed: int = 0
    """Seed of the random choice among neighbours at the same distance."""
    goal: tuple[Annotated[int, Meta(ge=0)], ...] = ()
    """Numbers of the states in which every action is rewarded; empty: there is no such reward, only the information gain."""
    goal_weight: float = 0.0
    """Reward of an action in a state of `goal`, nats, which is added to the information gain; 0: the reward is 1 and replaces the
    information gain."""
    run_dir: str = ""
    """Folder of the run, in which transitions are stored and from which a restarted agent reads them; empty: they are not stored."""
    continues: str = ""
    """File of transitions, or folder of a run, such as one learned offline, from which the agent starts if it has no transitions of its
    own."""
    rest: tuple[float, ...] = ()
    """Fraction of its range at which each motor of the part stays if it is not one of `joints`; empty: the middle."""
    object: str = ""
    """Name of an object in the model's world whose position is a part of each state; empty: a state is a posture alone."""
    area: tuple[tuple[float, float], ...] = ()
    """Where the object may be: lowest and highest x, and lowest and highest y of its centre, m, root frame."""
    cells: tuple[int, int] = (3, 3)
    """Number of cells along x and along y into which the area is divided. A state contains the cell in which the object is."""
    aside: Annotated[int, Meta(ge=0)] = 0
    """Number, from 0, of the posture of the state space to which the part moves when the object is not seen. In this posture the robot must
    not hide the object, and must leave room for it."""
    put_back: tuple[float, ...] = ()
    """Position, m, root frame, at which the simulator sets the object down when it is not seen from `aside` either; empty: a person puts it
    back."""
    transitions: Annotated[int, Meta(ge=0)] = 0
    """Number of transitions after which the agent ends; 0: no limit."""
    targets: tuple[tuple[float, float, float], ...] = ()
    """Positions for which the agent learns to reach, m, root frame; empty: it explores its space."""
    target_radius: Annotated[float, Meta(gt=0)] = RADIUS
    """Radius of the sphere that is presented at a target position, m."""
    marker: str = ""
    """Marker that reaches for the targets; empty: the palm of the part, otherwise the first marker at the end of its chain."""
    learned: str = ""
    """Folder of a run whose transitions are used to plan paths to reaches; empty: the agent assumes that most actions reach their goals."""
    tries: Annotated[int, Meta(ge=0)] = 0
    """Number of problem-tries (attempts to reach one target) after which the agent ends; 0: no limit."""

    def check_robot(self, robot: Robot) -> None:
        """Check the settings for the robot.

        Raises MobeeError if a name is unknown, if no state space of the part can be made from the settings, or if the part does not move
        the marker that is to reach for the targets.
        """
        super().check_robot(robot)
        for kind, table in NAMED.items():
            require_name(kind, getattr(self, kind), table)
        if not self.learned:  # else the space is read from that run
            self.space(robot)
        self._check_object()
        if not self.targets:
            return
        marker = self.marker or hand_of(robot, self.part)
        if marker not in moved_markers(robot, self.part):
            valid = ", ".join(moved_markers(robot, self.part))
            raise InvalidValue(f"{self.part} does not move the marker {marker!r} that is to reach. Valid: {valid or 'none'}.")

    def curious(self) -> CuriousSettings:
        """Return the settings of a curious agent, as the library takes them."""
        return CuriousSettings(goal=self.goal or None, goal_weight=self.goal_weight or None, **self._given(CuriousSettings))

    def reaching(self) -> ReachSettings:
        """Return the settings of an agent that learns to reach, as the library takes them."""
        return ReachSettings(**self._given(ReachSettings))

    def space(self, robot: Robot) -> Space:
        """Make the state space; raises MobeeError if the settings are not valid.

        By default the states are the postures of the lattice of thesis 7.4 for the part. With an `object`, each state is a pair of such a
        posture and a cell of the object's area.
        """
        postures = self._postures(robot)
        if not self.object:
            return postures
        if len(self.area) != 2:
            given = [list(one) for one in self.area]
            raise InvalidValue(f"area = {given}: give [[low, high], [low, high]] of x and y in m, for {self.object}.")
        space = ObjectSpace(postures, Grid(*self.area, self.cells), self.object)
        postures.target(self.aside)
        return space

    def _postures(self, robot: Robot) -> Lattice:
        part = robot.part(self.part)
        is_arm = any(name.endswith("elbow") for name in part.motors)
        own = tuple(self.levels) if isinstance(self.levels, Mapping) else ()
        joints = self.joints or own or tuple(name for name in part.motors if not is_arm or name.endswith(ARM_JOINTS))
        sizes = [len(one) for one in self.levels.values()] if isinstance(self.levels, Mapping) else [len(self.levels)] * len(joints)
        count = prod(map(float, sizes))
        if count > MAX_STATES:
            given = f"{sizes[0]} levels of {len(joints)} motors" if len(set(sizes)) == 1 else f"{' x '.join(map(str, sizes))} levels"
            raise InvalidValue(
                f"{given} make {count:.3g} states, and an agent can "
                f"have {MAX_STATES}: choose some motors of {self.part!r}, for example joints = {_listed(joints[:4])}."
            )
        neighbours = self.neighbours or min(16 if is_arm else 8, int(count) - 1)  # the published ones, or all other states
        return Lattice(robot, joints, self.levels, neighbours, tie_seed=self.tie_seed, rest=self.rest or 0.5)

    def _check_object(self) -> None:
        """Raise InvalidValue if the settings of an object contradict each other."""
        if not self.object:
            if self.area or self.put_back:
                raise InvalidValue("area and put_back are settings of an object: name it with object, or leave them out.")
            return
        if self.targets:
            raise InvalidValue(f"object = {self.object!r} is for curious agents, and targets for those that learn to reach: leave one out.")
        if len(self.put_back) not in (0, 3):
            raise InvalidValue(f"put_back = {list(self.put_back)}: give x, y and z of the centre of {self.object} in m, or leave it out.")
        if self.put_back and not all(low <= at <= high for at, (low, high) in zip(self.put_back, self.area, strict=False)):
            raise InvalidValue(f"put_back = {list(self.put_back)} is outside the area {[list(one) for one in self.area]}.")

    def _given(self, settings: type[Settings]) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in fields(settings) if one.name not in TASK}


def _listed(names: tuple[str, ...]) -> str:
    return f"[{', '.join(f'{name!r}' for name in names)}]".replace("'", '"')
