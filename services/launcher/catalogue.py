"""The services: their programs, start order and dependencies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

AGENT = "agent_"


@dataclass(frozen=True)
class Entry:
    """What the launcher knows of a service before it reads its settings."""

    module: str  # run with `python -m mobee_system.run`
    config: str  # its configuration: module:class
    stage: int  # services are listed in this order, and stopped in the opposite one
    after: tuple[str, ...] = ()  # who must be ready before it joins them
    nice: int = 0
    vital: bool = True  # when it is given up, the robot is stopped
    steps: bool = True  # lockstep: every tick waits for it
    looks: bool = False  # what it sees depends on the clock on the wall, so lockstep does without it
    needs: Mapping[str, str] = field(default_factory=dict)  # importable package -> extra of this project
    given: Mapping[str, str] = field(default_factory=dict)  # settings that make it this service


_PICTURES = 10  # nice value of whatever may come late
_PLANS = 9  # of who plans: the control chain must not wait for a thought, and no thought for a picture

_ENTRIES = {
    "robot_sim": Entry(
        "services.robot_sim", "services.robot_sim.config:Config", 0, steps=False, needs={"pybullet": "sim", "icub_models": "sim"}
    ),
    "model": Entry("services.model", "services.model.config:Config", 1),
    "controller": Entry("services.controller", "services.controller.config:Config", 2, after=("robot_sim", "model")),
    "port_filter": Entry("services.port_filter", "services.port_filter.config:Config", 2, after=("robot_sim",)),
    "renderer": Entry(
        "services.robot_sim.renderer",
        "services.robot_sim.config:RendererConfig",
        4,
        after=("robot_sim", "controller"),
        nice=_PICTURES,
        vital=False,
        steps=False,
        looks=True,
    ),
    "vision": Entry(
        "services.vision",
        "services.vision.config:Config",
        4,
        after=("model", "controller"),
        nice=_PICTURES,
        vital=False,
        steps=False,
        looks=True,
    ),
    "monitor": Entry(
        "services.monitor",
        "services.monitor.config:Config",
        5,
        after=("robot_sim", "controller"),
        nice=_PICTURES,
        vital=False,
        steps=False,
        needs={"rerun": "viz", "icub_models": "viz"},
    ),
}

NAMES = (*list(_ENTRIES)[:3], AGENT + "<part>", *list(_ENTRIES)[3:])


def entry_of(who: str, module: str | None) -> Entry | None:
    """The entry of a service; `module`: another program in its place, or one that is not shipped.  None: nobody knows it."""
    entry = _ENTRIES.get(who)
    if who.startswith(AGENT):
        entry = Entry(
            "services.agents",
            "services.agents.config:Config",
            3,
            after=("controller",),
            nice=_PLANS,
            given={"part": who.removeprefix(AGENT)},
        )
    if module is None:
        return entry
    place = entry or Entry("", "", 3, after=("controller",))
    return replace(place, module=module, config=f"{module}.config:Config", needs={})
