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
    """The header of every message: the fields with which all messages begin."""

    stream: ClassVar[Stream]

    v: int  # version of the contract
    run: Name  # id of robot_sim's run, the time from one start or reset of robot_sim to the next
    src: Name  # name of the service that sent the message
    seq: Count  # sequence number of the publisher, from 0
    k: Count  # tick of robot_sim to which the message belongs
    t: Count  # ns, bus clock
    tw: int  # ns, sender's monotonic clock, for diagnosis only


class Clock(Message, frozen=True, kw_only=True):
    """Start of tick k.

    In mode "free" the ticks follow real time; in mode "lock" (lockstep) the next tick begins when all participants have answered this one;
    in mode "paused" time stands still.
    """

    stream: ClassVar[Stream] = Stream(
        "clock", "CONTROL", writers=("robot_sim",), readers=EVERYONE, when="at every tick, but at most 100 times per second of real time"
    )

    dt: Annotated[int, Meta(gt=0, le=10_000_000_000)]  # ns per tick
    mode: Literal["free", "lock", "paused"]
    rate: Annotated[float, Meta(gt=0, le=1000)]  # simulated seconds per second of real time, as configured


class PartStatus(Struct, frozen=True, forbid_unknown_fields=True):
    """Status of one part in `Tick`, as in `State`: sampling time, state of its gate (the check of its commands), command in force."""

    k: Count  # tick in which the part was sampled
    t: Count  # ns, bus clock, time of the sample
    mode: Mode  # kind of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # sequence number of the command in force, -1 = none
    cmd_age: int  # age of the command in force: ticks since the state from which it was computed, -1 = none


class Tick(Clock, frozen=True, kw_only=True):
    """Start of tick k, with the newest state of every part; each part has its own sampling time."""

    stream: ClassVar[Stream] = Stream(
        "tick",
        "CONTROL",
        writers=("robot_sim",),
        readers=("model", "controller", "port_filter", "agent", "behaviour", "renderer"),
        when="every tick",
    )

    q: RobotVector  # rad, encoders of all motors
    parts: dict[Name, PartStatus]  # status of every part, by its name


class StepDone(Message, frozen=True, kw_only=True):
    """Answer of a participant (a process for which each tick waits) in lockstep: it has published all its messages for tick re_k."""

    stream: ClassVar[Stream] = Stream("done/{service}", "STEP", writers=PARTICIPANTS, readers=("robot_sim",), when="in lockstep")

    re_k: Count  # tick that is answered
    ok: bool = True  # False: an input was missing, so the run is not repeatable
    busy: list[Name] = []  # from the controller: services that have nothing to decide, because all their parts are moving
    last: bool = False  # True: the sender leaves lockstep, and later ticks do not wait for it
    including: list[Name] = []  # participants whose answers to that tick the sender has used, so that they need not send StepDone


class Turn(Message, frozen=True, kw_only=True):
    """Message in lockstep to the participant that is named in the key: tick k waits for the answer of this participant.

    The tick waits because the participant may have an action to decide.
    """

    stream: ClassVar[Stream] = Stream("turn/{participant}", "STEP", writers=("robot_sim",), readers=PARTICIPANTS, when="in lockstep")

    dt: Count  # ns per tick


class State(Message, frozen=True, kw_only=True):
    """Measured state of the motors of one part, and of its gate (the check of its commands), at the part's own sampling time t."""

    stream: ClassVar[Stream] = Stream(
        "{part}/state",
        "CONTROL",
        writers=("robot_sim",),
        readers=("renderer", "monitor", "port_filter"),
        when="every tick, at the sampling time of the part, if there is a subscriber",
    )

    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s
    tau: PartVector  # N m
    mode: Mode  # kind of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # sequence number of the command in force, -1 = none
    cmd_age: int  # age of the command in force: ticks since the state from which it was computed, -1 = none


class Command(Message, frozen=True, kw_only=True):
    """Command to the motors of one part, computed from the state of tick re_k."""

    stream: ClassVar[Stream] = Stream(
        "{part}/cmd",
        "CONTROL",
        writers=("port_filter", "driver"),
        readers=("robot_sim",),
        when="every tick, by a program that drives a single part",
    )

    epoch: Count  # drive epoch of the sender, as in `Taken`
    re_k: Count  # tick of the state from which the command was computed
    mode: Mode  # kind of command
    ref: PartVector  # rad, rad/s or N m, by mode; ignored on hold
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms from the start of tick re_k, after which the part holds (in lockstep after 3 ticks)


