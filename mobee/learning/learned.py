"""What an agent had learned by the end of its record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mobee.errors import MobeeError, UnknownName
from mobee.learning.recorded import space_from
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.store import TransitionStore


@dataclass(frozen=True, slots=True)
class Learned:
    """The space and model of an agent, rebuilt from its transitions."""

    part: str
    space: Space
    model: TransitionModel
    transitions: int
    state: int
    """Where it was last."""


def load_learned(file: str | Path, part: str | None = None, robot: Robot | None = None) -> Learned:
    """Rebuild what the agent of a part learned from its transitions on disk.

    Args:
        file: of a TransitionStore.
        part: whose; needed where the file holds several.
        robot: whose space it is; needed where it is none that comes with mobee.

    Raises:
        MobeeError, UnknownName: no such file or agent, nothing to learn from, or a robot that is not the one on record.
    """
    if not Path(file).is_file():
        raise MobeeError(
            f"{file}: there is no such file; runs of `mobee launch` keep their transitions so. Experiments keep cells, without a model to "
            "plan with; `mobee export` reads both."
        )
    with TransitionStore(file, part or "", read_only=True) as store:
        agents = store.agents()
        if not agents:
            raise MobeeError(f"{file} holds no transitions yet.")
        if part is None and len(agents) > 1:
            raise MobeeError(f"{file} holds several agents: name one of {', '.join(agents)}.")
        name = agents[0] if part is None else part
        if name not in agents:
            raise UnknownName("agent", name, agents)
        settings, made = store.settings(name), store.load(name)
    if "space" not in settings:
        raise MobeeError(f"{file}: {name} has no space on record; it was not a curious agent that wrote this.")
    space = space_from(settings["space"], robot if robot is not None else load_robot(settings["space"]["robot"]))
    known = {key: settings[key] for key in ("initial", "divergence", "forgetting") if key in settings}
    model = TransitionModel(space, **known)
    for transition in made:
        model.observe(transition.s, transition.a, transition.s_next)
    return Learned(name, space, model, len(made), made[-1].s_next)
