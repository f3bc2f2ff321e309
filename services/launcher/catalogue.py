# SPDX-License-Identifier: Apache-2.0
"""The catalogue of services: the program of each, the order of their start, and the services that each must wait for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from bus_schema.authority import AGENT, BEHAVIOURS

RECORDER = "recorder"


@dataclass(frozen=True)
class Entry:
    """The fixed properties of a service, which do not depend on its settings.

    `module`: program, run with `python -m mobee_system.run`. `config`: class of its settings, as "module:class". `stage`: number of its
    group; a scenario lists its services by ascending stage, and the launcher stops them by descending stage. `after`: services that must be
    ready before it joins the system. `nice`: niceness of its process. `vital`: whether the robot is stopped if the launcher gives the
    service up (does not restart it any more). `participates`: in lockstep, whether every tick waits for its answer. `may_end`: whether it
    may end by itself without a failure. `real_time`: its results depend on real time, so it does not run in lockstep. `needs`: Python
    packages that it imports, each with the extra of this project that installs it. `given`: settings that follow from the name of the
    service, such as the part of an agent.
    """

    module: str
    config: str
    stage: int  # services are listed in this order, and stopped in the opposite one
    after: tuple[str, ...] = ()
    nice: int = 0
    vital: bool = True
    participates: bool = True
    may_end: bool = False  # it can finish by itself; any other service that ends without the launcher's request has failed
    real_time: bool = False
    needs: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def has_standby(self) -> bool:
        """Whether a second process of the service may wait to replace the first: the service is vital, and its program is not a user's.

        Two processes of a user's program could open the same hardware.
        """
        return self.vital and self.module.startswith("services.")


_NICE_PICTURES = 10  # niceness of services that may be late
_NICE_PLANS = 9  # of agents: after the control chain, before pictures

_ENTRIES = {
    "robot_sim": Entry("services.robot_sim", "services.robot_sim.config:Config", 0, after=(RECORDER,), participates=False),
    "model": Entry("services.model", "services.model.config:Config", 1, after=(RECORDER,)),
    "controller": Entry("services.controller", "services.controller.config:Config", 2, after=("robot_sim", "model")),
    "port_filter": Entry("services.port_filter", "services.port_filter.config:Config", 2, after=("robot_sim",)),
    **{
        behaviour: Entry(
            f"services.{behaviour}",
            f"services.{behaviour}.config:Config",
            3,
            after=("controller",),
            nice=_NICE_PLANS,
            vital=False,
            participates=False,
            real_time=True,
        )
        for behaviour in BEHAVIOURS
    },
    "renderer": Entry(
        "services.robot_sim.renderer",
        "services.robot_sim.config:RendererConfig",
        4,
        after=("robot_sim", "controller"),
        nice=_NICE_PICTURES,
        vital=False,
        participates=False,
        real_time=True,
    ),
    "vision": Entry(
        "services.vision",
        "services.vision.config:Config",
        4,
        after=("model", "controller"),
        nice=_NICE_PICTURES,
        vital=False,
        participates=False,
        real_time=True,
    ),
    "monitor": Entry(
        "services.monitor",
        "services.monitor.config:Config",
        5,
        after=("robot_sim", "controller"),
        nice=_NICE_PICTURES,
        vital=False,
        participates=False,
        needs={"rerun": "viz"},
    ),
    RECORDER: Entry(  # it lowers its own priority when it is ready: others wait for its start
        "services.recorder", "services.recorder.config:Config", -1, vital=False, participates=False, needs={"mcap": "live"}
    ),
}

NAMES = (*list(_ENTRIES)[:3], AGENT + "<part>", *list(_ENTRIES)[3:])


def entry_of(who: str, module: str | None) -> Entry | None:
    """Return the fixed properties of the service `who` as an Entry; None if the service is unknown and no `module` is given.

    `module`: a program that replaces the shipped one, or the program of a service that is not shipped; None: the shipped program. With a
    `module`, the entry has this program, the settings class `Config` of its module `config`, and no needed packages; an unknown service
    waits for the controller.
    """
    entry = _ENTRIES.get(who)
    if who.startswith(AGENT):
        entry = Entry(
            "services.agents",
            "services.agents.config:Config",
            3,
            after=("controller",),
            nice=_NICE_PLANS,
            may_end=True,  # once it has made its transitions or tries
            given={"part": who.removeprefix(AGENT)},
        )
    if module is None:
        return entry
    place = entry or Entry("", "", 3, after=("controller",))
    return replace(place, module=module, config=f"{module}.config:Config", needs={}, may_end=entry is None or who.startswith(AGENT))