class Order(Struct, frozen=True, forbid_unknown_fields=True):
    """Command to one part in `Commands`: the sender's ownership (epoch) and the kind of command; the reference is in `Commands.ref`."""

    epoch: Count  # drive epoch of the sender, as in `Taken`
    mode: Mode  # kind of command


class Answer(Struct, frozen=True, forbid_unknown_fields=True):
    """Answer of the controller to a tick, as a field of `Commands`, in lockstep (each tick waits for all participants).

    `ok` False: an input was missing. `busy`: services that have nothing to decide, because all their parts are moving. `including`:
    participants whose answers to that tick the controller has used. The fields are those of `StepDone`.
    """

    ok: bool
    busy: list[Name]
    including: list[Name]


class Commands(Message, frozen=True, kw_only=True):
    """Commands to the motors of several parts, computed from the state of tick re_k; parts that are not named are not affected.

    A part goes into hold (brakes and stands still) `ttl` ms after the start of that tick (in lockstep after 3 ticks), unless it has got a
    newer command. `parts` has the kind of command of each part, `ref` the values for all motors.
    """

    stream: ClassVar[Stream] = Stream("commands", "CONTROL", writers=("controller", "driver"), readers=("robot_sim",), when="every tick")

    re_k: Count  # tick of the state from which the commands were computed
    parts: dict[Name, Order]  # orders, by name of the part
    ref: RobotVector  # rad, rad/s or N m, by the part's mode; ignored on hold, and for parts that are not named
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms from the start of tick re_k, after which these parts hold (in lockstep after 3 ticks)
    answer: Answer | None  # None: the tick is not answered yet, or free mode


class Motion(Message, frozen=True, kw_only=True):
    """State of a part and of its newest action: measured positions, commanded velocity and acceleration, goal, contacts.

    The goal is the attractor, the posture to which the spring of the control law pulls the part.
    """

    stream: ClassVar[Stream] = Stream(
        "{part}/motion",
        "CONTROL",
        writers=("controller",),
        readers=("agent", "behaviour", "monitor"),
        when="at once after a change, otherwise up to 100 times per second",
    )

    action_id: Text  # id of the part's newest action; empty: none
    epoch: Count  # goal epoch in force, 0 = no owner
    owner: Text = ""  # service that owns the goal
    status: MotionStatus
    since_k: Count  # tick at which the status began
    start_k: Count  # tick at which the action began
    q: PartVector  # rad, encoders
    dq: PartVector  # rad/s, the controller's own velocity
    ddq: PartVector  # rad/s^2, the controller's own acceleration
    goal: PartVector  # rad, attractor q*
    touched: list[Name]  # names of the world objects in contact with the part


class Follow(Message, frozen=True, kw_only=True):
    """A moving attractor, the posture to which a part moves. Without a message for 0.1 s, the controller assumes the attractor to rest."""

    stream: ClassVar[Stream] = Stream(
        "{part}/follow",
        "LATEST",
        writers=("behaviour", "client"),
        readers=("controller",),
        when="while a behaviour moves a part, at least 20 times per second",
    )

    epoch: Count  # goal epoch of the sender, as in `Taken`; a message with another epoch has no effect
    q: PartVector  # rad, present attractor q*
    dq: PartVector  # rad/s, velocity of the attractor


class Reach(Message, frozen=True, kw_only=True):
    """State of the newest reach of a part: a force pulls a marker to a target, then the part returns (thesis 8.2).

    It returns to its attractor, the posture to which the spring of the control law pulls it, unless the reach was requested with `stay`.
    """

    stream: ClassVar[Stream] = Stream(
        "{part}/reach",
        "CONTROL",
        writers=("controller",),
        readers=("model", "agent", "monitor"),
        when="at once after a change, during a reach also up to 100 times per second",
    )

    action_id: Text  # as in Motion
    phase: ReachPhase  # reaching: the force acts; returning: the attractor pulls the part back; over: ended; interrupted: ended early
    marker: Name
    object: Name  # the target, an object of the model's world
    end_k: Count  # tick at which the force ended, or the newest tick while it acts; the fields below are of that tick
    target: Vector3  # m, position of the target
    q: PartVector  # rad, encoders
    position: Vector3  # m, position of the marker
    missing: float  # m, remaining distance of the marker to its goal
    settled: bool  # True: the force ended because the part had settled
    touched: list[Name]  # names of the world objects in contact with the part


