"""Walking on adaptive maps (thesis 4.3): a live part that stops when it begins to touch something, and the launch of a walking service."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from bus_schema import keys
from bus_schema.chain import Commands
from bus_schema.messages import Clock, Forces
from bus_schema.rpc import Request
from experiments.kit.live import summary_of
from mobee.plant import Outcome
from mobee.robot.robot import Array, Robot
from services.common.bus_plant import BusPlant
from services.common.lockstep import Participant
from services.common.service import Service

PATIENCE = 60.0  # s for a tick of lockstep: a path is planned within one
APART = 500_000_000  # ns for which an object must not be felt, so that it is touched anew: at a field's border noise decides

_SCENARIO = """# Written by an experiment of thesis 4.3.
title = "{title}"

[shared]
robot = "icub"
gains = "default"
seed = {seed}
{mode}

[services.robot_sim]
world = "{simulated}"
rate = {rate:g}
record = "{folder}"

[services.model]
world = "{world}"

[services.controller]
speed_scale = {speed:g}

[services.performer]
module = "{module}"
run_dir = "{folder}"
"""


def launch(
    folder: Path,
    module: str,
    *,
    title: str,
    world: str,
    seed: int,
    rate: float,
    speed: float,
    seconds: float,
    lockstep: bool = True,
    simulated: str = "",
) -> dict[str, Any]:
    """Launch the system with that service, which ends it; its record is left in the folder, and its summary returned.

    `rate`: Hz; `speed`: share of the motors' speed; `seconds`: of robot time, after which it is ended; `simulated`: the simulator's world
    where it is not the model's.  Raises LaunchFailed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mode = f'mode = "lock"\npatience = {PATIENCE:g}' if lockstep else ""
    scenario = folder / "scenario.toml"
    values: dict[str, Any] = {"title": title, "world": world, "simulated": simulated or world, "seed": seed, "mode": mode}
    values |= {"rate": rate, "speed": speed, "module": module}
    scenario.write_text(_SCENARIO.format(folder=folder.resolve(), **values))
    limit: dict[str, Any] = {"ticks": round(seconds * rate)} if lockstep else {"duration": seconds}
    return summary_of(str(scenario), runs=folder / "launch", **limit)


class FeelingPlant(BusPlant):
    """A BusPlant whose actions end, not settled, as soon as the model says that the part begins to touch one of some objects.

    In lockstep a second service of the same process, the watcher, takes part in every tick, for a part in motion is sent none;
    it answers a tick when the forces of that tick have been processed, so that decisions on them fall into that tick.

    Args:
        service, robot, part: see BusPlant.
        objects: names of the objects; fields count, so nothing is hit yet.
        watcher: in lockstep, with the inbox of the service; None in free mode.
    """

    def __init__(self, service: Service, robot: Robot, part: str, objects: Collection[str], watcher: Service | None = None) -> None:
        super().__init__(service, robot, (part,))
        self._part, self._objects = part, frozenset(objects)
        self._last = -APART  # ns, when an object was last felt
        self.bump: int | None = None
        """Tick at which the part began to touch an object since its last action was asked for."""
        self.asked = 0
        """Tick at which the last action was asked for."""
        self.commanded = -1
        """Tick in which a command that knows of the last action is first in force, -1: not yet."""
        self.each: Callable[[int], None] = lambda k: None
        """Called with every tick of which the forces have come."""
        self.felt = -1
        """The newest tick of which the forces have come."""
        self._watched = -1
        self._watcher = None if watcher is None else Participant(watcher)
        if watcher is not None:
            watcher.on_clock(self._note_watch)
        service.on_each(keys.MODEL_FORCES, Forces, self._feel)
        service.on_each(keys.COMMANDS, Commands, self._note_commands)

    def act(self, part: str, target: Array) -> Outcome:
        """See FeelingPlant."""
        self.bump = None
        return super().act(part, target)

    def leave(self) -> None:
        """See BusPlant."""
        super().leave()
        if self._watcher is not None:
            self._watcher.done(max(self._watched, 0), last=True)
            self._watcher = None

    def _ask(self, part: str, verb: str, request: type[Request], **fields: object) -> int:
        self.asked, self.commanded = super()._ask(part, verb, request, **fields), -1
        return self.asked

    def _is_over(self, part: str, action_id: str, asked: int) -> bool:
        if super()._is_over(part, action_id, asked):
            return True
        motion = self._motion.get(part)
        return self.bump is not None and motion is not None and motion.action_id == action_id

    def _feel(self, forces: Forces) -> None:
        if not self._objects.isdisjoint(forces.touched.get(self._part, ())):
            if forces.t - self._last > APART and self.bump is None:
                self.bump = forces.re_k
            self._last = forces.t
        self.felt = forces.re_k
        self.each(forces.re_k)

    def _note_commands(self, commands: Commands) -> None:
        """What was asked for in tick k is known to the commands formed of later ones, each of which acts a tick later."""
        if self.commanded < 0 and commands.re_k > self.asked > 0:
            self.commanded = commands.re_k + 1

    def _note_watch(self, clock: Clock) -> None:
        self._watched = clock.k

    def _answer(self) -> None:
        super()._answer()
        if self._watcher is not None and self._watched >= 0 and (self._watched == 0 or self.felt >= self._watched):
            self._watcher.done(self._watched)
            self._watched = -1
