# SPDX-License-Identifier: Apache-2.0
"""Programs of other authors, for comparison with MoBeE: how to import them, and their adapters.

They are CMA-ES, coal (collision detection), solvers of MDPs (SciPy's sparse matrices and quantecon), and MuJoCo: kinematics and collision
detection of a robot in a world, and the time of its simulation steps.  All but SciPy are imported when they are first needed.  python-fcl
and coal for a robot in a world are in collision_peers.py.
"""

from __future__ import annotations

import importlib
import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from mobee.arrays import Array, Ints
from mobee.errors import NotInstalled
from mobee.learning.value_iteration import OutcomeModel
from mobee.model.world import WorldObject
from mobee.robot.robot import LinkPair, Robot
from mobee.simulation import MotorParameters, OfflinePlant
from mobee.simulation.rigid import stiffened

QUANTECON = {"value_iteration": "quantecon value iteration", "modified_policy_iteration": "quantecon modified policy iteration"}
# Of coal's iterative searches [m].  With 1e-6 or 1e-9 it misses contacts of cylinders, up to 46 mm deep (baxter), which polytopes inside
# of them and python-fcl confirm; its plain search misses contacts of some micrometres.
_COAL_TOLERANCE, _COAL_ITERATIONS, _COAL_SEARCH = 1e-12, 1000, "NesterovAcceleration"
_ARENA = 64 * 2**20  # bytes of memory of MuJoCo; holds some 100 000 contacts, so that none is left out
SERVO_GAIN = 20.0  # N m s/rad, of velocity servos on bodies of 1 kg and 1 kg m^2
COMMAND_PERIOD = 50  # ticks between two commands


def import_peer(module: str, name: str, extra: str = "bench") -> Any:
    """Import the optional module `module` and return it; raises NotInstalled if it is missing.

    `name`, `extra`: name of the package, and the extra of MoBeE that installs it, for the message of the error.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise NotInstalled(f'{name} is not installed: pip install "mobee[{extra}]"') from None


def load_cma() -> Any:
    """Return the imported package cma (CMA-ES by its authors); raises NotInstalled if it is missing."""
    return import_peer("cma", "cma")


class CmaStrategy:
    """CMA-ES with its default settings and the interface of the library's strategies.

    `ask` returns a generation of samples, and `tell` takes their costs.

    Args:
        start: mean of the first generation (d,).
        std: standard deviation of the first generation.
        seed: of the random numbers.
        population: samples of a generation; None: CMA-ES chooses.
        limits: lower and upper limit of every coordinate; None: no limits.
    """

    def __init__(
        self, start: Array, std: float, seed: int, population: int | None = None, limits: tuple[float, float] | None = None
    ) -> None:
        """Make the strategy.  `limits`: lower and upper limit of every coordinate; None: no limits.  Raises NotInstalled without cma."""
        options: dict[str, Any] = {"seed": seed + 1, "verbose": -9, "bounds": limits or [None, None]}  # its seed 0 means the time of day
        if population is not None:
            options["popsize"] = population
        self._strategy = load_cma().CMAEvolutionStrategy(start, std, options)
        self._asked: list[Array] = []

    def ask(self) -> Array:
        """Return the samples of the next generation, (population, d)."""
        self._asked = self._strategy.ask()
        return np.array(self._asked)

    def tell(self, costs: Array) -> None:
        """Update the strategy by the costs (population,) of the samples that the last call of `ask` returned."""
        self._strategy.tell(self._asked, costs.tolist())

    @property
    def stopped(self) -> bool:
        """Whether a stopping criterion of CMA-ES itself is met."""
        return bool(self._strategy.stop())


def make_searches_precise(found: Any) -> None:
    """Set method, tolerances and iterations of coal's searches in `found` (Pinocchio's GeometryData), so that it misses no contact."""
    search = import_peer("coal", "coal", extra="dev").GJKVariant.names[_COAL_SEARCH]
    for request in found.distanceRequests:
        request.enable_signed_distance = True
    for request in (*found.distanceRequests, *found.collisionRequests):
        request.gjk_variant = search
        request.gjk_tolerance = request.epa_tolerance = _COAL_TOLERANCE
        request.gjk_max_iterations = request.epa_max_iterations = _COAL_ITERATIONS
        with warnings.catch_warnings():  # deprecated, but the setting that replaces it has no effect
            warnings.simplefilter("ignore", DeprecationWarning)
            request.enable_cached_gjk_guess = False  # started where the last pose's search ended, coal misses a contact of 1 mm


def load_quantecon() -> Any:
    """Return quantecon's class DiscreteDP; raises NotInstalled if quantecon is missing."""
    return import_peer("quantecon.markov", "quantecon").DiscreteDP