class Playback(Message, frozen=True, kw_only=True):
    """State of a motion of the robot along a path of a roadmap, which is a graph of poses that was computed before."""

    stream: ClassVar[Stream] = Stream(
        "roadmap/playback",
        "NEWEST",
        writers=("operator",),
        readers=("monitor",),
        when="five times a second while `mobee roadmap play --live` moves the robot",
    )

    phase: PlaybackPhase  # moving: until the robot rests; over: it rests; interrupted: a part was lost, or the command was ended
    place: Text  # end of the path, in the coordinates of the roadmap
    marker: Name  # marker that the roadmap moves
    path: Annotated[list[Vector3], Meta(max_length=200)]  # m, positions of the marker in the planned motion, at equal intervals of time
    share: Annotated[float, Meta(ge=0, le=1)]  # share of the planned motion that is over
    duration: float  # s, duration of the planned motion
    missing: float  # m, distance of the marker from the end of the path


class Targets(Message, frozen=True, kw_only=True):
    """Positions, at tick re_k, of the targets of all reaches in progress.

    A reach ends when its target is not in the model's world any more.
    """

    stream: ClassVar[Stream] = Stream(
        "model/targets", "CONTROL", writers=("model",), readers=("controller",), when="every tick during a reach"
    )

    re_k: Count
    positions: dict[Name, Vector3]  # m, by name of the target
    gone: list[Name] = []  # targets that are not in the model's world any more


class MarkerPose(Struct, frozen=True, forbid_unknown_fields=True):
    """Position and orientation, in the root frame, of a marker, which is a named point on a link."""

    name: Name
    position: Vector3  # m
    quaternion: Quaternion


class Pose(Message, frozen=True, kw_only=True):
    """Poses of all markers at tick re_k, as the model computes them from the encoders."""

    stream: ClassVar[Stream] = Stream("model/pose", "LATEST", writers=("model",), readers=(), when="every tick, if there is a subscriber")

    re_k: Count
    q: RobotVector  # rad, encoders of all parts, each of its own sampling time
    markers: list[MarkerPose]


class ContactItem(Struct, frozen=True, forbid_unknown_fields=True):
    """A contact: two shapes of the robot, or a shape of the robot and an object, that overlap. Their names are `first` and `second`."""

    first: Name
    second: Name
    kind: Literal["solid", "field"]  # field: one of the shapes is a field, a larger volume that only generates a force
    depth: float  # m
    point: Vector3  # m, midway between the two deepest points
    normal: Vector3  # unit vector, the direction in which `first` must move to end the contact
    first_link: Link
    second_link: Link


class Forces(Message, frozen=True, kw_only=True):
    """Forces of the control law at tick re_k: for each term of the law, its force on every motor.

    The model publishes the constraint forces (thesis eqs. 5.11-5.17), the controller the user-defined terms.
    """

    stream: ClassVar[Stream] = Stream(
        "{source}/forces",
        "CONTROL",
        writers=("model", "controller"),
        readers=("controller", "monitor"),
        when="every tick; by the controller only if it has user-defined terms (delivery LATEST)",
    )

    re_k: Count
    terms: dict[Name, RobotVector]  # rad/s^2 on all motors, by name of the term, in the order of addition
    part_age: dict[str, int]  # ns between the sample of a part and tick re_k, by part
    touched: dict[str, list[Name]]  # names of the world objects in contact with each part, by part
    contacts: list[ContactItem] | None = None  # all contacts at that tick, if the controller has user-defined terms; else None


class Contacts(Message, frozen=True, kw_only=True):
    """All contacts at tick re_k."""

    stream: ClassVar[Stream] = Stream(
        "model/contacts", "LATEST", writers=("model",), readers=("monitor",), when="every tick, if there is a subscriber"
    )

    re_k: Count
    contacts: list[ContactItem]


