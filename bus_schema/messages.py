# SPDX-License-Identifier: Apache-2.0
"""The messages on the bus: one struct each, with its key and delivery class, and with the unit of each field beside it.

Vectors over a part's motors are `PartVector`, over the robot's motors `RobotVector`: the receiver checks their lengths.  Angles are in
rad, lengths in m, forces of eq. 5.7 in rad/s^2 (generalised force per unit mass), times in ns of the bus clock (simulated); quaternions
are wxyz, and all poses are in the root frame.

In every tick the control chain is three messages: `Tick` of robot_sim, `Forces` of the model, `Commands` of the controller.

After a change of a struct, increase VERSION (version.py) and run `python -m bus_schema.page`, which writes the tables of docs/bus.md.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from msgspec import Meta, Struct

from bus_schema.stream import EVERYONE, Party, Stream

PartVector = Annotated[list[float], Meta(extra={"length": "part"})]
RobotVector = Annotated[list[float], Meta(extra={"length": "robot"})]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]
Quaternion = Annotated[list[float], Meta(min_length=4, max_length=4)]
Matrix3 = Annotated[list[float], Meta(min_length=9, max_length=9)]  # row-major
Name = Annotated[str, Meta(min_length=1, max_length=64)]
Text = Annotated[str, Meta(max_length=2000)]
Link = Annotated[int, Meta(ge=-1)]  # index of the link that carries a shape, -1 = none
Count = Annotated[int, Meta(ge=0, le=2**62)]  # so small that the difference of two fits into msgpack

PARTICIPANTS: tuple[Party, ...] = ("model", "controller", "port_filter", "agent", "client", "driver")  # of lockstep

Mode = Literal["position", "velocity", "torque", "hold"]
GateState = Literal["idle", "hold", "armed", "fault", "estop"]
MotionStatus = Literal["idle", "moving", "settled", "timeout", "suspended", "held"]  # suspended: in hold; the action may continue
ReachPhase = Literal["reaching", "returning", "over", "interrupted"]
PlaybackPhase = Literal["moving", "over", "interrupted"]
Aim = Literal["centre", "surface"]
Role = Literal["obstacle", "target", "ghost"]
GeometryKind = Literal["sphere", "capsule", "cylinder", "box"]


class Message(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The header of every message."""

    stream: ClassVar[Stream]

    v: int  # version of the contract
    run: Name  # id of robot_sim's run
    src: Name  # service that sent it
    seq: Count  # per publisher, from 0
    k: Count  # tick of robot_sim to which the message belongs
    t: Count  # ns, bus clock
    tw: int  # ns, sender's monotonic clock: for diagnosis only


class Clock(Message, frozen=True, kw_only=True):
    """Start of tick k.  In mode "lock" the next tick begins when all participants have answered this one."""

    stream: ClassVar[Stream] = Stream("clock", "CONTROL", writers=("robot_sim",), readers=EVERYONE, when="every tick up to 100 per second")

    dt: Annotated[int, Meta(gt=0, le=10_000_000_000)]  # ns per tick
    mode: Literal["free", "lock", "paused"]
    rate: Annotated[float, Meta(gt=0, le=1000)]  # simulated seconds per second of real time, as configured


class PartStatus(Struct, frozen=True, forbid_unknown_fields=True):
    """The sampling time of a part, and the command that its motors follow; the same fields as in `State`."""

    k: Count  # tick
    t: Count  # ns, bus clock
    mode: Mode  # of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # of the command in force, -1 = none
    cmd_age: int  # ticks since the state from which it was computed, -1 = none


class Tick(Clock, frozen=True, kw_only=True):
    """Start of tick k, with the newest state of every part; each part has its own sampling time."""

    stream: ClassVar[Stream] = Stream(
        "tick",
        "CONTROL",
        writers=("robot_sim",),
        readers=("model", "controller", "port_filter", "agent", "behaviour", "renderer"),
        when="every tick",
    )

    q: RobotVector  # rad, encoders
    parts: dict[Name, PartStatus]  # of all parts


