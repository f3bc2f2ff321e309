"""Requests and replies; a request id makes a repeated call harmless."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from bus_schema.messages import Aim, Count, GateState, Geometry, Name, PartVector, Quaternion, RobotVector, Role, Text, Vector3


class Request(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every request carries."""

    v: int  # version of the contract
    id: Name  # unique a call
    who: Name  # the caller


class Empty(Request, frozen=True, kw_only=True):
    """A call without arguments."""


class Take(Request, frozen=True, kw_only=True):
    """Ask for ownership; the owner loses it when its liveliness token goes."""

    instance: Name  # of the caller's token


class WithEpoch(Request, frozen=True, kw_only=True):
    """A call of the owner: arm, release, hold."""

    epoch: Count


class Goal(Request, frozen=True, kw_only=True):
    """Set a part's attractor and start an action."""

    epoch: Count
    action_id: Name
    q: PartVector  # rad


class Force(Request, frozen=True, kw_only=True):
    """Force a part until cleared: in joint space (f), or at a marker (eqs. 5.9, 5.10); neither clears."""

    epoch: Count
    f: PartVector | None = None  # rad/s^2
    marker: Name | None = None
    push: Vector3 | None = None  # unit mass times m/s^2 at the marker


class ReachFor(Request, frozen=True, kw_only=True):
    """Draw a marker to an object of the model's world, and let it go when the part has settled (thesis 8.2): an action."""

    epoch: Count
    action_id: Name
    marker: Name
    object: Name
    position: Vector3  # m, where it is; from then on where the model has it
    radius: Annotated[float, Meta(gt=0)]  # m
    aim: Aim
    normal: Vector3 | None = None  # where the marker's normal is to point
    stay: bool = False  # the part is not drawn back


class Place(Request, frozen=True, kw_only=True):
    """Put a simulated object somewhere."""

    name: Name
    position: Vector3  # m


class AddObject(Request, frozen=True, kw_only=True):
    """A new object for the model's world; replaces one of the same name."""

    name: Name
    geometry: Geometry
    position: Vector3
    quaternion: Quaternion
    role: Role


class MoveObject(Request, frozen=True, kw_only=True):
    """A known object's new pose."""

    name: Name
    position: Vector3
    quaternion: Quaternion | None = None


class SetRole(Request, frozen=True, kw_only=True):
    """A known object's new role."""

    name: Name
    role: Role


class OneName(Request, frozen=True, kw_only=True):
    """An object to remove or detach."""

    name: Name


class Attach(Request, frozen=True, kw_only=True):
    """An object that moves with a link from now on."""

    name: Name
    link: Name


class JacobianAt(Request, frozen=True, kw_only=True):
    """A marker's Jacobian at a pose; without q, at the newest one."""

    marker: Name
    q: RobotVector | None = None


class Reply(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every reply carries."""

    v: int


class Done(Reply, frozen=True, kw_only=True):
    """It happened."""


class Taken(Reply, frozen=True, kw_only=True):
    """The new epoch: older ones are refused from now on."""

    epoch: Count


class Driven(Reply, frozen=True, kw_only=True):
    """State of the gate after the call."""

    gate: GateState


class Started(Reply, frozen=True, kw_only=True):
    """An action began at tick k; motion messages of later ticks tell of it."""

    k: Count


class PartMeta(Reply, frozen=True, kw_only=True):
    """What a part is made of."""

    part: Name
    motors: list[Name]
    lower: PartVector  # rad
    upper: PartVector  # rad
    max_velocity: PartVector  # rad/s
    max_acceleration: PartVector  # rad/s^2
    max_torque: PartVector  # N m
    robot: Name
    robot_hash: Name


class ObjectState(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of the model's world."""

    name: Name
    geometry: Geometry
    position: Vector3
    quaternion: Quaternion
    role: Role
    link: str  # empty: free


class World(Reply, frozen=True, kw_only=True):
    """All objects of the model's world."""

    objects: list[ObjectState]


class JacobianReply(Reply, frozen=True, kw_only=True):
    """Rows: linear then angular; columns: the robot's motors; row-major."""

    rows: Annotated[int, Meta(ge=1)]
    columns: Annotated[int, Meta(ge=1)]
    data: list[float]


class Stat(Reply, frozen=True, kw_only=True):
    """How a service is."""

    who: Name
    instance: Name
    pid: int
    uptime: float  # s
    ready: bool
    text: Text  # one line for the status screen
    numbers: dict[str, float]
    rejected: dict[str, int]  # refused messages and calls by reason
    words: dict[str, Text] = {}  # what is no number, such as a hash


class Config(Reply, frozen=True, kw_only=True):
    """A service's whole configuration as JSON."""

    config: str


class Failure(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Why a call was refused."""

    v: int
    code: Name
    text: Text
