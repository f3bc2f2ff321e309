# SPDX-License-Identifier: Apache-2.0
"""Requests and replies of calls, and the table of all calls.

A call may be sent again if its reply is lost: a request with an id that was used before has no second effect. Positions and orientations
are in the root frame, quaternions are wxyz. The world of the service `model` is the set of the objects around the robot that it knows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta, Struct

from bus_schema.messages import Aim, Count, GateState, Geometry, Name, PartVector, Quaternion, RobotVector, Role, Text, Vector3
from bus_schema.stream import EVERYONE, Party


class Request(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The header of every request: the fields with which all requests begin."""

    v: int  # version of the contract
    id: Name  # unique for each call: a repeated request with the same id has no second effect
    who: Name  # name of the process that calls


class Empty(Request, frozen=True, kw_only=True):
    """The request of a call without arguments."""


class Take(Request, frozen=True, kw_only=True):
    """Take the ownership of a part's drive (right to command its motors) or goal (right to set its attractor), depending on the key.

    The ownership also ends when the caller's liveliness token, by which others see that the caller runs, disappears.
    """

    instance: Name  # last chunk of the caller's liveliness token `alive/{service}/{instance}`


class WithEpoch(Request, frozen=True, kw_only=True):
    """The request of `drive/arm`, `drive/release`, `drive/hold` and `release`.

    Only the owner of the part's drive (right to command its motors) or goal (right to set its attractor) may call these.
    """

    epoch: Count  # number of the caller's ownership, as in `Taken`


class Goal(Request, frozen=True, kw_only=True):
    """Set a part's attractor, and start an action: the motion of the part to the attractor, until the part settles or times out."""

    epoch: Count  # goal epoch of the caller, as in `Taken`
    action_id: Name  # id that the caller chooses; `Motion` reports it
    q: PartVector  # rad, attractor q*


class Force(Request, frozen=True, kw_only=True):
    """Apply a client's force to a part until it is cleared.

    The force acts in joint space (`f`, thesis eq. 5.9), at a marker (`marker` and `push`, eq. 5.10), or both. A request with neither clears
    all forces that were set for the part.
    """

    epoch: Count  # goal epoch of the caller, as in `Taken`
    f: PartVector | None = None  # rad/s^2, force in joint space
    marker: Name | None = None  # marker at which `push` acts
    push: Vector3 | None = None  # m/s^2 at the marker (force per unit mass)


class ReachFor(Request, frozen=True, kw_only=True):
    """Start an action in which a force pulls a marker (named point of a link) to an object until the part has settled (thesis 8.2).

    The object is one of the world of the service `model`.
    """

    epoch: Count  # goal epoch of the caller, as in `Taken`
    action_id: Name  # id that the caller chooses; `Motion` and `Reach` report it
    marker: Name  # marker that is pulled
    object: Name  # name of the target in the world of the service `model`
    position: Vector3  # m, present position of the target; later positions come from the model
    radius: Annotated[float, Meta(gt=0)]  # m, radius of the target
    aim: Aim  # whether the marker is to come to the centre or to the surface of the target
    normal: Vector3 | None = None  # direction in which the marker's normal should point; None: any
    faces: bool = False  # True: the marker's normal should point to the target, also while it moves; `normal` must then be None
    stay: bool = False  # True: the part stays where the force ended; False: its attractor pulls it back


class Place(Request, frozen=True, kw_only=True):
    """Move an object of the simulator to a position."""

    name: Name
    position: Vector3  # m, root frame


class Pace(Request, frozen=True, kw_only=True):
    """Set the largest speed of a simulation in lockstep, relative to real time."""

    speed: Annotated[float, Meta(ge=0, le=1000)]  # largest simulated time per real time; 0: as fast as the processes answer


class Explore(Request, frozen=True, kw_only=True):
    """Set the explorer (exploration strategy) by which an agent chooses its next actions."""

    explorer: Name  # exploration strategy, such as curious or random, as in the settings of an agent


class AddObject(Request, frozen=True, kw_only=True):
    """Add an object to the world of the service `model`, or replace the one of the same name, also one that is attached to a link."""

    name: Name
    geometry: Geometry
    position: Vector3  # m, root frame
    quaternion: Quaternion  # orientation in the root frame
    role: Role


class MoveObject(Request, frozen=True, kw_only=True):
    """Set the position of an object of the world of the service `model`, and its orientation if `quaternion` is given; root frame."""

    name: Name
    position: Vector3  # m, root frame
    quaternion: Quaternion | None = None  # None: the orientation stays the same