class StepDone(Message, frozen=True, kw_only=True):
    """Lockstep: the sender has published all its messages for tick re_k."""

    stream: ClassVar[Stream] = Stream("done/{service}", "STEP", writers=PARTICIPANTS, readers=("robot_sim",), when="in lockstep")

    re_k: Count  # tick that is answered
    ok: bool = True  # False: an input was missing, so the run is not repeatable
    busy: list[Name] = []  # from the controller: services that have nothing to decide, because all their parts are moving
    last: bool = False  # the sender leaves lockstep: later ticks do not wait for it
    including: list[Name] = []  # participants whose answers to that tick were used, so that they need not send StepDone


class Turn(Message, frozen=True, kw_only=True):
    """Lockstep: tick k waits for this participant, which may have an action to decide."""

    stream: ClassVar[Stream] = Stream("turn/{participant}", "STEP", writers=("robot_sim",), readers=PARTICIPANTS, when="in lockstep")

    dt: Count  # ns per tick


class State(Message, frozen=True, kw_only=True):
    """Motor state of a part, at the part's own sampling time t."""

    stream: ClassVar[Stream] = Stream(
        "{part}/state",
        "CONTROL",
        writers=("robot_sim",),
        readers=("renderer", "monitor", "port_filter"),
        when="every tick at the part's own time, if there is a subscriber",
    )

    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s
    tau: PartVector  # N m
    mode: Mode  # of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # of the command in force, -1 = none
    cmd_age: int  # ticks since the state from which it was computed, -1 = none


class Command(Message, frozen=True, kw_only=True):
    """Command to the motors of one part, computed from the state of tick re_k."""

    stream: ClassVar[Stream] = Stream(
        "{part}/cmd", "CONTROL", writers=("port_filter", "driver"), readers=("robot_sim",), when="every tick, for a single part"
    )

    epoch: Count
    re_k: Count
    mode: Mode
    ref: PartVector  # rad, rad/s or N m, by mode; ignored on hold
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms after which the part holds


class Order(Struct, frozen=True, forbid_unknown_fields=True):
    """Drive epoch and command mode of one part in `Commands`."""

    epoch: Count
    mode: Mode


class Answer(Struct, frozen=True, forbid_unknown_fields=True):
    """Lockstep: the content of `StepDone`, sent in the same message as the commands."""

    ok: bool
    busy: list[Name]
    including: list[Name]


class Commands(Message, frozen=True, kw_only=True):
    """Commands to the motors of several parts, computed from the state of tick re_k; parts that are not named are not affected."""

    stream: ClassVar[Stream] = Stream("commands", "CONTROL", writers=("controller", "driver"), readers=("robot_sim",), when="every tick")

    re_k: Count
    parts: dict[Name, Order]
    ref: RobotVector  # rad, rad/s or N m, by the part's mode; ignored on hold
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms after which these parts hold
    answer: Answer | None  # None: the tick is not answered yet, or free mode


class Motion(Message, frozen=True, kw_only=True):
    """State of a part's action."""

    stream: ClassVar[Stream] = Stream(
        "{part}/motion",
        "CONTROL",
        writers=("controller",),
        readers=("agent", "behaviour", "monitor"),
        when="at once after a change, else up to 100 per second",
    )

    action_id: Text  # empty: none yet
    epoch: Count  # goal epoch in force, 0 = no owner
    owner: Text = ""  # service that owns the goal
    status: MotionStatus
    since_k: Count  # tick at which the status began
    start_k: Count  # tick at which the action began
    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s, the controller's own velocity
    ddq: PartVector  # rad/s^2, the controller's own acceleration
    goal: PartVector  # rad, attractor q*
    touched: list[Name]  # world objects in contact


