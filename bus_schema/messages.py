"""The streams: one struct a message, unit and shape beside each field.

Vectors over a part's motors are `PartVector`, over the robot's motors `RobotVector`: their lengths are checked
on receipt.  Angles in rad, lengths in m, forces of eq. 5.7 in rad/s^2 (generalised force per unit mass), times in
ns of the bus clock (simulated), quaternions wxyz, all poses in the root frame.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

PartVector = Annotated[list[float], Meta(extra={"length": "part"})]
RobotVector = Annotated[list[float], Meta(extra={"length": "robot"})]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]
Quaternion = Annotated[list[float], Meta(min_length=4, max_length=4)]
Matrix3 = Annotated[list[float], Meta(min_length=9, max_length=9)]  # row-major
Name = Annotated[str, Meta(min_length=1, max_length=64)]
Text = Annotated[str, Meta(max_length=2000)]
Link = Annotated[int, Meta(ge=-1)]  # index of the link that carries a shape, -1 = none does
Count = Annotated[int, Meta(ge=0, le=2**62)]  # differences of two still fit into msgpack

Mode = Literal["position", "velocity", "torque", "hold"]
GateState = Literal["idle", "hold", "armed", "fault", "estop"]
MotionStatus = Literal["idle", "moving", "settled", "timeout", "held"]
ReachPhase = Literal["reaching", "returning", "over", "interrupted"]
Aim = Literal["centre", "surface"]
Role = Literal["obstacle", "target", "ghost"]
GeometryKind = Literal["sphere", "capsule", "cylinder", "box"]


class Message(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The header: every message on a stream carries it."""

    v: int  # version of the contract
    run: Name  # id of robot_sim's run
    src: Name  # the service that sent it
    seq: Count  # per publisher, from 0
    k: Count  # tick of robot_sim's clock it belongs to
    t: Count  # ns, bus clock
    tw: int  # ns, sender's monotonic clock: for diagnosis only


class Clock(Message, frozen=True, kw_only=True):
    """Start of tick k; mode lock: the next one comes when everybody who takes part has answered this one."""

    dt: Annotated[int, Meta(gt=0)]  # ns a tick
    mode: Literal["free", "lock", "paused"]
    rate: Annotated[float, Meta(gt=0)]  # simulated seconds a second that are asked for


class StepDone(Message, frozen=True, kw_only=True):
    """Lockstep: all that its sender has to say to tick re_k has been put."""

    re_k: Count
    ok: bool = True  # False: it lacked something, so the run cannot be repeated
    busy: list[Name] = []  # of the controller: services with nothing to decide, every part that they own being under way
    last: bool = False  # it takes part no longer
    including: list[Name] = []  # others whose answers to that tick it is formed of, so that they need not say so themselves


class Turn(Message, frozen=True, kw_only=True):
    """Lockstep: tick k waits for one participant, which may have something to decide."""

    dt: Count  # ns a tick


class State(Message, frozen=True, kw_only=True):
    """Motor state of a part, at the part's own sampling time t."""

    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s
    tau: PartVector  # N m
    mode: Mode  # of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # of the command in force, -1 = none
    cmd_age: int  # ticks since the state it answers, -1 = none


class Command(Message, frozen=True, kw_only=True):
    """What a part's motors shall do, in answer to tick re_k."""

    epoch: Count
    re_k: Count
    mode: Mode
    ref: PartVector  # rad, rad/s or N m, by mode; ignored on hold
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms after which the part holds


class Motion(Message, frozen=True, kw_only=True):
    """Where a part's action stands."""

    action_id: Text  # empty: none yet
    epoch: Count  # goal epoch in force, 0 = nobody owns the goal
    status: MotionStatus
    since_k: Count  # tick at which the status began
    start_k: Count  # tick at which the action began
    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s, the controller's own velocity
    ddq: PartVector  # rad/s^2, the controller's own acceleration
    goal: PartVector  # rad, attractor q*
    touched: list[Name]  # world objects in contact


class Reach(Message, frozen=True, kw_only=True):
    """How far a part's action that is a reach has come."""

    action_id: Text  # that of Motion
    phase: ReachPhase  # the force acts; it has ended and the attractor draws back; the action has ended, with or without an outcome
    marker: Name
    object: Name  # of the model's world, the target
    end_k: Count  # tick at which the force ended, or now while it acts; what follows is of that tick
    target: Vector3  # m, where it is
    q: PartVector  # rad, encoders
    position: Vector3  # m, of the marker
    missing: float  # m, from where the marker is to be
    settled: bool  # the force ended because the part had settled
    touched: list[Name]  # world objects in contact


class Targets(Message, frozen=True, kw_only=True):
    """Where the objects that are reached for are at tick re_k; one that is not named is not known any more."""

    re_k: Count
    positions: dict[Name, Vector3]  # m


class MarkerPose(Struct, frozen=True, forbid_unknown_fields=True):
    """A marker in the root frame."""

    name: Name
    position: Vector3  # m
    quaternion: Quaternion


