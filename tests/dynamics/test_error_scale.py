"""Stiff springs at rest: accelerations vanish and their rounding does not, which is no reason to distrust machine code."""

import mpmath as mp
import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, ROUNDOFF_TERMS, acceleration_scale, spring_roundoff
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from tests.support.exact import DIGITS, accelerations

STIFFNESS, DAMPING, LENGTH = 1e6, 3e4, 1.25
AT, ABOVE = 0.75, (0.25, 1.0)  # of a rod; where its spring leads, from the rod's end at the start


def held_chain(n: int = 3) -> gauss.Scene:
    """Chain of rods of 1 m and 1 kg, each of which hangs on a stiff spring with a damper."""
    scene = gauss.Scene("held chain", gravity=(0, -9.81, 0))
    for i in range(n):
        scene.body(f"rod{i}", 1.0, (0, 0.125, 0.125), com=(0.5, 0, 0), position=(i, 0, 0))
        scene.revolute(f"J{i}", f"rod{i - 1}" if i else "ground", f"rod{i}", frame=f"rod{i}")
        ends = (AT, 0, 0), (i + ABOVE[0], ABOVE[1], 0)
        scene.spring(f"stay{i}", f"rod{i}", "ground", *ends, stiffness=STIFFNESS, damping=DAMPING, length=LENGTH)
    return scene


def exact_accelerations(system, state) -> list:
    """Accelerations of the chain in 60 digits, forces of its springs among what is exact."""
    with mp.workdps(DIGITS):
        angles, speeds = ([mp.fsum(map(mp.mpf, part[: i + 1])) for i in range(len(part))] for part in (state.q, state.v))
        joint, moving, joints, effort = mp.mpc(0), mp.mpc(0), [], [mp.mpf(0)] * len(angles)
        for i, (angle, speed) in enumerate(zip(angles, speeds, strict=True)):
            joints.append(joint)
            rod = mp.expj(angle)
            end, velocity = joint + AT * rod, moving + mp.mpc(0, 1) * speed * AT * rod
            gap = mp.mpc(i + ABOVE[0], ABOVE[1]) - end
            line = gap / abs(gap)
            force = (STIFFNESS * (abs(gap) - mp.mpf(LENGTH)) - DAMPING * mp.re(mp.conj(line) * velocity)) * line
            for k, centre in enumerate(joints):
                effort[k] += mp.im(mp.conj(end - centre) * force)
            joint, moving = joint + rod, moving + mp.mpc(0, 1) * speed * rod
        return accelerations(system, state, effort)


def evaluated(system, motion):
    """States of a motion, with their accelerations by machine code."""
    forward = Program(system, Laws(system)).forward()
    for t, q, v in zip(motion.t, motion.q, motion.v, strict=True):
        yield gauss.State(t, q, v), forward(np.concatenate([[t], q, v, np.zeros(system.n_v)]))[: system.n_v]


@pytest.mark.slow
def test_no_method_is_closer_than_rounding_of_positions():
    system, solver = gauss.compile_scene(held_chain()), CertifiedEngine()
    size, errors = spring_roundoff(system), []
    motion = gauss.simulate(system, 1.0, integrator="radau5", rtol=1e-9, atol=1e-9, times=np.linspace(0.0, 1.0, 101))
    for state, compiled in evaluated(system, motion):
        exact = exact_accelerations(system, state)
        pairs = zip((compiled, solver.rates(system, state).acceleration), (exact, exact), strict=True)
        errors.append([max(abs(float(a - b)) for a, b in zip(*pair, strict=True)) for pair in pairs])
    worst = np.max(errors, axis=0)
    assert (worst <= ROUNDOFF_TERMS * size).all() and (worst >= size / ROUNDOFF_TERMS).all()  # of both, alike


@pytest.mark.slow
@pytest.mark.parametrize("make", [held_chain, lambda: gauss.load("flyball_governor")], ids=["held chain", "governor"])
def test_stiff_scenes_that_come_to_rest_stay_compiled(make):
    system = gauss.compile_scene(make())
    motion = gauss.simulate(system, 1.0, integrator="radau5", rtol=1e-10, atol=1e-10, times=[0.5, 1.0])
    explicit = gauss.simulate(system, 1.0, integrator="dop853", rtol=1e-12, atol=1e-12, times=[0.5, 1.0])
    assert motion.stats.plan.driver == "compiled loop" and motion.stats.handed_over is None
    assert motion.stats.worst_error <= ACCELERATION_TOLERANCE
    assert np.abs(motion.q - explicit.q).max() <= 1e-10 and np.abs(motion.v - explicit.v).max() <= 1e-9


@pytest.mark.slow
def test_errors_beyond_rounding_are_seen():
    system = gauss.compile_scene(held_chain())
    program = Program(system, Laws(system))
    check = Kernel(write(program.check, program.layout.size, name="check"), batch=False)
    motion = gauss.simulate(system, 1.0, integrator="radau5", rtol=1e-10, atol=1e-10)
    state, found = list(evaluated(system, motion))[-1]

    def error(off):
        return check(np.concatenate([[state.t], state.q, state.v, np.zeros(3), found + off, np.zeros(3)]))[0]

    assert error(0.0) <= ACCELERATION_TOLERANCE
    assert error(2.0 * ACCELERATION_TOLERANCE * acceleration_scale(system)) > ACCELERATION_TOLERANCE


def test_no_springs_no_rounding():
    system = gauss.compile_scene(gauss.load("n_pendulum", n=3))
    assert spring_roundoff(system) == 0.0
    assert acceleration_scale(system) == pytest.approx(1e-3 * 9.81 / system.scale.length)