class Follow(Message, frozen=True, kw_only=True):
    """A part's attractor, which moves: the controller follows it, and stops it after 0.1 s without a new message."""

    stream: ClassVar[Stream] = Stream(
        "{part}/follow",
        "LATEST",
        writers=("behaviour", "client"),
        readers=("controller",),
        when="while a behaviour moves a part, at least 20 times per second",
    )

    epoch: Count  # goal epoch of the sender, as in `Taken`; with another one the message has no effect
    q: PartVector  # rad, attractor q* now
    dq: PartVector  # rad/s, its velocity


class Reach(Message, frozen=True, kw_only=True):
    """State of a part's reach."""

    stream: ClassVar[Stream] = Stream(
        "{part}/reach",
        "CONTROL",
        writers=("controller",),
        readers=("model", "agent", "monitor"),
        when="at once after a change, during a reach up to 100 per second",
    )

    action_id: Text  # as in Motion
    phase: ReachPhase  # reaching: under the force; returning: drawn back by the attractor; over, interrupted: ended with, without outcome
    marker: Name
    object: Name  # the target, an object of the model's world
    end_k: Count  # tick at which the force ended, the newest tick while it acts; the fields below are of that tick
    target: Vector3  # m, position of the target
    q: PartVector  # rad, encoders
    position: Vector3  # m, of the marker
    missing: float  # m, remaining distance of the marker to its goal
    settled: bool  # True: the force ended because the part had settled
    touched: list[Name]  # world objects in contact


class Playback(Message, frozen=True, kw_only=True):
    """State of a motion along a path of a roadmap."""

    stream: ClassVar[Stream] = Stream(
        "roadmap/playback",
        "NEWEST",
        writers=("operator",),
        readers=("monitor",),
        when="five times a second while `mobee roadmap play --live` moves the robot",
    )

    phase: PlaybackPhase  # moving: until the robot rests; over: it rests; interrupted: a part was lost, or the command was ended
    place: Text  # where the path leads, in the coordinates of the roadmap
    marker: Name  # of the roadmap
    path: Annotated[list[Vector3], Meta(max_length=200)]  # m, places of the marker in the planned motion, equal times apart
    share: Annotated[float, Meta(ge=0, le=1)]  # of the planned motion that is over
    duration: float  # s, of the planned motion
    missing: float  # m, distance of the marker from the end of the path


class Targets(Message, frozen=True, kw_only=True):
    """Positions at tick re_k of the targets of all reaches; a reach whose target is not in the model's world any more ends."""

    stream: ClassVar[Stream] = Stream(
        "model/targets", "CONTROL", writers=("model",), readers=("controller",), when="every tick during a reach"
    )

    re_k: Count
    positions: dict[Name, Vector3]  # m
    gone: list[Name] = []  # targets that are not in the model's world


class MarkerPose(Struct, frozen=True, forbid_unknown_fields=True):
    """A marker in the root frame."""

    name: Name
    position: Vector3  # m
    quaternion: Quaternion


class Pose(Message, frozen=True, kw_only=True):
    """Marker poses at tick re_k."""

    stream: ClassVar[Stream] = Stream("model/pose", "LATEST", writers=("model",), readers=(), when="every tick, if there is a subscriber")

    re_k: Count
    q: RobotVector  # rad, assembled from the parts' samples
    markers: list[MarkerPose]


class ContactItem(Struct, frozen=True, forbid_unknown_fields=True):
    """Two shapes that touch."""

    first: Name
    second: Name
    kind: Literal["solid", "field"]
    depth: float  # m
    point: Vector3  # m
    normal: Vector3  # direction in which `first` must move to end the contact
    first_link: Link
    second_link: Link