class Geometry(Struct, frozen=True, forbid_unknown_fields=True):
    """A shape.

    `size` in m is (radius) for a sphere, (radius, height along the local z axis) for a capsule or cylinder, and the lengths of the edges
    (x, y, z) for a box. The caps of a capsule lie beyond its height.
    """

    kind: GeometryKind
    size: Annotated[list[Annotated[float, Meta(gt=0)]], Meta(min_length=1, max_length=3)]


class WorldObject(Message, frozen=True, kw_only=True):
    """An object as vision perceives it. While the object is hidden, t_capture stays the same and the covariance grows."""

    stream: ClassVar[Stream] = Stream(
        "world/{object}",
        "DATA",
        writers=("vision",),
        readers=("model", "behaviour", "monitor"),
        when="after each pair of usable pictures, and when vision withdraws the object",
    )

    name: Name
    geometry: Geometry
    position: Vector3  # m
    quaternion: Quaternion
    covariance: Matrix3  # m^2, covariance of the position
    role: Role
    t_capture: Count  # ns, time of the newest picture that shows it
    valid_until: Count  # ns, time after which the model removes the object; 0: at once


class Image(Message, frozen=True, kw_only=True):
    """Picture of one camera, rows from top to bottom; t is the middle of the exposure by the camera's clock."""

    stream: ClassVar[Stream] = Stream(
        "vision/image/{camera}",
        "BULK",
        writers=("renderer",),
        readers=("vision", "monitor"),
        when="5 times per second (the renderer's setting `frame_rate`), if there is a subscriber",
    )

    camera: Name
    k_capture: Count  # tick of the exposure
    width: Annotated[int, Meta(gt=0, le=4096)]
    height: Annotated[int, Meta(gt=0, le=4096)]
    encoding: Literal["rgb8"]
    data: bytes  # height x width x 3 bytes


class Camera(Message, frozen=True, kw_only=True):
    """Data for one `Image`: properties of the camera's lens, exposure, and the robot's encoder values at the time t of the picture."""

    stream: ClassVar[Stream] = Stream(
        "vision/camera/{camera}", "BULK", writers=("renderer",), readers=("vision",), when="with each picture"
    )

    camera: Name
    k_capture: Count  # tick of the exposure
    intrinsics: Matrix3  # pixels; pixel centres at integers, origin top left
    distortion: list[float]  # k1 k2 p1 p2 of Brown and Conrady, or empty
    exposure: Annotated[float, Meta(ge=0)]  # s
    q: list[float]  # rad, encoders of all motors
    dq: list[float]  # rad/s, all motors
    readings: Annotated[int, Meta(gt=0)]  # number of readings of each encoder to which a line was fitted to compute q and dq


class Transition(Message, frozen=True, kw_only=True):
    """One observed transition of an agent: an action in a state, and the state in which it ended."""

    stream: ClassVar[Stream] = Stream(
        "agents/{part}/transition", "EVENTS", writers=("agent",), readers=("monitor",), when="at the end of an action"
    )

    agent: Name
    n: Count  # number of transitions that the agent has observed, including this one
    s: Count  # state before the action
    a: Count  # number of the action in that state
    goal: Count  # state at which the action aims
    s_next: Count  # observed state after the action
    reward: float  # 'Kail' divergence, nats; of a reaching agent 0, or the penalty of a failure
    value: float  # V(s) before the action
    probability: Annotated[float, Meta(ge=0, le=1)]  # of s_next, as the agent believed before the action
    settled: bool  # False: the action timed out
    duration: float  # s
    touched: list[Name]  # names of the world objects in contact at the end


class Decision(Message, frozen=True, kw_only=True):
    """The action that an agent begins, and what it expects from the action."""

    stream: ClassVar[Stream] = Stream(
        "agents/{part}/decision", "NEWEST", writers=("agent",), readers=("monitor",), when="at the start of an action"
    )

    agent: Name
    n: Count  # number of transitions that the agent has observed
    s: Count  # present state
    a: Count  # number of the action in that state
    goal: Count  # state at which the action aims
    tries: Count  # number of tries of this state-action so far
    reached: Annotated[float, Meta(ge=0, le=1)]  # believed probability that the action reaches its goal
    expected: Count  # most probable next state
    probability: Annotated[float, Meta(ge=0, le=1)]  # believed probability of `expected`
    reward: float  # the last information gain of this state-action, nats
    explorer: Text  # how the agent chooses actions
    plan: list[Count]  # states that the agent expects to pass after this action, up to the state-action where it expects to learn most


