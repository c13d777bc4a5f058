"""Cases of motion: the branch that is kept, energy, momentum, closed forms."""

import numpy as np

from gauss.analysis import energy
from gauss.bench.atlas.acting import ACTS
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.methods import Method
from gauss.dynamics import compile_scene
from gauss.io import load
from gauss.scene import Scene
from gauss.servo import Motor, Servo, ServoRelation
from gauss.servo import simulate as held
from gauss.simulation import Trajectory, simulate
from gauss.system import State, System

ROD = (0.0, 1 / 12, 1 / 12)  # inertia of a uniform rod of 1 kg and 1 m along x


def drift_of_energy(trajectory: Trajectory) -> float:
    """Largest error of the energy balance over the largest energy."""
    found = energy(trajectory)
    return float(np.abs(found.balance).max() / max(found.scale, 1e-300))


def before_flat(windows: int) -> tuple[System, State]:
    """Ladder 0.05 rad before the flat configuration, moving towards it at 2 rad/s."""
    system = compile_scene(load("n_four_bar", n=windows))
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    return system, system.state(-(np.pi / 2 - 0.05) * signs, -2.0 * signs)


def _through_flat(windows: int):
    """Cranks stay parallel through the flat configuration, and the energy stays."""

    def figure(method: Method, _) -> float:
        system, state = before_flat(windows)
        trajectory = method.motion(system, 0.06, 1e-3, state)
        cranks = [trajectory.coordinate(f"A{i}") for i in range(windows + 1)]
        apart = max(float(np.abs(crank - cranks[0]).max()) for crank in cranks)
        return max(apart, drift_of_energy(trajectory))

    return figure


def _parallelogram(method: Method, _) -> float:
    """The coupler keeps its direction through the change point."""
    system = compile_scene(load("parallelogram"))
    state = system.initial_state([0.0] * 4, [0.0] * 4)
    turn = -(np.pi / 2 - 0.05)
    signs = np.array([-1.0 if name == "B1" else 1.0 for name in system.coordinates])
    state = system.state(turn * signs, -2.0 * signs)
    trajectory = method.motion(system, 0.06, 1e-3, state)
    leaning = np.abs(trajectory.coordinate("A1") + trajectory.coordinate("B1")).max()
    return max(float(leaning), drift_of_energy(trajectory))


def equal_slider_crank() -> System:
    """Slider-crank whose crank and coupler are equally long: at a crank angle of 90° the slider is above the pivot."""
    scene = Scene("slider-crank with equal links", gravity=(0, -9.81, 0))
    scene.body("crank", 1.0, ROD, com=(0.5, 0, 0))
    scene.body("coupler", 1.0, ROD, com=(0.5, 0, 0), position=(1, 0, 0))
    scene.body("slider", 1.0, (0.1, 0.1, 0.1), position=(2, 0, 0))
    scene.revolute("A", "ground", "crank")
    scene.revolute("B", "crank", "coupler", at=(1, 0, 0))
    scene.revolute("C", "coupler", "slider", at=(2, 0, 0))
    scene.prismatic("guide", "ground", "slider", at=(2, 0, 0), axis=(1, 0, 0))
    return compile_scene(scene)


def at_equal_slider_crank() -> tuple[System, State]:
    """Slider-crank with equal links 0.05 rad before its singular point, moving towards it at 2 rad/s."""
    system, angle, rate = equal_slider_crank(), np.pi / 2 - 0.05, 2.0
    shares = {"A": 1.0, "B": -2.0, "C": 1.0}
    q = [shares[n] * angle if n in shares else 2 * np.cos(angle) - 2 for n in system.coordinates]
    v = [shares[n] * rate if n in shares else -2 * np.sin(angle) * rate for n in system.coordinates]
    return system, system.state(q, v)


def _slider_crank(method: Method, _) -> float:
    """The slider goes through, x = 2 cos θ; the other branch would leave it at the pivot."""
    system, state = at_equal_slider_crank()
    trajectory = method.motion(system, 0.06, 1e-3, state)
    apart = np.abs(trajectory.coordinate("guide") + 2 - 2 * np.cos(trajectory.coordinate("A"))).max()
    return max(float(apart), drift_of_energy(trajectory))


def _stiff_spring(method: Method, _) -> float:
    """Oscillator of 1 kg on 1e9 N/m: a thousandth of a second is five periods; closed form."""
    scene, stiffness = Scene("stiff spring", gravity=(0, 0, 0)), 1e9
    scene.body("mass", 1.0, (1, 1, 1))
    scene.prismatic("rail", "ground", "mass", axis=(1, 0, 0))
    scene.joint_spring("spring", "rail", stiffness=stiffness)
    scene.start("rail", position=1e-3)
    trajectory = method.motion(compile_scene(scene), 1e-3, 1e-6)
    exact = 1e-3 * np.cos(np.sqrt(stiffness) * trajectory.t)
    return float(np.abs(trajectory.coordinate("rail") - exact).max() / 1e-3)