class Forces(Message, frozen=True, kw_only=True):
    """Constraint forces at tick re_k by term (thesis eqs. 5.11-5.17); the controller publishes the user-defined terms."""

    stream: ClassVar[Stream] = Stream(
        "{source}/forces",
        "CONTROL",
        writers=("model", "controller"),
        readers=("controller", "monitor"),
        when="every tick; of the controller, if it has user-defined terms (LATEST)",
    )

    re_k: Count
    terms: dict[Name, RobotVector]  # rad/s^2, by name, in the order of addition
    part_age: dict[str, int]  # ns between the part's sample and tick re_k
    touched: dict[str, list[Name]]  # part -> world objects in contact
    contacts: list[ContactItem] | None = None  # all contacts at that tick, if the controller has user-defined terms


class Contacts(Message, frozen=True, kw_only=True):
    """All contacts at tick re_k."""

    stream: ClassVar[Stream] = Stream(
        "model/contacts", "LATEST", writers=("model",), readers=("monitor",), when="every tick, if there is a subscriber"
    )

    re_k: Count
    contacts: list[ContactItem]


class Geometry(Struct, frozen=True, forbid_unknown_fields=True):
    """A shape: sphere (r,), capsule and cylinder (r, height along local z), box (x, y, z), all in m."""

    kind: GeometryKind
    size: Annotated[list[Annotated[float, Meta(gt=0)]], Meta(min_length=1, max_length=3)]


class WorldObject(Message, frozen=True, kw_only=True):
    """An object as perceived by vision; while it is hidden, t_capture stays and the covariance grows."""

    stream: ClassVar[Stream] = Stream("world/{object}", "DATA", writers=("vision",), readers=("model", "behaviour", "monitor"))

    name: Name
    geometry: Geometry
    position: Vector3  # m
    quaternion: Quaternion
    covariance: Matrix3  # m^2, of the position
    role: Role
    t_capture: Count  # ns, time of the newest picture that shows it
    valid_until: Count  # ns, time after which the model removes the object; 0: at once


class Image(Message, frozen=True, kw_only=True):
    """Picture of one camera, rows top to bottom, height x width x 3 bytes; t is the middle of the exposure by the camera's clock."""

    stream: ClassVar[Stream] = Stream("vision/image/{camera}", "BULK", writers=("renderer",), readers=("vision", "monitor"))

    camera: Name
    k_capture: Count
    width: Annotated[int, Meta(gt=0, le=4096)]
    height: Annotated[int, Meta(gt=0, le=4096)]
    encoding: Literal["rgb8"]
    data: bytes


class Camera(Message, frozen=True, kw_only=True):
    """Lens of a camera, and the encoders of the robot at the picture's stamp t."""

    stream: ClassVar[Stream] = Stream("vision/camera/{camera}", "BULK", writers=("renderer",), readers=("vision",))

    camera: Name
    k_capture: Count
    intrinsics: Matrix3  # pixels; pixel centres at integers, origin top left
    distortion: list[float]  # k1 k2 p1 p2 of Brown and Conrady, or empty
    exposure: Annotated[float, Meta(ge=0)]  # s
    q: list[float]  # rad, all motors
    dq: list[float]  # rad/s, all motors
    readings: Annotated[int, Meta(gt=0)]  # of each encoder, from which q and dq were computed by a line


class Transition(Message, frozen=True, kw_only=True):
    """One observed transition of an agent."""

    stream: ClassVar[Stream] = Stream("agents/{part}/transition", "EVENTS", writers=("agent",), readers=("monitor",))

    agent: Name
    n: Count  # number of transitions that the agent has observed, including this one
    s: Count
    a: Count
    goal: Count  # state at which the action aims
    s_next: Count
    reward: float  # 'Kail' divergence, nats; of a reaching agent 0, or the penalty of a failure
    value: float  # V(s) before the action
    probability: Annotated[float, Meta(ge=0, le=1)]  # of s_next, as the agent believed before the action
    settled: bool
    duration: float  # s
    touched: list[Name]


