"""Regressor, base parameters, identification: Pinocchio, closed forms, true parameters, consistency, refusals."""

import html
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.analysis.consistent_inertias import pseudo_inertia
from gauss.analysis.regressor import standard_parameters
from gauss.errors import ArgumentError, FileError, GaussError, StateError
from gauss.system import random_state

AGREEMENT = 1e-12  # of sums in another order
OF_RANK = 1e-8  # of combinations, relative, after QR of samples
FROM_EXACT = 1e-7  # of forces of identified scenes, relative; Clarabel's tolerance is 1e-8
NEGATIVE = 1e-9  # eigenvalue of pseudo-inertias that is round-off, relative to the trace


def relative(found, expected) -> float:
    return np.abs(np.asarray(found) - expected).max() / max(np.abs(expected).max(), 1e-300)


def solid(scene: gauss.Scene) -> gauss.Scene:
    """Scene with full inertia matrices and centres of mass off the axes."""
    bodies = {}
    for k, body in enumerate(scene.bodies.values()):
        J = max(np.max(np.abs(body.inertia)), 0.1) * np.array([1.0, 1.2, 1.4, 0.1, -0.05, 0.02 * (k + 1)])
        com = np.array(body.com) + 0.05 * np.array([1.0, -0.5, 0.7])
        bodies[body.name] = replace(body, mass=body.mass + 0.1, inertia=tuple(J), com=tuple(com), inertia_axes=(0, 0, 0))
    return replace(scene, bodies=bodies)


def other_bodies(scene: gauss.Scene, factor: float) -> gauss.Scene:
    """Scene with other masses and inertias."""
    bodies = {
        name: replace(body, mass=factor * body.mass, inertia=tuple(np.multiply(body.inertia, factor**2)))
        for name, body in scene.bodies.items()
    }
    return replace(scene, bodies=bodies)


def tree() -> gauss.Scene:
    return solid(gauss.load("random_tree", n=3, seed=3, kinds=("revolute", "prismatic")))


def samples(system: gauss.System, n: int = 60, seed: int = 0):
    """States and accelerations (n, …) of a system; with loops, of independent coordinates along motions."""
    rng = np.random.default_rng(seed)
    if not system.has_closures:
        states = [random_state(system, rng) for _ in range(n)]
        return np.array([s.q for s in states]), np.array([s.v for s in states]), 3.0 * rng.standard_normal((n, system.n_v))
    motion = gauss.simulate(system, 1.0, times=np.linspace(0.0, 1.0, n))
    factors = rng.uniform(-1.0, 1.0, (n, 1))
    v, loads = factors * motion.v, 20.0 * rng.standard_normal((n, 1)) * np.eye(system.n_v)[0]
    return motion.q, v, system.forward_dynamics(motion.q, v, loads)


def driven(system: gauss.System, q, v, acceleration) -> dict:
    """Forces that drive a system, of the first coordinate alone where it has loops of one freedom."""
    tau = system.bias_forces(q, v) + np.einsum("nij,nj->ni", system.mass_matrix(q), acceleration)
    if system.has_closures:
        N = system.null_space(q, independent=[system.coordinates[0]])
        tau = np.einsum("nij,ni->nj", N, tau)
    return {name: one for name, one in zip(system.coordinates, tau.T, strict=False)}


@pytest.mark.peer
@pytest.mark.parametrize("kinds", [("revolute",), ("revolute", "prismatic", "ball")])
def test_columns_are_those_of_pinocchio(kinds):
    pin = pytest.importorskip("pinocchio")
    from gauss.analysis.crosscheck.pinocchio_ import twin

    system = gauss.compile_scene(solid(gauss.load("random_tree", n=4, seed=3, kinds=kinds)))
    state, a = random_state(system, np.random.default_rng(5)), np.linspace(-1.0, 1.0, system.n_v)
    pair = twin(system)
    at, model = pair.configuration(state), pair.model
    theirs = pin.computeJointTorqueRegressor(model, model.createData(), at.q, at.v, at.T @ a + at.bias)
    found = gauss.regressor(system, state.q, state.v, a)
    for k, body in enumerate(system.scene.bodies.values()):
        placement, (_, R) = pair.placements[k], body.principal()
        T = (placement.central * pin.SE3(R, np.array(body.com)).inverse()).homogeneous
        units = [T @ pseudo_inertia(unit) @ T.T for unit in np.eye(10)]
        X = np.array([dynamic_parameters(P) for P in units]).T
        columns = at.T.T @ theirs[:, 10 * placement.joint - 10 : 10 * placement.joint] @ X
        assert relative(found.matrix[:, 10 * k : 10 * k + 10], columns) <= AGREEMENT


