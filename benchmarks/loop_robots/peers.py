"""Forward dynamics of the same robots by Pinocchio and MuJoCo, as calls of one state.

Pinocchio: ``aba`` for trees, ``constraintDynamics`` and ``lcaba`` for loops (hinges that close planar loops as points, as
their other rows are redundant), each with the proximal parameter that agrees best; for couplings, of which neither knows,
``crba`` and ``nonLinearEffects`` reduced by the constant null space of the couplings, and LAPACK. MuJoCo: ``mj_forward`` of
the file that gauss writes, with constraints as stiff as it takes.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
import scipy.linalg

from benchmarks.loop_robots.robots import Instant
from gauss.analysis.crosscheck.pinocchio_ import Twin, twin
from gauss.dynamics.kinematics import kinematics
from gauss.errors import GaussError
from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.scene import LinearCoupling
from gauss.system import System

ABA, DYNAMICS, LCABA, REDUCED, MUJOCO = "pin.aba", "pin.constraintDynamics", "pin.lcaba", "pin.crba + LAPACK", "mj_forward"
PEERS = ABA, DYNAMICS, LCABA, REDUCED, MUJOCO
ACCURACY, MOST_ITERATIONS = 1e-14, 50
PROXIMAL = (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2)
CONTACTS = {
    "fixed": pin.ContactType.CONTACT_6D,
    "ball": pin.ContactType.CONTACT_3D,
    "revolute": pin.ContactType.CONTACT_3D,
}
STIFF = {"solref": (1e-6, 1.0), "solimp": (0.9999, 0.9999, 0.001, 0.5, 2.0)}  # s; the time constant is that of the step


@dataclass(frozen=True)
class Peer:
    """A competitor in one state."""

    run: Callable[[], object]  # computes the accelerations
    error: float  # of these, as :meth:`Instant.error`


def peers(system: System, instant: Instant) -> dict[str, Peer]:
    """Competitors that know what the robot has, by name."""
    found = dict(_by_pinocchio(system, instant))
    with suppress(GaussError):  # no counterpart in MuJoCo
        found[MUJOCO] = _by_mujoco(system, instant)
    return found


def _by_pinocchio(system: System, instant: Instant):
    pair = twin(system)
    model, at = pair.model, pair.configuration(instant.state)
    tau = at.T @ instant.load

    def error(acceleration) -> float:
        return instant.error(np.linalg.lstsq(at.T, acceleration - at.bias, rcond=None)[0])

    if system.scene.couplings or system.scene.relations:
        run = _reduced(system, pair, at, tau)
        yield REDUCED, Peer(run, error(run()))
    elif system.is_tree:
        data = model.createData()
        run = lambda: pin.aba(model, data, at.q, at.v, tau)  # noqa: E731
        yield ABA, Peer(run, error(run()))
    else:
        for name, prepare, solve in (
            (DYNAMICS, pin.initConstraintDynamics, pin.constraintDynamics),
            (
                LCABA,
                lambda model, data, constraints, _: pin.computeJointMinimalOrdering(model, data, constraints),
                pin.lcaba,
            ),
        ):
            runs = [_proximal(system, pair, at, tau, prepare, solve, mu) for mu in PROXIMAL]
            yield name, min((Peer(run, error(run())) for run in runs), key=lambda peer: peer.error)


def _proximal(system: System, pair: Twin, at, tau, prepare, solve, mu: float) -> Callable:
    """Call of a solver for loops."""
    model, data = pair.model, pair.model.createData()
    constraints, states = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for joint in system.joints:
        if system.scene.joints[joint.name].child_frame is None:
            continue
        one, other = pair.parent_side(joint), pair.child_side(joint)
        sides = one.joint, one.central, other.joint, other.central
        kind = CONTACTS[joint.pair.kind]
        constraints.append(pin.RigidConstraintModel(kind, model, *sides, pin.ReferenceFrame.LOCAL))
    for constraint in constraints:
        states.append(constraint.createData())
    prepare(model, data, constraints, states)
    settings = pin.ProximalSettings(ACCURACY, mu, MOST_ITERATIONS)
    return lambda: solve(model, data, at.q, at.v, tau, constraints, states, settings)


def _reduced(system: System, pair: Twin, at, tau) -> Callable:
    """Call of M and h, reduced by the couplings."""
    model, data = pair.model, pair.model.createData()
    rows = [{coupling.driven: 1.0, coupling.driver: -coupling.ratio} for coupling in system.scene.couplings.values()]
    rows += [
        dict(zip(one.coupled, one.coefficients, strict=True))
        for one in system.scene.relations.values()
        if isinstance(one, LinearCoupling)
    ]
    K = np.zeros((len(rows), system.n_v))
    for row, terms in zip(K, rows, strict=True):
        for joint, coefficient in terms.items():
            row[system.column(joint)] = coefficient
    N = at.T @ scipy.linalg.null_space(K)

    def run():
        M = pin.crba(model, data, at.q)
        right = N.T @ (tau - pin.nonLinearEffects(model, data, at.q, at.v) - M @ at.bias)
        return N @ np.linalg.solve(N.T @ M @ N, right) + at.bias

    return run


def _by_mujoco(system: System, instant: Instant) -> Peer:
    model = mujoco.MjModel.from_xml_string(to_mjcf(system.scene))
    data = mujoco.MjData(model)
    model.opt.timestep = STIFF["solref"][0]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_REFSAFE
    model.eq_solref[:], model.eq_solimp[:] = STIFF["solref"], STIFF["solimp"]
    limbs = [limb(system, *edge) for edge in spanning_tree(system.scene)[0]]
    data.qpos, data.qvel = mujoco_state(system, limbs, kinematics(system, instant.state))
    for one in limbs:
        for step in one.steps:
            if step.kind in ("hinge", "slide"):
                data.joint(step.name).qfrc_applied = instant.load[system.column(one.joint.name)]

    def run():
        mujoco.mj_forward(model, data)
        return data.qacc

    run()
    found = np.zeros(system.n_v)
    for one in limbs:
        place = system.joint(one.joint.name).v
        for step in one.steps:
            if step.kind == "free":
                found[place] = _of_free(data, step.name)
            else:
                found[place] = data.joint(step.name).qacc
    return Peer(run, instant.error(found))


def _of_free(data, name: str) -> np.ndarray:
    """Accelerations of a free joint: linear along the world, angular in the axes of the body; so MuJoCo has them, too."""
    return data.joint(name).qacc