def _fast_spin(method: Method, _) -> float:
    """Free body at 1e4 rad/s about no principal axis, three turns: angular momentum in space."""
    scene, moments = Scene("spinning body", gravity=(0, 0, 0)), np.array([1.0, 2.0, 2.5])
    scene.body("body", 1.0, tuple(moments))
    scene.free("float", "ground", "body")
    system = compile_scene(scene)
    v = np.zeros(6)
    v[3:] = 1e4 * np.array([1.0, 0.2, 0.1])
    trajectory = method.motion(system, 2e-3, 1e-5, system.state(v=v))
    motion = trajectory.body("body")
    in_body = np.einsum("kji,kj->ki", motion.rotation, motion.angular_velocity)
    momentum = np.einsum("kij,kj->ki", motion.rotation, moments * in_body)
    return float(np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0]))


def _very_long(method: Method, _) -> float:
    """Double pendulum, a million steps of a millisecond: energy."""
    system = compile_scene(load("double_pendulum"))
    times = np.linspace(0.0, 1e3, 101)
    return drift_of_energy(method.motion(system, 1e3, 1e-3, times=times))


def _tiny_step(method: Method, _) -> float:
    """A hundred steps of a nanosecond: the state follows its Taylor polynomial."""
    system = compile_scene(load("four_bar"))
    start, span = system.initial_state(), 1e-7
    found = method.motion(system, span, 1e-9, times=[span])
    expected = start.v + span * system.accelerations(start)
    return float(np.abs(found.v[-1] - expected).max() / np.abs(expected).max())


def _grazing(method: Method, _) -> float:
    """Pendulum with a stop at its turning point: contact without impact, and the energy stays."""
    scene = Scene("grazing", gravity=(0, -9.81, 0))
    scene.body("rod", 1.0, ROD, com=(0.5, 0, 0))
    scene.revolute("pin", "ground", "rod")
    scene.start("pin", position=-0.4)
    scene.stop("pin", lowest=-np.pi + 0.4)
    return drift_of_energy(method.motion(compile_scene(scene), 1.5, 1e-3))


def _painleve(method: Method, _) -> float:
    """Painlevé's rod: with friction 2 rigid bodies have no accelerations; time stepping is the integrator that takes it."""
    simulate(load("painleve_rod"), 0.02, integrator="time_stepping", step=1e-3, backend=method.backend, progress=False)
    return np.inf


def _lost_hold(method: Method, _) -> float:
    """Inverted pendulum driven to 90°, where the force on the cart points along the rod."""
    scene = load("cart_pole")
    tilt = ServoRelation("lean", lambda t, motion: motion.coordinate("pin") - 0.5 - 2.0 * t, unit="rad")
    scene.start("pin", position=0.5, rate=2.0)
    held(Servo(compile_scene(scene), (tilt,), (Motor("motor", "rail"),)), 1.5, progress=False)
    return np.inf


BRANCH = "leaving the branch [rad, m], and error of the energy balance"
MOTIONS = (
    *ACTS,
    FailureCase("parallelogram", f"{BRANCH}; through the change point", _parallelogram),
    FailureCase("slider-crank, equal links", f"{BRANCH}; through the singular point", _slider_crank),
    FailureCase("ladder of 2 through flat", BRANCH, _through_flat(2)),
    FailureCase("ladder of 8 through flat", BRANCH, _through_flat(8)),
    FailureCase("stiff spring", "error of the closed form; five periods at 1e9 N/m", _stiff_spring, passes=1e-5, fails=1e-1),
    FailureCase("spin at 1e4 rad/s", "change of the angular momentum in space", _fast_spin, passes=1e-6, fails=1e-2),
    FailureCase("a million steps", "error of the energy balance in 1000 s", _very_long, passes=1e-6, fails=1e-1),
    FailureCase("steps of 1e-9 s", "error of the rates beside their Taylor polynomial", _tiny_step, passes=1e-11),
    FailureCase("grazing a stop", "error of the energy balance", _grazing, passes=1e-6, fails=1e-2),
    FailureCase("Painlevé's rod", "said: there are no accelerations", _painleve, solvable=False),
    FailureCase("servo losing its hold", "said: the force loses its hold", _lost_hold, solvable=False),
)