def dynamic_parameters(P) -> np.ndarray:
    """Parameters of a pseudo-inertia in the order of Pinocchio."""
    moments = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    return np.array([P[3, 3], *P[:3, 3], *(moments[i, k] for i, k in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tree", "four_bar", "slider_crank"])
def test_the_regressor_gives_the_forces(name):
    """Y π of consistent accelerations are the loads that cause them, projected on the independent coordinates."""
    system = gauss.compile_scene(tree() if name == "tree" else gauss.load(name))
    q, v, _ = samples(system, 9)
    load = np.random.default_rng(1).standard_normal((9, system.n_v))
    a = system.forward_dynamics(q, v, load)
    found = gauss.regressor(system, q, v, a, friction=[system.coordinates[0]])
    expected = load
    if system.has_closures:
        expected = np.einsum("nij,ni->nj", system.null_space(q, independent=found.rows), load)
    assert relative(found.matrix @ found.parameters, expected) <= 1e3 * AGREEMENT
    assert len(found.names) == found.matrix.shape[2] == 10 * len(system.scene.bodies) + 2
    one = gauss.regressor(system, q[4], v[4], a[4], friction=[system.coordinates[0]])
    assert relative(one.matrix, found.matrix[4]) <= AGREEMENT


def test_a_pendulum_in_closed_form():
    """Torque Izz q̈ + g (mx cos q − my sin q) + d q̇ + f sign q̇ of a rod that starts along x, gravity along −y."""
    scene = gauss.Scene("pendulum", gravity=(0.0, -9.81, 0.0))
    scene.revolute("A", "ground", scene.body("rod", 2.0, (0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0)), axis=(0, 0, 1))
    found = gauss.regressor(scene, [0.3], [-2.0], [5.0], friction=["A"])
    columns = dict(zip(found.names, found.matrix[0], strict=True))
    expected = {"Izz:rod": 5.0, "mx:rod": 9.81 * np.cos(0.3), "my:rod": -9.81 * np.sin(0.3)}
    expected |= {"viscous:A": -2.0, "coulomb:A": -1.0}
    for name, value in columns.items():
        assert abs(value - expected.get(name, 0.0)) <= AGREEMENT * 10.0
    base = gauss.base_parameters(scene, friction=["A"])
    assert set(base.identifiable) == set(expected) and not base.combined
    assert set(base.unidentifiable) == set(found.names) - set(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tree", "double_pendulum", "four_bar"])
def test_forces_depend_on_base_parameters_alone(name):
    system = gauss.compile_scene(tree() if name == "tree" else gauss.load(name))
    base = gauss.base_parameters(system)
    Y = gauss.regressor(system, *samples(system, 5, seed=7)).matrix * base.units
    units = base.units[list(base.base)]
    assert relative((Y[:, :, list(base.base)] / units) @ base.combinations * base.units, Y) <= OF_RANK
    names = [*base.identifiable, *base.combined, *base.unidentifiable]
    assert sorted(names) == sorted(base.names) and len(base.labels) == len(base) == np.linalg.matrix_rank(base.combinations)


def test_a_double_pendulum_has_six_base_parameters():
    """mx₁ + m₂ l, my₁, Izz₁ + m₂ l², mx₂, my₂, Izz₂ (Khalil and Dombre 2002, sec. 9.4)."""
    scene = gauss.load("double_pendulum")
    base, length = gauss.base_parameters(scene), 1.0
    upper, lower = scene.bodies
    expected = np.zeros((6, 20))
    for row, terms in enumerate(
        ({f"mx:{upper}": 1, f"mass:{lower}": length}, {f"my:{upper}": 1}, {f"Izz:{upper}": 1, f"mass:{lower}": length**2})
    ):
        for name, factor in terms.items():
            expected[row, base.names.index(name)] = factor
    for row, name in enumerate((f"mx:{lower}", f"my:{lower}", f"Izz:{lower}"), start=3):
        expected[row, base.names.index(name)] = 1.0
    assert len(base) == 6 and np.linalg.matrix_rank(np.concatenate([base.combinations, expected]), tol=OF_RANK) == 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tree", "double_pendulum", "four_bar", "slider_crank"])
def test_exact_data_give_the_true_dynamics(name):
    """From a scene with other bodies; the identified one moves as the true one."""
    true = tree() if name == "tree" else solid(gauss.load(name))
    system = gauss.compile_scene(true)
    q, v, a = samples(system)
    friction = [system.coordinates[0]]
    forces = driven(system, q, v, a)
    forces[friction[0]] = forces[friction[0]] + 0.3 * v[:, 0] + 0.2 * np.sign(v[:, 0])
    found = gauss.identify(other_bodies(true, 1.4), q, v, a, forces, friction=friction, independent=friction)
    assert found.parameters[f"viscous:{friction[0]}"] == pytest.approx(0.3, rel=FROM_EXACT)
    assert found.parameters[f"coulomb:{friction[0]}"] == pytest.approx(0.2, rel=FROM_EXACT)
    assert found.residual.max() <= FROM_EXACT * np.abs(found.measured).max()
    other = gauss.compile_scene(replace(found.scene, loads=true.loads, set_valued=true.set_valued))
    load = np.linspace(-1.0, 1.0, system.n_v)
    expected = system.forward_dynamics(q[7], v[7], load)
    assert relative(other.forward_dynamics(q[7], v[7], load), expected) <= 10.0 * FROM_EXACT
    (spring,) = set(found.scene.loads) - set(true.loads)
    assert found.scene.loads[spring].damping == pytest.approx(0.3, rel=FROM_EXACT)
    assert str(found) and all(is_physical(body) for body in found.scene.bodies.values())


def is_physical(body: gauss.Body) -> bool:
    P = pseudo_inertia(standard_parameters(body))
    return np.linalg.eigvalsh(P)[0] >= -NEGATIVE * np.trace(P)


@pytest.mark.slow
def test_loads_of_the_scene_are_known():
    scene = tree()
    first, second = list(scene.joints)[:2]
    joint = next(name for name in scene.joints if scene.joints[name].pair.n_v == 1)
    scene.joint_spring("S", joint, stiffness=7.0, damping=0.4, rest=0.2)
    scene.force("F", list(scene.bodies)[-1], force=(1.0, -2.0, 0.5), at=(0.1, 0.0, 0.0))
    system = gauss.compile_scene(scene)
    q, v, a = samples(system)
    found = gauss.identify(other_bodies(scene, 0.7), q, v, a, system.inverse_dynamics(q, v, a))
    wanted = found.base.combinations @ gauss.regressor(system, q[0], v[0], a[0]).parameters
    assert relative(found.base_values, wanted) <= FROM_EXACT
    assert set(found.scene.loads) == {"S", "F"} and first != second


@pytest.mark.slow
def test_confidence_of_noisy_data():
    """(x − x̂)ᵀ C⁻¹ (x − x̂) is χ² of r degrees: within five standard deviations; the noise within 10 %."""
    system = gauss.compile_scene(tree())
    q, v, a = samples(system, 400)
    noise = np.linspace(0.05, 0.2, system.n_v)
    forces = system.inverse_dynamics(q, v, a) + noise * np.random.default_rng(3).standard_normal(v.shape)
    found = gauss.identify(system, q, v, a, forces)
    truth = found.base.combinations @ gauss.regressor(system, q[0], v[0], a[0]).parameters
    error, r = found.base_values - truth, len(found.base)
    assert abs(error @ np.linalg.solve(found.covariance, error) - r) <= 5.0 * np.sqrt(2.0 * r)
    assert np.abs(found.noise / noise - 1.0).max() <= 0.1
    known = gauss.identify(system, q, v, a, forces, noise=2.0 * noise, confidence=0.5)
    assert relative(known.covariance / (2.0 * np.mean(noise)) ** 2, found.covariance / np.mean(noise) ** 2) <= 0.2


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say():
    """Over independent runs Σ eᵀ C⁻¹ e is χ² of all degrees; of 300 runs 94.8 % of the 95 % intervals held."""
    system, runs = gauss.compile_scene(tree()), 20
    q, v, a = samples(system, 400)
    noise, clean = np.linspace(0.05, 0.2, system.n_v), system.inverse_dynamics(q, v, a)
    total, inside, count = 0.0, 0, 0
    for seed in range(runs):
        forces = clean + noise * np.random.default_rng(seed).standard_normal(v.shape)
        found = gauss.identify(system, q, v, a, forces, consistent=False)
        error = found.base_values - found.base.combinations @ gauss.regressor(system, q[0], v[0], a[0]).parameters
        total, count = total + error @ np.linalg.solve(found.covariance, error), count + error.size
        inside += int((np.abs(error) <= found.half_widths).sum())
    assert abs(total - count) <= 5.0 * np.sqrt(2.0 * count)
    assert abs(inside - 0.95 * count) <= 5.0 * np.sqrt(0.95 * 0.05 * count)


def test_inertias_of_few_noisy_samples_are_those_of_bodies():
    system = gauss.compile_scene(tree())
    q, v, a = samples(system, 14)
    forces = system.inverse_dynamics(q, v, a) + 3.0 * np.random.default_rng(3).standard_normal(v.shape)
    free = gauss.identify(system, q, v, a, forces, consistent=False)
    with pytest.raises(GaussError):
        gauss.compile_scene(free.scene)
    found = gauss.identify(system, q, v, a, forces)
    assert all(is_physical(body) for body in found.scene.bodies.values())
    assert relative(found.base_values, free.base_values) <= AGREEMENT  # intervals are those of least squares
    assert np.all(found.residual >= 0.0) and found.scene.bodies.keys() == system.scene.bodies.keys()


@pytest.mark.slow
def test_measured_loops_are_projected_onto_the_constraints():
    system = gauss.compile_scene(solid(gauss.load("four_bar")))
    q, v, a = samples(system, 40)
    forces = driven(system, q, v, a)
    rough = q + 1e-4 * np.random.default_rng(2).standard_normal(q.shape)
    exact = gauss.identify(system, q, v, a, forces, independent=["A"])
    found = gauss.identify(system, rough, v, a, forces, independent=["A"])
    assert found.residual.max() <= 1e-2 * np.abs(found.measured).max() and len(found.base) == len(exact.base)
    with pytest.raises(StateError, match="sample 3"):
        far = np.where(np.arange(40)[:, None] == 3, q + 1.0, q)
        gauss.identify(system, far, v, a, forces, independent=["A"])


def test_a_motion_that_does_not_excite_is_refused_by_name():
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = samples(system)
    with pytest.raises(StateError, match="does not excite 2 of 6 .*Izz:lower"):  # at rest: weights alone
        gauss.identify(system, q, 0.0 * v, 0.0 * a, system.gravity_forces(q))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change, error, words",
    [
        ({"q": np.nan}, StateError, "q: sample 2"),
        ({"forces": np.inf}, StateError, "forces: sample 2"),
        ({"n": 2}, StateError, "too few"),
        ({"n": 0}, StateError, "shape"),
        ({"friction": ["C"]}, StateError, "C"),
        ({"friction": ["A", "A"]}, StateError, "different"),
        ({"noise": -1.0}, StateError, "noise"),
        ({"confidence": 95}, ArgumentError, "confidence"),
        ({"frictoin": ["A"]}, ArgumentError, "friction"),
    ],
)
def test_bad_input_is_refused(change, error, words):
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = samples(system, 20)
    forces, n = system.inverse_dynamics(q, v, a), change.get("n", 20)
    for name, array in (("q", q), ("forces", forces)):
        if name in change:
            array[2, 1] = change[name]
    options = {key: value for key, value in change.items() if key not in ("q", "forces", "n")}
    with pytest.raises(error, match=words):
        gauss.identify(system, q[:n], v[:n], a[:n], forces[:n], **options)


def test_scenes_whose_forces_are_unknown_are_refused():
    scene = gauss.load("double_pendulum")
    scene.drive("A", angle=lambda t: t)
    with pytest.raises(StateError, match="drive of A"):
        gauss.base_parameters(scene)
    with pytest.raises(ArgumentError, match="none of them"):
        gauss.base_parameters(gauss.load("double_pendulum"), [[0.0, 0.0]])


@pytest.mark.slow
def test_the_figure_shows_each_coordinate():
    pytest.importorskip("matplotlib")
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = samples(system)
    found = gauss.identify(system, q, v, a, system.inverse_dynamics(q, v, a))
    assert [axes.get_ylabel() for axes in found.plot().axes] == [f"{name} [N m]" for name in system.coordinates]
    with pytest.raises(FileError, match="no_format"):
        found.plot("figure.no_format")


@pytest.mark.slow
def test_a_report_holds_table_and_figures(tmp_path):
    pytest.importorskip("matplotlib")
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = samples(system)
    found = gauss.identify(system, q, v, a, system.inverse_dynamics(q, v, a))
    text = found.report(tmp_path / "found.html").read_text(encoding="utf-8")
    assert html.escape(str(found)) in text and text.count("<svg") == text.count("</svg>") == 2
    assert "<?xml" not in text and "src=" not in text
    for path in (tmp_path / "found.pdf", tmp_path / "nowhere" / "found.html", 3):
        with pytest.raises(ArgumentError, match="report"):
            found.report(path)
