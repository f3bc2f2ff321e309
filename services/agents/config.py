# SPDX-License-Identifier: Apache-2.0
"""Configuration of an agent: the settings of the library's agents, and the task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, get_args

import msgspec
from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS
from mobee.learning.lattice import Lattice
from mobee.learning.learner import CuriousSettings
from mobee.learning.reaching.learner import ReachSettings
from mobee.learning.reaching.predictors import PREDICTORS
from mobee.learning.reaching.strategies import STRATEGIES
from mobee.learning.space import MAX_STATES
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
    """Return the type of a setting in a scenario file: text if the library takes a name or an object; bounds in msgspec's form."""
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
    """An agent's configuration; the joints default to the published ones of its part (thesis 7.4)."""

    part: str = "left_arm"
    """Part that the agent moves."""
    joints: tuple[str, ...] = ()
    """Motors that span the state space; empty: all of the part, or shoulder and elbow of a part that has a motor called elbow."""
    levels: tuple[float, ...] = (0.25, 0.5, 0.75)
    """Fractions of each joint's range at which the samples lie."""
    neighbours: Annotated[int, Meta(ge=0)] = 0
    """Number of nearest states that each state has actions to; 0: the published 8 of the torso, 16 of an arm."""
    tie_seed: int = 0
    """Seed of the draw among equally near neighbours."""
    goal: tuple[Annotated[int, Meta(ge=0)], ...] = ()
    """States whose actions are rewarded, instead of information gain; empty: curiosity alone."""
    goal_weight: float = 0.0
    """Reward of an action in such a state, nats, added to the information gain; 0: it replaces the information gain."""
    run_dir: str = ""
    """Folder of the run, in which transitions are stored and from which a restarted agent reads them; empty: they are not stored."""
    continues: str = ""
    """File of transitions, or folder of a run, with which it begins if it has none of its own, as those learned offline; it is recorded."""
    rest: tuple[float, ...] = ()
    """Fraction of its range at which each motor of its part stays while it is not one of `joints`; empty: the middle."""
    transitions: Annotated[int, Meta(ge=0)] = 0
    """Number of transitions after which the agent ends; 0: no limit."""
    targets: tuple[tuple[float, float, float], ...] = ()
    """Positions for which the agent learns to reach, m, root frame; empty: it explores its space."""
    target_radius: Annotated[float, Meta(gt=0)] = RADIUS
    """Radius of the sphere that is presented at a target position, m."""
    marker: str = ""
    """Marker that reaches for the targets; empty: the palm of the part, or the marker that most motors of the part move."""
    learned: str = ""
    """Folder of a run whose transitions are used to plan paths to reaches; empty: most actions are assumed to reach their goals."""
    tries: Annotated[int, Meta(ge=0)] = 0
    """Number of problem-tries after which the agent ends; 0: no limit."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if a name is unknown, the part spans no state space, or it has no marker for the targets."""
        super().check_robot(robot)
        for kind, table in NAMED.items():
            require_name(kind, getattr(self, kind), table)
        if not self.learned:  # else the space is read from that run
            self.space(robot)
        if not self.targets:
            return
        marker = self.marker or hand_of(robot, self.part)
        if marker not in moved_markers(robot, self.part):
            valid = ", ".join(moved_markers(robot, self.part))
            raise InvalidValue(f"{self.part} does not move the marker {marker!r} that is to reach. Valid: {valid or 'none'}.")

    def curious(self) -> CuriousSettings:
        """Return the settings of a curious agent."""
        return CuriousSettings(goal=self.goal or None, goal_weight=self.goal_weight or None, **self._given(CuriousSettings))

    def reaching(self) -> ReachSettings:
        """Return the settings of a reach agent."""
        return ReachSettings(**self._given(ReachSettings))

    def space(self, robot: Robot) -> Lattice:
        """Make the lattice, by default that of thesis 7.4 for the part; raises MobeeError if the settings make none."""
        part = robot.part(self.part)
        is_arm = any(name.endswith("elbow") for name in part.motors)
        joints = self.joints or tuple(name for name in part.motors if not is_arm or name.endswith(ARM_JOINTS))
        if len(self.levels) ** len(joints) > MAX_STATES:
            raise InvalidValue(
                f"{len(self.levels)} levels of {len(joints)} motors make {len(self.levels) ** len(joints):.3g} states, and an agent can "
                f"have {MAX_STATES}: choose some motors of {self.part!r}, for example joints = {_listed(joints[:4])}."
            )
        return Lattice(robot, joints, self.levels, self._neighbours(len(joints), is_arm), tie_seed=self.tie_seed, rest=self.rest or 0.5)

    def _neighbours(self, joints: int, is_arm: bool) -> int:
        """Return the number of neighbours: as set, else the published one, or all other states if there are fewer."""
        return self.neighbours or min(16 if is_arm else 8, len(self.levels) ** joints - 1)

    def _given(self, settings: type[Settings]) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in fields(settings) if one.name not in TASK}


def _listed(names: tuple[str, ...]) -> str:
    return f"[{', '.join(f'{name!r}' for name in names)}]".replace("'", '"')