class Pose(Message, frozen=True, kw_only=True):
    """Marker poses at tick re_k."""

    re_k: Count
    q: RobotVector  # rad, as assembled from the parts
    markers: list[MarkerPose]


class ContactItem(Struct, frozen=True, forbid_unknown_fields=True):
    """Two shapes that touch."""

    first: Name
    second: Name
    kind: Literal["solid", "field"]
    depth: float  # m
    point: Vector3  # m
    normal: Vector3  # the way `first` must go
    first_link: Link
    second_link: Link


class Forces(Message, frozen=True, kw_only=True):
    """Terms of the law at tick re_k (thesis eqs. 5.11-5.17); of the controller: those that it has from outside."""

    re_k: Count
    terms: dict[Name, RobotVector]  # rad/s^2, by name, in the order in which they are added
    part_age: dict[str, int]  # ns between the part's sample and tick re_k
    touched: dict[str, list[Name]]  # part -> world objects in contact
    contacts: list[ContactItem] | None = None  # all at that tick, where the controller has terms that may depend on them


class Contacts(Message, frozen=True, kw_only=True):
    """All contacts at tick re_k."""

    re_k: Count
    contacts: list[ContactItem]


class Geometry(Struct, frozen=True, forbid_unknown_fields=True):
    """A shape: sphere (r,), capsule and cylinder (r, height along local z), box (x, y, z), all in m."""

    kind: GeometryKind
    size: Annotated[list[Annotated[float, Meta(gt=0)]], Meta(min_length=1, max_length=3)]


class WorldObject(Message, frozen=True, kw_only=True):
    """An object as it was perceived."""

    name: Name
    geometry: Geometry
    position: Vector3  # m
    quaternion: Quaternion
    covariance: Matrix3  # m^2, of the position
    role: Role
    t_capture: Count  # ns, when the picture was taken
    valid_until: Count  # ns


class Image(Message, frozen=True, kw_only=True):
    """Picture of one eye at tick k_capture: rows top to bottom, height x width x 3 bytes."""

    eye: Literal["left", "right"]
    k_capture: Count
    width: Annotated[int, Meta(gt=0, le=4096)]
    height: Annotated[int, Meta(gt=0, le=4096)]
    encoding: Literal["rgb8"]
    data: bytes


class Camera(Message, frozen=True, kw_only=True):
    """Calibration of an eye and the posture at the picture's tick."""

    eye: Literal["left", "right"]
    k_capture: Count
    intrinsics: Matrix3  # pixels; pixel centres at integers, origin top left
    q_head: list[float]  # rad, head motors
    q_torso: list[float]  # rad, torso motors


class Transition(Message, frozen=True, kw_only=True):
    """One observed transition of an agent."""

    agent: Name
    n: Count  # how many the agent has observed, this one included
    s: Count
    a: Count
    goal: Count  # state the action meant to reach
    s_next: Count
    reward: float  # 'Kail' divergence, nats; of an agent that reaches 0, or the penalty of a failure
    value: float  # V(s) before the action
    settled: bool
    duration: float  # s
    touched: list[Name]


class Surprise(Struct, frozen=True, forbid_unknown_fields=True):
    """An outcome of an action that was not its goal."""

    s: Count
    a: Count
    s_next: Count
    share: Annotated[float, Meta(gt=0, le=1)]  # of the action's tries


class Learned(Message, frozen=True, kw_only=True):
    """What an agent knows and expects now, over its state-actions: S states with at most A actions, rows of states."""

    agent: Name
    n: Count  # transitions observed
    s: Count  # where it is
    space: Annotated[str, Meta(max_length=1_000_000)]  # JSON of the space's settings, from which it can be made again
    tries: bytes  # (S A) little-endian uint32; 0 too where a state has no such action
    reward: bytes  # (S A) little-endian float32, nats, or failures as in Transition; -inf where a state has no such action
    value: bytes  # (S A) little-endian float32, of the plan; -inf likewise
    surprises: list[Surprise]


class Event(Message, frozen=True, kw_only=True):
    """What a service has to tell a person."""

    level: Literal["info", "warning", "error"]
    code: Name
    text: Text
    values: dict[str, float]


class EStop(Message, frozen=True, kw_only=True):
    """Emergency stop: latched by robot_sim until it is reset."""

    set: bool
    source: Name
    reason: Text


class ObjectTruth(Struct, frozen=True, forbid_unknown_fields=True):
    """Where the simulator has an object."""

    name: Name
    position: Vector3
    quaternion: Quaternion


class Truth(Message, frozen=True, kw_only=True):
    """What only the simulator knows: for tests, figures and the monitor, never for a service of the robot."""

    q: RobotVector  # rad, joint side, without noise
    depth: float  # m, deepest solid contact of a listed pair since the last message, 0 = none
    pair: Text  # that pair
    gap: float  # m, closest distance of hands and forearms to the table now, -1 = not measured
    objects: list[ObjectTruth]