class DecisionProblem:
    """A decision problem (MDP) in the form that SciPy and quantecon need: a sparse matrix with a row for each state-action.

    It is built before the timing begins.  Every state must have at least one action.  `rewards` (N,) and `following` (N, S) are the rewards
    and the transition probabilities of all N state-actions.  quantecon's policy iteration, which is exact, is not measured: it does not end
    if the values of two actions differ only by rounding errors.

    Args:
        model: transition model with S states.
        reward: (S, A), reward of each action; -inf where there is no action.
        discount: discount factor, 0 to 1.
        tolerance: largest change of an action's value in the last sweep of value iteration.
    """

    def __init__(self, model: OutcomeModel, reward: Array, discount: float, tolerance: float) -> None:
        self.discount, self.tolerance = discount, tolerance
        self.states, self.actions = np.nonzero(reward != -np.inf)
        self.rewards = np.ascontiguousarray(reward[self.states, self.actions])
        self.first = np.searchsorted(self.states, np.arange(len(reward)))
        weights, following = model.probabilities[self.states, self.actions], model.outcomes[self.states, self.actions]
        rows = np.repeat(np.arange(len(self.rewards)), weights.shape[1])
        self.following = csr_matrix((weights.ravel(), (rows, following.ravel())), shape=(len(self.rewards), len(reward)))
        self.following.eliminate_zeros()

    def scipy_values(self) -> Array:
        """Compute the values of the states (S,) by thesis Algorithm 7, with one product of SciPy's sparse matrix per sweep."""
        values, before = np.zeros(len(self.first)), np.zeros(len(self.rewards))
        while True:
            action_values = self.rewards + self.discount * (self.following @ values)
            values = np.maximum.reduceat(action_values, self.first)
            if np.abs(action_values - before).max() < self.tolerance:
                return values
            before = action_values

    def quantecon(self) -> Any:
        """Return the problem as an instance of quantecon's DiscreteDP."""
        return load_quantecon()(self.rewards, self.following, self.discount, self.states, self.actions)

    def quantecon_values(self, problem: Any, method: str) -> Array:
        """Compute the values of the states (S,) by quantecon.

        It starts from its own initial values, which are nearer to the solution than zeros.  Its value iteration stops by the same tolerance
        as ours.  `problem`: the result of `quantecon`.  `method`: a key of QUANTECON.
        """
        epsilon = 2.0 * self.discount / (1.0 - self.discount) * self.tolerance
        values: Array = problem.solve(method=method, epsilon=epsilon, max_iter=100_000).v
        return values


def load_mujoco() -> Any:
    """Return the imported package mujoco; raises NotInstalled if it is missing."""
    return import_peer("mujoco", "MuJoCo")


class MujocoPeer:
    """A robot and the objects of a world as a MuJoCo model.

    Objects and the robot's base are static, and MuJoCo does not test pairs of static bodies.
    """

    def __init__(self, robot: Robot, objects: Mapping[str, WorldObject], servo: float | None = None, precise: bool = False) -> None:
        """Build the MuJoCo model.

        `servo`: gain of velocity servos on all joints [N m s/rad], for `step`, without gravity; None: no servos.  `precise`: iterative
        searches continue to the last digits, which takes longer than MuJoCo's defaults.
        """
        self._mujoco = load_mujoco()
        self._coupling = robot.coupling
        spec = _spec(self._mujoco, robot, objects)
        if servo is not None:
            _add_servos(self._mujoco, spec, len(robot.joints), servo)
        if precise:
            spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-12, 1000
        self.model = spec.compile()
        self.data = self._mujoco.MjData(self.model)
        geoms = [shape.name for shape in robot.shapes] + list(objects)
        self._volume = np.empty(self.model.ngeom, dtype=np.intp)  # of each geom: MuJoCo numbers them body by body
        for volume, name in enumerate(geoms):
            self._volume[self.model.geom(name).id] = volume

    def joint_angles(self, q: Array) -> Array:
        """Return MuJoCo's joint positions qpos (..., joints) rad for motor positions q (..., n) rad.

        Callers convert all poses before the timing begins, so that the conversion is not timed.
        """
        matrix, offset = self._coupling
        order = np.argsort([self.model.joint(f"joint{index}").qposadr[0] for index in range(len(offset))])
        return np.ascontiguousarray((q @ matrix.T + offset)[..., order])

    def detect(self, angles: Array) -> int:
        """Compute forward kinematics and all contacts of one pose.  `angles`: qpos (joints,) rad.  Returns the number of contact points."""
        data = self.data
        data.qpos[:] = angles
        self._mujoco.mj_kinematics(self.model, data)
        self._mujoco.mj_collision(self.model, data)
        return int(data.ncon)

    def step(self, count: int) -> None:
        """Simulate `count` time steps of the MuJoCo model."""
        self._mujoco.mj_step(self.model, self.data, nstep=count)

    def touching(self) -> tuple[Ints, Array, Array]:
        """Return the contacts of the last call of `detect`.

        They are given as pairs (c, 2) of volumes, depths (c,) m, and unit vectors (c, 3), root frame.  Volumes are numbered: the robot's
        shapes come first, then the objects.  The smaller number of a pair is first, and the unit vector moves this volume out of the other.
        If MuJoCo finds several contact points for a pair, the deepest one is returned.
        """
        contact = self.data.contact
        volumes = self._volume[np.array(contact.geom).reshape(-1, 2)]
        depths, normals = -np.array(contact.dist), np.array(contact.frame).reshape(-1, 9)[:, :3]
        normals = np.where(volumes[:, :1] < volumes[:, 1:], -normals, normals)  # MuJoCo's leads from the first geom to the second
        order = np.argsort(-depths, kind="stable")
        pairs, which = np.unique(np.sort(volumes, axis=1)[order], axis=0, return_index=True)
        return pairs, depths[order][which], normals[order][which]


