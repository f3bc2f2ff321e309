"""The reaches of an offline plant: drawn to the target, then drawn back, and how each ended (thesis 8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.world_object import sphere
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachTarget

if TYPE_CHECKING:
    from mobee.control import Controller
    from mobee.model.model import Model
    from mobee.model.pose import Pose


@dataclass(slots=True, eq=False)
class Reach:
    """One reach.  `end` and `marker`: how the part was when the force ended, and where its marker, (3,) m; None as long as it acts."""

    name: str
    stay: bool
    end: Outcome | None = None
    marker: Array | None = None
    missing: float = 0.0  # m


class ReachesUnderWay:
    """Which parts reach, for what is presented."""

    def __init__(self, model: Model, controller: Controller) -> None:
        self._model, self._controller = model, controller
        self._target: ReachTarget | None = None
        self._under_way: dict[str, Reach] = {}
        self._ended: dict[str, ReachOutcome] = {}
        self._told: dict[str, Outcome] = {}  # how parts came to rest, until somebody asks
        self.exempt: str | None = None
        """A marker whose hand ignores the targets although it is not drawn to one."""

    @property
    def reaching(self) -> tuple[str, ...]:
        """The markers whose hands ignore the targets now."""
        drawn = [reach.name for reach in self._under_way.values() if reach.end is None]
        return tuple(dict.fromkeys(drawn if self.exempt is None else [*drawn, self.exempt]))

    @property
    def running(self) -> tuple[str, ...]:
        """The parts that reach or are drawn back."""
        return tuple(self._under_way)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world, or move it there; None takes it away."""
        pulled = [part for part, reach in self._under_way.items() if reach.end is None]
        if target is None and pulled:
            raise InvalidValue(f"{', '.join(pulled)} is reaching for the target: it can be moved but not taken away")
        world, self._target = self._model.world, target
        there = world.objects.get(TARGET)
        if target and there and (there.kind, there.size, there.role) == ("sphere", (target.radius,), "target"):
            world.move(TARGET, position=target.position)
        else:
            if there is not None:
                world.remove(TARGET)
            if target is not None:
                world.add(TARGET, sphere(target.radius), position=target.position, role="target")
        if target is not None:
            for part in pulled:
                self._controller.reach_toward(part, self._under_way[part].name, target)

    def begin(self, part: str, marker: str, stay: bool) -> None:
        """Begin to draw the marker."""
        if self._target is None:
            raise InvalidValue(f"{part} cannot reach: no target is presented; call present(ReachTarget(position)) first")
        target = self._target
        self.drop(part)
        self._controller.reach_toward(part, marker, target)
        self._under_way[part] = Reach(marker, stay)

    def ended(self, part: str, end: Outcome, pose: Pose) -> bool:
        """Note that a part has settled or timed out in a pose; whether it is to be drawn back now."""
        reach = self._under_way[part]
        if reach.end is None and self._target is not None:
            reach.end, reach.marker = end, pose.position(reach.name)
            reach.missing = self._target.missing(reach.marker)
            self._controller.end_reach(part)
            if not reach.stay:
                return True
            self._controller.set_attractor(part, end.q)
        self._ended[part] = _outcome(reach, end)
        self._told[part] = end
        del self._under_way[part]
        return False

    def outcome(self, part: str) -> ReachOutcome:
        """How the part's last reach ended."""
        if part not in self._ended:
            raise InvalidValue(f"{part} has not ended a reach on this plant")
        return self._ended[part]

    def after(self, part: str) -> Outcome | None:
        """How a part came to rest after a reach that nobody has asked about yet."""
        return self._told.pop(part, None)

    def drop(self, part: str) -> None:
        """Forget a part's reach, if there is one, and end its force."""
        self._told.pop(part, None)
        if part in self._under_way:
            del self._under_way[part]
            self._controller.end_reach(part)


def _outcome(reach: Reach, after: Outcome) -> ReachOutcome:
    end = reach.end
    if end is None or reach.marker is None:
        raise InvalidValue("a reach that is not over has no outcome")
    duration = end.duration + (0.0 if reach.stay else after.duration)
    return ReachOutcome(reach.marker, end.q, reach.missing, end.settled, duration, end.touched, after)