class SetRole(Request, frozen=True, kw_only=True):
    """Set the role of an object of the world of the service `model`: obstacle, target or ghost (exerts no force)."""

    name: Name
    role: Role


class OneName(Request, frozen=True, kw_only=True):
    """Remove an object from the world of the service `model`, or detach it from its link, depending on the key."""

    name: Name


class Attach(Request, frozen=True, kw_only=True):
    """Attach an object of the world of the service `model` to a link, with which it then moves."""

    name: Name
    link: Name


class JacobianAt(Request, frozen=True, kw_only=True):
    """Request the Jacobian of a marker (named point of a link) at q [rad]; without q, at the newest pose."""

    marker: Name
    q: RobotVector | None = None  # rad, of all motors; None: the newest pose


class Reply(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The header of every reply: the fields with which all replies begin."""

    v: int  # version of the contract


class Done(Reply, frozen=True, kw_only=True):
    """Reply to a call that succeeded and has no result."""


class Taken(Reply, frozen=True, kw_only=True):
    """Reply to `Take`: the number (epoch) of the new ownership; calls and commands with an older epoch are refused."""

    epoch: Count


class Driven(Reply, frozen=True, kw_only=True):
    """Reply to the calls `drive/arm`, `drive/release` and `drive/hold`: state of the part's gate (the check of its commands) afterwards."""

    gate: GateState


class Started(Reply, frozen=True, kw_only=True):
    """Reply to `Goal` and `ReachFor`: the action began at tick k; `Motion` of later ticks reports its state."""

    k: Count


class PartMeta(Reply, frozen=True, kw_only=True):
    """Reply to the call `{part}/meta`: motors of a part and their limits."""

    part: Name
    motors: list[Name]
    lower: PartVector  # rad
    upper: PartVector  # rad
    max_velocity: PartVector  # rad/s
    max_acceleration: PartVector  # rad/s^2
    max_torque: PartVector  # N m
    robot: Name  # name of the robot
    robot_hash: Name  # hash of the robot's links, joints and motors, by which processes compare their robots


class ObjectState(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of the world of the service `model`, in the reply `World`."""

    name: Name
    geometry: Geometry
    position: Vector3  # m, root frame
    quaternion: Quaternion  # orientation in the root frame
    role: Role
    link: str  # link to which the object is attached; empty: none
    margin: Annotated[float, Meta(ge=0)] = 0.0  # m by which the shape is larger than the object on each side, for an uncertain position
    t_capture: Count | None = None  # ns, time of the newest picture that shows a perceived object


class World(Reply, frozen=True, kw_only=True):
    """Reply to the call `model/rpc/world/list`: all objects of the world of the service `model`."""

    objects: list[ObjectState]
    stale: dict[Name, float] = {}  # perceived objects that were removed because they are not seen any more: s since the last picture


class JacobianReply(Reply, frozen=True, kw_only=True):
    """Reply to `JacobianAt`: a Jacobian, root frame: 3 linear rows [m/rad], then 3 angular ones; one column for each motor of the robot."""

    rows: Annotated[int, Meta(ge=1)]
    columns: Annotated[int, Meta(ge=1)]
    data: list[float]  # row-major


class Stat(Reply, frozen=True, kw_only=True):
    """Status of a service, the reply to the call `stat`."""

    who: Name  # name of the service
    instance: Name  # id of the process, as in its liveliness token
    pid: int  # process id
    uptime: float  # s since the start
    ready: bool  # True: the service has declared its liveliness token
    text: Text  # one line for the status screen
    numbers: dict[str, int | float | None]  # measured numbers, by name; None: not measured
    rejected: dict[str, int]  # number of refused messages and calls, by reason
    words: dict[str, Text] = {}  # values that are not numbers, such as a hash, by name
    health: dict[str, int | float | None] = {}  # numbers of the process, as `mobee status` shows them; None: not measured
    warnings: list[Name] = []  # names of the numbers in `health` that are, or were in the last 30 s, beyond their limits


class Pulse(Reply, frozen=True, kw_only=True):
    """Reply to the call `pulse`: numbers that show whether a service still handles messages; it is sent also while a handler runs."""

    handled: int  # messages, calls and timers since the start
    waiting: int  # messages and calls in the inbox


class Config(Reply, frozen=True, kw_only=True):
    """Reply to the call `config`: a service's whole configuration as JSON."""

    config: str  # JSON


class Failure(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The reply to a call that was refused or that failed; `code` is the reason as a word such as "owned", listed in docs/bus.md."""

    v: int  # version of the contract
    code: Name  # short code of the reason, see docs/bus.md
    text: Text  # text for the user


@dataclass(frozen=True, slots=True)
class Call:
    """Calls with the same request and reply: their keys, who answers them, and who may call.

    Each `Call` is a row of the table in docs/bus.md.
    """

    pattern: str  # the key, with variables in braces
    verbs: tuple[str, ...]  # words for {verb} in the pattern; empty if it has none
    request: type[Request]
    reply: type[Reply]
    servers: tuple[Party, ...]  # who answers
    callers: tuple[Party, ...]  # who may call


_PERSONS: tuple[Party, ...] = ("operator", "monitor")  # a person at a terminal or at the page
_READERS: tuple[Party, ...] = ("operator", "monitor", "observer", "client", "driver")
_DRIVERS: tuple[Party, ...] = ("controller", "port_filter", "driver")
_USERS: tuple[Party, ...] = ("operator", "monitor", "agent", "client")  # of parts that the controller drives, and of the model's world

CALLS = (
    Call("{service}/rpc/{verb}", ("stat",), Empty, Stat, EVERYONE, EVERYONE),
    Call("{service}/rpc/{verb}", ("pulse",), Empty, Pulse, EVERYONE, ("launcher", "operator")),
    Call("{service}/rpc/{verb}", ("mark", "shutdown"), Empty, Done, EVERYONE, ("launcher", "operator")),
    Call("{service}/rpc/{verb}", ("config",), Empty, Config, EVERYONE, ("launcher", *_READERS)),
    Call("{service}/rpc/{verb}", ("rest", "resume"), Empty, Done, ("agent",), _PERSONS),
    Call("{service}/rpc/{verb}", ("explore",), Explore, Done, ("agent",), _PERSONS),
    Call("{part}/meta", (), Empty, PartMeta, ("robot_sim",), ("controller", "port_filter", *_READERS)),
    Call("{part}/rpc/drive/{verb}", ("take",), Take, Taken, ("robot_sim",), _DRIVERS),
    Call("{part}/rpc/drive/{verb}", ("arm", "release", "hold"), WithEpoch, Driven, ("robot_sim",), _DRIVERS),
    Call("sim/rpc/{verb}", ("reset", "pause", "resume"), Empty, Done, ("robot_sim",), _PERSONS),
    Call("sim/rpc/{verb}", ("place",), Place, Done, ("robot_sim",), (*_PERSONS, "agent")),
    Call("sim/rpc/{verb}", ("pace",), Pace, Done, ("robot_sim",), _PERSONS),
    Call("estop/rpc/{verb}", ("reset",), Empty, Done, ("robot_sim",), (*_PERSONS, "port_filter")),
    Call("{part}/rpc/{verb}", ("take",), Take, Taken, ("controller",), (*_USERS, "behaviour")),
    Call("{part}/rpc/{verb}", ("release",), WithEpoch, Done, ("controller",), (*_USERS, "behaviour")),
    Call("{part}/rpc/{verb}", ("goal",), Goal, Started, ("controller",), _USERS),
    Call("{part}/rpc/{verb}", ("force",), Force, Done, ("controller",), _USERS),
    Call("{part}/rpc/{verb}", ("reach",), ReachFor, Started, ("controller",), _USERS),
    Call("model/rpc/world/{verb}", ("add",), AddObject, Done, ("model",), _USERS),
    Call("model/rpc/world/{verb}", ("move",), MoveObject, Done, ("model",), _USERS),
    Call("model/rpc/world/{verb}", ("remove", "detach"), OneName, Done, ("model",), _USERS),
    Call("model/rpc/world/{verb}", ("role",), SetRole, Done, ("model",), _USERS),
    Call("model/rpc/world/{verb}", ("attach",), Attach, Done, ("model",), _USERS),
    Call("model/rpc/world/{verb}", ("list",), Empty, World, ("model",), (*_USERS, "observer", "driver")),
    Call("model/rpc/{verb}", ("jacobian",), JacobianAt, JacobianReply, ("model",), ("agent", *_READERS)),
    Call("{part}/rpc/{verb}", ("waypoint",), Empty, Done, ("port_filter",), (*_PERSONS, "driver")),
)