class Surprise(Struct, frozen=True, forbid_unknown_fields=True):
    """A state, other than the action's goal, in which some tries of an action ended, and the share of these tries; part of `Learned`."""

    s: Count  # state before the action
    a: Count  # number of the action in that state
    s_next: Count  # observed state after the action
    share: Annotated[float, Meta(gt=0, le=1)]  # share of the action's tries with this outcome


class Learned(Message, frozen=True, kw_only=True):
    """Counts, rewards and values of an agent's state-actions: matrices of S states (rows) with at most A actions (columns)."""

    stream: ClassVar[Stream] = Stream(
        "agents/{part}/learned", "NEWEST", writers=("agent",), readers=("monitor",), when="at most twice a second"
    )

    agent: Name
    n: Count  # number of transitions that the agent has observed
    s: Count  # current state of the agent
    space: Annotated[str, Meta(max_length=1_000_000)]  # JSON of the settings from which the state space can be made
    tries: bytes  # number of tries, (S A) little-endian uint32; 0 also where a state has no such action
    reward: bytes  # (S A) little-endian float32, nats, or failures as in Transition; -inf where a state has no such action
    value: bytes  # (S A) little-endian float32, action values of the plan; -inf where a state has no such action
    surprises: list[Surprise]


class Event(Message, frozen=True, kw_only=True):
    """A log entry of a service for the user."""

    stream: ClassVar[Stream] = Stream(
        "event/{service}", "EVENTS", writers=EVERYONE, readers=("monitor",), when="when something happens that the user should know"
    )

    level: Literal["info", "warning", "error"]
    code: Name  # short name of the kind of event
    text: Text  # text for the user
    values: dict[str, float]  # numbers that belong to the event, by name


class EStop(Message, frozen=True, kw_only=True):
    """Emergency stop. robot_sim latches it: all parts hold until the call `estop/rpc/reset`.

    A message whose `set` is false releases nothing; it only reports that the stop was reset.
    """

    stream: ClassVar[Stream] = Stream(
        "estop",
        "STOP",
        writers=EVERYONE,
        readers=("robot_sim", "controller", "port_filter", "agent", "launcher", "monitor"),
        when="at a stop; launcher and controller repeat it until robot_sim has latched it, then robot_sim repeats it",
    )

    set: bool  # True: stop; False: robot_sim reports that the stop was reset
    source: Name  # name of the process that stopped the robot, or that reset the stop
    reason: Text  # text for the user


class Served(Message, frozen=True, kw_only=True):
    """A call that the sender has answered, with the request and the reply as they were sent.

    The calls `stat` and `config` are not published: they are repeated often, and change nothing.
    """

    stream: ClassVar[Stream] = Stream(
        "served/{service}", "CONTROL", writers=EVERYONE, readers=(), when="after each call, if there is a subscriber"
    )

    key: Text  # key of the call
    request: bytes  # msgpack
    request_type: Name  # name of the request's struct
    reply: bytes  # msgpack
    reply_type: Name  # name of the reply's struct; Failure: the call was refused


class ObjectTruth(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of an object in the simulator."""

    name: Name
    position: Vector3  # m
    quaternion: Quaternion


class Truth(Message, frozen=True, kw_only=True):
    """Ground truth of the simulator, for tests, figures and the renderer. No service of the robot may use it."""

    stream: ClassVar[Stream] = Stream(
        "sim/truth",
        "DATA",
        writers=("robot_sim",),
        readers=("renderer",),
        when="20 times per second (robot_sim's setting `truth_rate`), if there is a subscriber",
    )

    q: RobotVector  # rad, joint side, without noise
    depth: float  # m, deepest solid contact of a watched pair since the last message, 0 = none
    pair: Text  # names of that pair; empty: none
    gap: float  # m, smallest distance of hands and forearms from the obstacles, -1 = not measured
    objects: list[ObjectTruth]
