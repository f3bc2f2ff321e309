# SPDX-License-Identifier: Apache-2.0
"""A robot and its world in MuJoCo: joints, masses, solids that can collide, and motors, which are constraints on joint velocities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import mujoco
import numpy as np

from mobee import Model
from mobee.arrays import Array, Ints
from mobee.control.law import INERTIA
from mobee.model.kinematics import matrix_from_quaternion, quaternion_from_matrix
from mobee.model.world import World, WorldObject
from mobee.robot.bodies import WATER_DENSITY, ball_of_water, can_be
from mobee.robot.robot import Body, Motor, Robot
from services.robot_sim.mujoco_spec import add_tree, add_volume, joint_name

GRAVITY = (0.0, 0.0, -9.81)  # m/s^2
NEGLIGIBLE = 1e-6  # kg, of a link without mass in a robot with masses: what carries the link includes its weight
HARDEST = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp of motors, couplings and stops: as hard as MuJoCo allows
SOLID = (0.1, 0.99, 0.0005, 0.5, 2.0)  # solimp of contacts: harder with the depth, within 0.5 mm, so that a pressing hand comes to rest
FRICTION = 0.5  # of contacts that no movable object takes part in, as PyBullet's
SPIN, ROLL = 0.003, 0.0003  # m, friction against turning about the normal and against rolling, of movable objects, for a coefficient of 1
SLIP = 10.0  # MuJoCo's impratio where something is movable: friction is so much harder than the normal that what is gripped does not creep
ARENA = 64 * 2**20  # bytes; holds some 100 000 contacts, so that none is left out

GeomPair = tuple[str, str]


class MujocoScene:
    """The robot and its world in MuJoCo: the compiled model, its state, and the degrees of freedom and constraints of each motor.

    A motor acts on one of its joints: the one with the largest absolute scale. The other joints of the motor follow this joint. A motor is
    a constraint that brings its joint to a given velocity with a limited torque. It is made with MuJoCo's dry friction of joints. Dry
    friction normally brings a joint to velocity 0; here the back-end sets another velocity in every substep.

    Arrays of the n motors: `scale`, `offset` (n,): joint position = scale * motor position + offset. `dofs` (n,): degree of freedom of the
    joint in MuJoCo. `rows` (n,): row of the motor's constraint in MuJoCo.
    """

    def __init__(self, robot: Robot, world: World, substep: float) -> None:
        """Build the model with the robot at home; `substep`: time step of the physics, s."""
        self._robot, self._substep = robot, substep
        self.left_out = touching_at_home(robot, world)
        """Depth [m] of each pair of solids that touch at home, by the set of their two names. Contacts of these pairs are not simulated."""
        spec = _options(substep, any(_moves(thing) for thing in world.objects.values()))
        bodies, origins = add_tree(spec, robot, self._weigh)
        for index, shape in enumerate(robot.shapes):
            if shape.role == "solid":
                geom = add_volume(spec, bodies[shape.link], _of_shape(index), shape, shape.position - origins[shape.link])
                geom.contype = geom.conaffinity = 0  # only the pairs below are tested
                geom.density = WATER_DENSITY  # counts where `_weigh` gives the link no mass
        for name, thing in world.objects.items():
            pose = {"pos": thing.position, "quat": quaternion_from_matrix(thing.rotation)}
            body = spec.worldbody.add_body(name=_of_object(name), mocap=not _moves(thing), **pose)
            geom = add_volume(spec, body, _of_object(name), thing, np.zeros(3))
            geom.quat, geom.contype, geom.conaffinity = (1.0, 0.0, 0.0, 0.0), 0, 0
            if _moves(thing):
                geom.mass = thing.mass
                body.add_freejoint()
        self.pairs_watched = self._add_pairs(spec, world)
        joints = [max(motor.joints, key=lambda one: abs(one[1])) for motor in robot.motor_table]
        self.scale, self.offset = np.array([scale for _, scale, _ in joints]), np.array([offset for _, _, offset in joints])
        for motor, (joint, scale, offset) in zip(robot.motor_table, joints, strict=True):
            self._add_motor(spec, motor, joint, scale, offset)
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        self._number(world, [joint for joint, _, _ in joints])
        self.set_posture(robot.home)
        self.notes = self._assumptions()

    def set_posture(self, q: Array) -> None:
        """Put the joints at the motor positions q (n,) rad, at rest."""
        matrix, offset = self._robot.coupling
        self.data.qpos[self._all_qpos] = matrix @ q + offset
        self.data.qvel[:] = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Compute the quantities that depend on positions and velocities: masses, contacts, constraints."""
        mujoco.mj_step1(self.model, self.data)

    def motor_positions(self) -> Array:
        """Return the positions (n,) rad of the motors, computed from the joints on which they act."""
        q: Array = (self.data.qpos[self._qpos] - self.offset) / self.scale
        return q

    def move(self, name: str, position: Iterable[float]) -> None:
        """Move a world object to `position` (3,) m, root frame.

        A movable object is then at rest, with the orientation in the world's file.
        """
        if name in self._mocap:
            self.data.mocap_pos[self._mocap[name]] = tuple(position)
        else:
            joint = self._free[name]
            qpos, dof = joint.qposadr[0], joint.dofadr[0]
            self.data.qpos[qpos : qpos + 7] = (*position, *self.model.qpos0[qpos + 3 : qpos + 7])
            self.data.qvel[dof : dof + 6] = 0.0
        self.refresh()

    @property
    def movable(self) -> Iterable[str]:
        """The names of the objects that move when they are pushed."""
        return self._free.keys()

    def pose_of(self, name: str) -> tuple[Array, Array]:
        """Return position (3,) m and rotation (3, 3) of a movable object, root frame."""
        at = self._free[name].qposadr[0]
        return self.data.qpos[at : at + 3].copy(), matrix_from_quaternion(self.data.qpos[at + 3 : at + 7])

    def set_gear(self, motor: Motor, inertia: float, friction: float) -> None:
        """Set the inertia [kg m^2] and the viscous friction [N m s/rad] that a motor has behind its gear; call `refresh` afterwards."""
        for joint, scale, _ in motor.joints:
            dof = self._all_dofs[joint]
            self.model.dof_armature[dof] = _share(inertia, motor, scale)
            self.model.dof_damping[dof] = _share(friction, motor, scale)

    def contacts(self) -> Mapping[tuple[str, str], float]:
        """Return the depth [m], at the deepest point, of each pair that overlaps.

        Keys are pairs of sorted names, of two links or of a link and an object. Pairs of two objects are left out.
        """
        data, found = self.data, dict[tuple[str, str], float]()
        if data.ncon == 0:
            return found
        contact = data.contact
        for (first, second), distance in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
            if distance < 0.0 and not (first in self._objects and second in self._objects):
                one, other = self._names[first], self._names[second]
                pair = (one, other) if one < other else (other, one)
                found[pair] = max(-distance, found.get(pair, 0.0))
        return found

    def distance(self, links: Iterable[str], objects: Iterable[str], within: float) -> float:
        """Return the smallest distance [m] between the links `links` and the objects `objects`; negative if they overlap.

        The result is `within` [m] if all distances are larger.
        """
        ours = [geom for link in links for geom in self._solids.get(link, ())]
        theirs = [self.model.geom(_of_object(name)).id for name in objects]
        nearest = within
        for one in ours:
            for other in theirs:  # beyond the nearest one so far MuJoCo's search ends early
                nearest = min(nearest, mujoco.mj_geomDistance(self.model, self.data, one, other, nearest, None))
        return nearest

    def _weigh(self, body: Any, link: int, origin: Array) -> None:
        """Give the link its mass; without masses in the robot's file, MuJoCo computes it from the link's solids."""
        known = {one.link: one for one in self._robot.bodies}.get(link)
        if known is None or known.mass < NEGLIGIBLE:
            solid = any(shape.link == link and shape.role == "solid" for shape in self._robot.shapes)
            if not self._robot.bodies and solid:
                return
            known = Body(link, NEGLIGIBLE, origin)
        inertia = known.inertia
        if inertia is None or not can_be(inertia) or np.linalg.eigvalsh(inertia)[0] <= 0.0:
            inertia = ball_of_water(known.mass)
        body.explicitinertial, body.mass, body.ipos = True, known.mass, known.centre - origin
        body.fullinertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]

    def _assumptions(self) -> tuple[str, ...]:
        notes = []
        if not self._robot.bodies:
            notes.append(f"the robot's file has no masses: those of its solids at {WATER_DENSITY:g} kg/m^3 are taken")
        if self.left_out:
            pair, depth = max(self.left_out.items(), key=lambda item: item[1])
            some = f"{len(self.left_out)} pairs of solids overlap at home and are not tested for contact"
            notes.append(f"{some}; the deepest is {' and '.join(sorted(pair))}, by {depth * 1e3:.1f} mm")
        load = np.abs(self.data.qfrc_bias[self._all_dofs] @ self._robot.coupling[0])
        weak = [motor.name for motor, weight in zip(self._robot.motor_table, load.tolist(), strict=True) if weight > motor.max_torque]
        if weak:
            notes.append(f"too weak to carry the robot's weight at home, so that they give way: {', '.join(weak)}")
        return tuple(notes)

    def _add_pairs(self, spec: Any, world: World) -> int:
        """Add the pairs of geoms that are tested for contact; returns how many pairs of links, or of link and object, they belong to."""
        robot, watched, solid = self._robot, set(), [thing for thing in world.objects.values() if thing.role != "ghost"]
        for first, second in robot.solid_pairs.tolist():
            links = robot.links[robot.shapes[first].link], robot.links[robot.shapes[second].link]
            self._add_pair(spec, (_of_shape(first), _of_shape(second)), (robot.shapes[first].name, robot.shapes[second].name), ())
            watched.add(frozenset(links))
        for index, shape in enumerate(robot.shapes):
            if shape.role == "solid" and index not in robot.base_shapes:
                for thing in solid:
                    self._add_pair(spec, (_of_shape(index), _of_object(thing.name)), (shape.name, thing.name), (thing,))
                    watched.add(frozenset((robot.links[shape.link], thing.name)))
        for thing, other in combinations(solid, 2):
            if _moves(thing) or _moves(other):
                self._add_pair(spec, (_of_object(thing.name), _of_object(other.name)), (thing.name, other.name), (thing, other))
        return len(watched)

    def _add_pair(self, spec: Any, geoms: GeomPair, names: GeomPair, things: Sequence[WorldObject]) -> None:
        """Add one pair of geoms to the MuJoCo model, unless `left_out` contains the pair. `things`: the world objects of the pair, 0 to 2.

        If objects of the pair move, the rougher of them determines the friction.
        """
        if frozenset(names) in self.left_out:
            return
        rough = max((thing.friction for thing in things if _moves(thing)), default=None)
        friction = (FRICTION, FRICTION, 0.0, 0.0, 0.0) if rough is None else (rough, rough, SPIN * rough, ROLL * rough, ROLL * rough)
        spec.add_pair(
            geomname1=geoms[0], geomname2=geoms[1], condim=3 if rough is None else 6, friction=friction, solref=self._soonest, solimp=SOLID
        )

    @property
    def _soonest(self) -> tuple[float, float]:
        """MuJoCo's parameter solref of the hardest constraint that a substep allows."""
        return 2.0 * self._substep, 1.0

    def _add_motor(self, spec: Any, motor: Motor, joint: int, scale: float, offset: float) -> None:
        low, high = sorted(scale * limit + offset for limit in motor.limits)
        own = spec.joint(joint_name(joint))
        own.frictionloss, own.solref_friction, own.solimp_friction = motor.max_torque / abs(scale), self._soonest, HARDEST
        own.limited, own.range, own.solref_limit, own.solimp_limit = True, (low, high), self._soonest, HARDEST
        for other, factor, shift in motor.joints:
            spec.joint(joint_name(other)).armature = _share(reflected_inertia(motor), motor, factor)
            if other != joint:
                ratio = factor / scale
                spec.add_equality(
                    type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=joint_name(other), name2=joint_name(joint),
                    data=[shift - ratio * offset, ratio, *[0.0] * (mujoco.mjNEQDATA - 2)], solref=self._soonest, solimp=HARDEST,
                )  # fmt: skip

    def _number(self, world: World, joints: list[int]) -> None:
        model, robot = self.model, self._robot
        at = [model.joint(joint_name(index)) for index in range(len(robot.joints))]
        self._all_qpos: Ints = np.array([one.qposadr[0] for one in at])
        self._qpos: Ints = self._all_qpos[joints]
        self._all_dofs: Ints = np.array([one.dofadr[0] for one in at])
        self.dofs: Ints = self._all_dofs[joints]
        self.rows: Ints = np.empty(len(joints), dtype=np.intp)
        self.rows[np.argsort(self.dofs)] = model.neq + np.arange(len(joints))  # MuJoCo's order: equalities, then friction by dof
        bodies = {name: model.body(_of_object(name)) for name in world.objects}
        self._mocap = {name: int(body.mocapid[0]) for name, body in bodies.items() if body.mocapid[0] >= 0}
        self._free = {name: model.jnt(int(body.jntadr[0])) for name, body in bodies.items() if body.mocapid[0] < 0}
        self._names: dict[int, str] = {model.geom(_of_object(name)).id: name for name in world.objects}
        self._objects = frozenset(self._names)
        self._solids: dict[str, list[int]] = {}
        for index, shape in enumerate(robot.shapes):
            if shape.role == "solid":
                geom, link = model.geom(_of_shape(index)).id, robot.links[shape.link]
                self._names[geom] = link
                self._solids.setdefault(link, []).append(geom)