def _spec(mujoco: Any, robot: Robot, objects: Mapping[str, WorldObject]) -> Any:
    from services.robot_sim.mujoco_spec import add_tree, add_volume, link_name  # needs MuJoCo

    spec = mujoco.MjSpec()
    spec.memory = _ARENA
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)  # the robot's own table says which links are tested
    bodies, origins = add_tree(spec, robot, _weigh)
    for shape in robot.shapes:
        add_volume(spec, bodies[shape.link], shape.name, shape, shape.position - origins[shape.link])
    for name, item in objects.items():
        add_volume(spec, spec.worldbody, name, item, item.position)
    for one, other in map(sorted, robot.untested):
        spec.add_exclude(bodyname1=link_name(one), bodyname2=link_name(other))
    return spec


def _weigh(body: Any, link: int, origin: Array) -> None:
    """Give a link the mass of 1 kg and the moments of inertia of 1 kg m^2, because MuJoCo needs a mass for each.

    `body`: the link's body in MuJoCo.  The mass is at the origin of the body.
    """
    body.explicitinertial, body.mass, body.inertia = True, 1.0, np.ones(3)


def _add_servos(mujoco: Any, spec: Any, joints: int, gain: float) -> None:
    spec.option.gravity = np.zeros(3)
    for index in range(joints):
        servo = spec.add_actuator(name=f"servo{index}", target=f"joint{index}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_velocity(gain)


def us_per_tick(plant: OfflinePlant, ticks: int, seed: int = 0) -> float:
    """Return the processor time [us] of MuJoCo's steps for one control tick, while random velocities are commanded to the joints.

    `plant`: the offline plant (a robot simulated in one process) whose robot, world and tick MuJoCo gets; a tick has as many substeps as
    with the default motor parameters.  `ticks`: number of timed ticks, rounded down to a multiple of 50.  `seed`: of the velocities.
    """
    alive = np.isin(np.arange(len(plant.robot.motors)), plant.motors.living)
    robot = stiffened(plant.robot, alive, solids=False)
    peer = MujocoPeer(replace(robot, untested=_untested(robot)), plant.model.world.objects, servo=SERVO_GAIN)
    substeps = MotorParameters().substeps(plant.dt)
    peer.model.opt.timestep = plant.dt / substeps
    rng, spent = np.random.default_rng(seed), 0.0
    for _ in range(ticks // COMMAND_PERIOD):
        peer.data.ctrl[:] = rng.uniform(-0.5, 0.5, peer.model.nu)
        start = time.process_time()
        peer.step(COMMAND_PERIOD * substeps)
        spent += time.process_time() - start
    return 1e6 * spent / (ticks // COMMAND_PERIOD * COMMAND_PERIOD)


def _untested(robot: Robot) -> dict[LinkPair, str]:
    """Return the pairs of links no two shapes of which are tested, with the reason."""
    link = [shape.link for shape in robot.shapes]
    tested = {frozenset((link[i], link[j])) for i, j in robot.field_pairs.tolist()}
    links = range(len(robot.links))
    return {frozenset((i, j)): "no pair" for i in links for j in range(i) if frozenset((i, j)) not in tested}