class Decision(Message, frozen=True, kw_only=True):
    """The action that an agent begins, and what it expects of it."""

    stream: ClassVar[Stream] = Stream(
        "agents/{part}/decision", "NEWEST", writers=("agent",), readers=("monitor",), when="at the start of an action"
    )

    agent: Name
    n: Count  # transitions the agent has observed
    s: Count
    a: Count
    goal: Count  # intended state of the action
    tries: Count  # of this state-action so far
    reached: Annotated[float, Meta(ge=0, le=1)]  # believed probability of the goal
    expected: Count  # most probable outcome
    probability: Annotated[float, Meta(ge=0, le=1)]  # of that outcome
    reward: float  # the last information gain of this state-action, nats
    explorer: Text  # how the agent chooses actions
    plan: list[Count]  # states that the agent expects to pass after this action, up to the state-action where it expects to learn most


class Surprise(Struct, frozen=True, forbid_unknown_fields=True):
    """An outcome of an action that differs from its goal."""

    s: Count
    a: Count
    s_next: Count
    share: Annotated[float, Meta(gt=0, le=1)]  # share of the action's tries with this outcome


class Learned(Message, frozen=True, kw_only=True):
    """Counts, rewards and values of an agent's state-actions: matrices of S states (rows) with at most A actions (columns)."""

    stream: ClassVar[Stream] = Stream(
        "agents/{part}/learned", "NEWEST", writers=("agent",), readers=("monitor",), when="at most twice a second"
    )

    agent: Name
    n: Count  # transitions observed
    s: Count  # current state of the agent
    space: Annotated[str, Meta(max_length=1_000_000)]  # JSON of the settings from which the space can be made
    tries: bytes  # (S A) little-endian uint32; 0 also where a state has no such action
    reward: bytes  # (S A) little-endian float32, nats, or failures as in Transition; -inf where a state has no such action
    value: bytes  # (S A) little-endian float32, action values of the plan; -inf where a state has no such action
    surprises: list[Surprise]


class Event(Message, frozen=True, kw_only=True):
    """A log entry for a person."""

    stream: ClassVar[Stream] = Stream("event/{service}", "EVENTS", writers=EVERYONE, readers=("monitor",))

    level: Literal["info", "warning", "error"]
    code: Name
    text: Text
    values: dict[str, float]


class EStop(Message, frozen=True, kw_only=True):
    """Emergency stop: latched by robot_sim until the call `estop/rpc/reset`; a message whose `set` is false releases nothing."""

    stream: ClassVar[Stream] = Stream(
        "estop",
        "STOP",
        writers=EVERYONE,
        readers=("robot_sim", "controller", "port_filter", "launcher", "monitor"),
        when="robot_sim repeats it while it is latched, launcher and controller until then",
    )

    set: bool
    source: Name
    reason: Text


class Served(Message, frozen=True, kw_only=True):
    """A call that the sender has answered, except `stat` and `config`: the request and the reply as they were sent."""

    stream: ClassVar[Stream] = Stream(
        "served/{service}", "CONTROL", writers=EVERYONE, readers=(), when="after each call, if there is a subscriber"
    )

    key: Text  # of the call
    request: bytes  # msgpack
    request_type: Name
    reply: bytes  # msgpack
    reply_type: Name  # Failure: the call was refused


class ObjectTruth(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of an object in the simulator."""

    name: Name
    position: Vector3  # m
    quaternion: Quaternion


class Truth(Message, frozen=True, kw_only=True):
    """Ground truth of the simulator: for tests, figures and the renderer, never for a service of the robot."""

    stream: ClassVar[Stream] = Stream(
        "sim/truth", "DATA", writers=("robot_sim",), readers=("renderer",), when="never for a service of the robot"
    )

    q: RobotVector  # rad, joint side, without noise
    depth: float  # m, deepest solid contact of a watched pair since the last message, 0 = none
    pair: Text  # names of that pair
    gap: float  # m, smallest distance of hands and forearms to the table, -1 = not measured
    objects: list[ObjectTruth]
