"""Balance of forces body by body, and the check of compiled accelerations that is made of it."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics.error_scale import acceleration_scale, centrifugal_scale
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.traced_system import Program
from gauss.system import random_state
from tests.support import mechanisms
from tests.support.reducible import SCENES

KINDS = ("revolute", "prismatic", "cylindrical", "universal", "ball", "planar", "screw", "free", "fixed")
ROUNDING = 1e-11  # of the largest force or acceleration, over a dozen bodies
SHARE = 1e-4  # by which a small error of accelerations may be misjudged


def _reversed(kind: str) -> gauss.Scene:
    """The tree goes from child to parent across the second joint."""
    scene = mechanisms.two_bodies(kind)
    joint = scene.joints.pop("B")
    scene.add(gauss.Joint(**(vars(joint) | {"parent": "b", "child": "a"})))
    return scene


TREES = {kind: lambda kind=kind: mechanisms.two_bodies(kind) for kind in KINDS}
TREES |= {f"{kind} from the child": lambda kind=kind: _reversed(kind) for kind in KINDS}
TREES |= {name: SCENES[name] for name in ("welded", "panda", "random tree", "heavy_top", "cart_pole")}
TIED = {name: SCENES[name] for name in ("gear_pair", "planetary_gears", "rolling_disk", "belts across", "locked")}


@pytest.mark.parametrize("name", TREES)
def test_forces_that_are_out_of_balance_are_what_the_accelerations_take(name):
    """Taken away from the loads they leave exactly these accelerations to the certified recursion."""
    system = gauss.compile_scene(TREES[name]())
    rng = np.random.default_rng(2)
    state, rates = random_state(system, rng), rng.normal(size=system.n_v)
    tied = {joint for c in system.scene.couplings.values() for joint in (c.driver, c.driven)}
    rates[[k for joint in tied for k in range(*system.joint(joint).v.indices(system.n_v))]] = 0.0
    motion = kinematics(system, state)
    left = inverse_dynamics_residual(motion, Applied(motion), rates)
    found = gauss.solve(gauss.assemble(system, state, -left), "recursion").qdd
    assert np.abs(found - rates).max(initial=0.0) <= ROUNDING * max(1.0, np.abs(left).max(initial=0.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES | TIED)
def test_the_check_measures_the_error_of_accelerations(name):
    """Right ones pass; ones that are wrong by the effect of a small force have that force as residual."""
    system = gauss.compile_scene((TREES | TIED)[name]())
    if not system.subsystems:
        return
    program, n = Program(system, Laws(system)), system.n_v
    forward, check = program.forward(), Kernel(write(program.check, program.layout.size), batch=False)
    rng, start = np.random.default_rng(3), system.initial_state()
    state = system.initial_state(start.q, random_state(system, rng).v)
    moved = np.concatenate([[0.0], state.q, state.v])
    right, other = (forward(np.concatenate([moved, force]))[:n] for force in (np.zeros(n), rng.normal(size=n)))
    wrong = 1e-6 * (other - right)
    units = system.scale.coordinates
    size = max(np.abs(right / units).max(), acceleration_scale(system) + centrifugal_scale(system, state.v))
    point = np.concatenate([moved, np.zeros(3), right, np.zeros(3)])
    assert check(point)[0] <= ROUNDING
    point[-n - 3 : -3] += wrong
    assert check(point)[0] == pytest.approx(np.abs(wrong / units).max() / size, rel=SHARE)


@pytest.mark.slow
def test_the_check_does_not_pass_over_what_is_no_number():
    system = gauss.compile_scene(gauss.load("spatial_tree"))
    program = Program(system, Laws(system))
    check = Kernel(write(program.check, program.layout.size), batch=False)
    point = np.zeros(program.layout.size)
    point[-4] = np.nan
    assert not check(point)[0] <= 1.0