def reflected_inertia(motor: Motor) -> float:
    """Return the inertia [kg m^2] of a motor's rotor as it acts behind the gear.

    It is the inertia INERTIA of the control law (0.5 kg m^2), but at most max_torque / (2 max_acceleration) of the motor: half of the
    motor's largest torque is then enough for its largest acceleration.
    """
    return min(INERTIA, 0.5 * motor.max_torque / motor.max_acceleration)


def _share(amount: float, motor: Motor, scale: float) -> float:
    """Return the share of one joint in an inertia or friction `amount` at the motor, in the joint's own coordinate.

    The joints of a motor get equal shares. `scale`: joint motion per motor motion.
    """
    return amount / (len(motor.joints) * scale**2)


def touching_at_home(robot: Robot, world: World) -> dict[frozenset[str], float]:
    """Return the pairs of solids that overlap in the home posture: a dict from the set of their two names to the depth [m].

    The contacts are those of `mobee.Model`.
    """
    contacts = Model(robot, world).evaluate(robot.home).contacts
    return {frozenset((one.first, one.second)): one.depth for one in contacts if one.kind == "solid"}


def _moves(thing: WorldObject) -> bool:
    """Return whether an object moves when it is pushed; nothing touches a ghost, so it would fall."""
    return thing.movable and thing.role != "ghost"


def _options(substep: float, something_moves: bool) -> Any:
    spec = mujoco.MjSpec()
    spec.memory, spec.compiler.degree = ARENA, False
    spec.compiler.boundmass, spec.compiler.boundinertia = NEGLIGIBLE, ball_of_water(NEGLIGIBLE)[0, 0]  # of a link with tiny solids
    option, flag = spec.option, mujoco.mjtDisableBit
    option.timestep, option.gravity = substep, GRAVITY
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if something_moves:
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, SLIP
    option.disableflags |= int(flag.mjDSBL_AUTORESET | flag.mjDSBL_ISLAND)  # the watch reports positions that are not finite
    return spec


def _of_shape(index: int) -> str:
    """Return the name of a solid's geom: by number, since shapes may share a name with each other or with an object."""
    return f"shape{index}"


def _of_object(name: str) -> str:
    return f"object {name}"
