"""Settings of an agent."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS
from mobee.learning.lattice import Lattice
from mobee.learning.named import require_name
from mobee.learning.space import MAX_STATES
from mobee.reach import RADIUS
from mobee.robot.robot import Robot
from services.common.config import ServiceConfig
from services.common.hands import hand_of, moved_markers

ARM_JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")


class Config(ServiceConfig, frozen=True, kw_only=True):
    """An agent's settings; the joints default to the published ones of its part (thesis 7.4)."""

    part: str = "left_arm"
    """The part it moves."""
    joints: tuple[str, ...] = ()
    """Motors that span its state space; empty: all of its part, or shoulder and elbow of a part that has a motor called elbow."""
    levels: tuple[float, ...] = (0.25, 0.5, 0.75)
    """Fractions of each joint's range at which the samples lie."""
    neighbours: Annotated[int, Meta(ge=0)] = 0
    """How many nearest states it can go to; 0: the published 8 of the torso, 16 of an arm."""
    tie_seed: int = 0
    """Seed of the draw among equally near neighbours."""
    explorer: str = "curious"
    """How it chooses: a name of the library, or `module:name` of your own."""
    discount: Annotated[float, Meta(ge=0, lt=1)] = 0.9
    """Of future rewards."""
    initial: Literal["50-50", "60-40"] = "50-50"
    """What it believes of an action before it has tried it."""
    divergence: Literal["kail", "kl"] = "kail"
    """What an outcome is worth: 'Kail' divergence, or plain KL over all states."""
    forgetting: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """Factor of what it counted of an action before each new try of it; below 1 it keeps up with a world that changes."""
    beliefs: Literal["counts", "debiased"] = "counts"
    """What its plans trust: the counts with what it imagined, as published, or without."""
    tolerance: Annotated[float, Meta(gt=0)] = 0.01
    """At which a plan is good enough."""
    relative: bool = True
    """The tolerance is in units of the largest reward, and plans start from the one before; false: as published, with 0.001."""
    goal: tuple[Annotated[int, Meta(ge=0)], ...] = ()
    """States to go to, instead of where curiosity draws it; empty: curiosity alone."""
    goal_weight: float = 0.0
    """Reward of an action in such a state that is added to curiosity's, in nats; 0: the goal replaces curiosity."""
    run_dir: str = ""
    """Folder of the run, where its transitions are kept and found again; empty: they are not kept."""
    transitions: Annotated[int, Meta(ge=0)] = 0
    """End after so many in all; 0: go on indefinitely."""
    targets: tuple[tuple[float, float, float], ...] = ()
    """Places to learn to reach for, m, root frame; empty: it learns its space."""
    target_radius: Annotated[float, Meta(gt=0)] = RADIUS
    """Of what is presented there, m."""
    marker: str = ""
    """What is to come there; empty: the palm of its part, or the marker at an end of the part that most motors move."""
    predictor: str = "weighted"
    """Of the rewards of reaching."""
    strategy: str = "intrinsic"
    """What it pursues while it learns to reach."""
    failures: Literal["spread", "local", "alike"] = "spread"
    """How transitions that failed are remembered: for all targets, for those nearby, or as a hint to transitions like them."""
    learned: str = ""
    """Folder of a run whose transitions it plans its ways to reaches with; empty: it believes that most actions work."""
    tries: Annotated[int, Meta(ge=0)] = 0
    """End after so many problem-tries in all; 0: go on indefinitely."""

    def check_robot(self, robot: Robot) -> None:
        """As ServiceConfig: the part must span a state space, have a marker to reach with if there are targets, and what is named exist."""
        super().check_robot(robot)
        require_name("explorer", self.explorer, EXPLORERS)
        if not self.learned:  # else the space is that of the record
            self.space(robot)
        if not self.targets:
            return
        marker = self.marker or hand_of(robot, self.part)
        if marker not in moved_markers(robot, self.part):
            valid = ", ".join(moved_markers(robot, self.part))
            raise InvalidValue(f"{self.part} does not move the marker {marker!r} that is to reach. Valid: {valid or 'none'}.")

    def space(self, robot: Robot) -> Lattice:
        """The lattice of thesis 7.4 for the part, unless the settings say otherwise; raises MobeeError where it cannot be made."""
        part = robot.part(self.part)
        is_arm = any(name.endswith("elbow") for name in part.motors)
        joints = self.joints or tuple(name for name in part.motors if not is_arm or name.endswith(ARM_JOINTS))
        if len(self.levels) ** len(joints) > MAX_STATES:
            raise InvalidValue(
                f"{len(self.levels)} levels of {len(joints)} motors make {len(self.levels) ** len(joints):.3g} states, and an agent can "
                f"have {MAX_STATES}: choose some motors of {self.part!r}, for example joints = {_listed(joints[:4])}."
            )
        return Lattice(robot, joints, self.levels, self.neighbours or (16 if is_arm else 8), tie_seed=self.tie_seed)


def _listed(names: tuple[str, ...]) -> str:
    return f"[{', '.join(f'{name!r}' for name in names)}]".replace("'", '"')
