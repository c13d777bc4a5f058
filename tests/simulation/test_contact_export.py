"""Contact problems of single steps: solvers of several kinds agree, files of FCLIB hold them, the step itself takes them."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import bin_of_balls, dominoes, stack
from gauss.dynamics.contact.convex_relaxation import on_cones
from gauss.dynamics.contact.friction_problem import FrictionProblem
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.errors import ArgumentError, BackendError, FileError, StateError
from gauss.io import load_fclib, save_fclib

STEP = 1e-3  # s
MET = 1e-9  # m/s: residual of the laws of our solver
SAME_RATES = 1e-6  # m/s: rates of interior-point and operator-splitting solvers
SAME_FORCE = 1e-9  # relative
SCENES = {  # scene, time at which it is looked at [s]
    "stack": (lambda: stack(3), 0.0),
    "dominoes": (lambda: dominoes(3), 0.15),
    "smooth box": (lambda: gauss.load("box_on_plane_4"), 0.0),
    "sliding block": (lambda: gauss.load("block_on_incline"), 0.1),
    "balls": (lambda: bin_of_balls(10), 0.4),
}


@pytest.fixture(scope="module", params=SCENES)
def instant(request):
    make, t = SCENES[request.param]
    system = gauss.compile_scene(make())
    if not t:
        return system, system.initial_state()
    motion = gauss.simulate(system, t, integrator="time_stepping", step=STEP, times=[t], progress=False)
    return system, motion.state(len(motion) - 1)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["clarabel", "scs"])
def test_solvers_of_cone_programmes_find_the_rates_of_ours(instant, solver):
    """Impulses need not be unique, rates after the step are those of one W r."""
    problem = gauss.friction_problem(*instant, step=STEP)
    own, other = problem.solve(), problem.solve(solver)
    assert problem.residual(own) <= MET
    assert np.abs(problem.W @ (own - other)).max() <= SAME_RATES


@pytest.mark.slow
def test_the_problem_is_that_of_the_step(instant):
    system, state = instant
    stepper = MechanismStepper(system)
    stepper.python_step(state, STEP)
    step = stepper.python_step(state, STEP)
    problem = gauss.friction_problem(system, state, step=STEP)
    assert step.contacts.gap.size == problem.mu.size
    size = np.abs(problem.q).max()
    own = problem.W @ (STEP * step.force.ravel())
    assert own == pytest.approx(problem.W @ problem.solve(), abs=SAME_FORCE * size)
    assert np.linalg.eigvalsh(problem.W)[0] >= -SAME_FORCE * np.abs(problem.W).max()


def test_impulses_by_hand_of_a_block_that_slides():
    """One ball of 2 kg on its floor, pushed along by gravity of 3 m/s² beside 9.81 m/s² down, friction 0.2: it slides."""
    W, q = np.diag([0.5, 0.5, 0.5]), STEP * np.array([-9.81, 3.0, 0.0])
    problem = FrictionProblem(W, q, np.array([0.2]), ("C",))
    expected = 2.0 * STEP * 9.81 * np.array([1.0, -0.2, 0.0])
    for solver in ("gauss", "clarabel", "scs"):
        assert problem.solve(solver) == pytest.approx(expected, abs=1e-9)
    assert problem.residual(expected) <= 1e-15
    assert problem.residual(1.1 * expected) == pytest.approx(0.1 * STEP * 9.81 * np.hypot(1.0, 0.2), rel=0.2)


@pytest.mark.parametrize("mu", [0.0, 0.5, 2.0])
def test_the_projection_on_a_cone_is_nearest(mu):
    rng = np.random.default_rng(3)
    for r in [*rng.standard_normal((50, 3)), np.array([-1.0, 0.0, 0.0])]:
        (height,), (across,) = on_cones(r[:1], r[None, 1:], np.array([mu]))
        near = np.array([height, *across])
        assert near[0] >= 0.0 and np.hypot(*near[1:]) <= mu * near[0] + 1e-12
        others = rng.standard_normal((200, 3))
        others[:, 0] = np.hypot(*others[:, 1:].T) / mu + np.abs(others[:, 0]) if mu else np.abs(others[:, 0])
        others[:, 1:] *= mu > 0.0
        assert np.linalg.norm(r - near) <= np.linalg.norm(r - others, axis=1).min() + 1e-12


def test_files_of_fclib_hold_the_problem_and_its_solution(instant, tmp_path):
    h5py = pytest.importorskip("h5py")
    problem = gauss.friction_problem(*instant, step=STEP)
    r, path = problem.solve(), tmp_path / "problem.hdf5"
    save_fclib(problem, path, r)
    found, solution = load_fclib(path)
    assert np.array_equal(found.W, problem.W) and np.array_equal(found.q, problem.q) and np.array_equal(found.mu, problem.mu)
    assert found.names == problem.names and np.array_equal(solution, r)
    with h5py.File(path) as file:  # types and names of the library's own files
        W = file["fclib_local/W"]
        assert {name: W[name].dtype for name in "pix"} == {"p": np.int32, "i": np.int32, "x": float}
        assert W["nz"][0] == -1 and W["nzmax"][0] == W["x"].size and W["p"].size == W["n"][0] + 1
        assert file["solution/u"][()] == pytest.approx(problem.W @ r + problem.q)


@pytest.mark.parametrize("kind", ["rows", "triplets"])
def test_other_forms_of_matrices_are_read(kind, tmp_path):
    """FCLIB's collection has compressed rows (nz = −2) and triplets (nz ≥ 0) as well; an unsymmetric W tells them apart."""
    h5py = pytest.importorskip("h5py")
    W = np.array([[2.0, 0.5, 0.0], [0.0, 3.0, 0.0], [0.25, 0.0, 4.0]])
    i, j = np.nonzero(W)
    p, columns = (np.cumsum([0, *(W != 0.0).sum(axis=1)]), j) if kind == "rows" else (j, i)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"], local["vectors/q"], local["vectors/mu"] = [3], np.arange(3.0), [0.3]
        for name, value in (("m", 3), ("n", 3), ("nz", -2 if kind == "rows" else i.size), ("nzmax", i.size)):
            local[f"W/{name}"] = [value]
        local["W/p"], local["W/i"], local["W/x"] = p, columns, W[i, j]
    problem, r = load_fclib(tmp_path / "a.hdf5")
    assert np.array_equal(problem.W, W) and r is None and problem.names == ("contact 0",)


def _no_problem(tmp_path):
    (tmp_path / "a.hdf5").write_text("no")
    return load_fclib(tmp_path / "a.hdf5")


def _empty(tmp_path):
    pytest.importorskip("h5py").File(tmp_path / "b.hdf5", "w").close()
    return load_fclib(tmp_path / "b.hdf5")


ONE = FrictionProblem(np.eye(3), np.array([-1.0, 0.0, 0.0]), np.array([0.5]), ("C",))
REFUSED = {
    "an unknown solver": (BackendError, "clarabel", lambda path: ONE.solve("clarabell")),
    "no contact near": (
        StateError,
        "near",
        lambda path: gauss.friction_problem(gauss.compile_scene(bin_of_balls(1)), step=1e-6),
    ),
    "joint friction": (StateError, "friction", lambda path: gauss.friction_problem(_with_joint_friction(), step=STEP)),
    "a missing file": (FileError, "no file", lambda path: load_fclib(path / "none.hdf5")),
    "text": (FileError, "HDF5", _no_problem),
    "another file": (FileError, "fclib_local", _empty),
    "impulses of another problem": (ArgumentError, "shape", lambda path: save_fclib(ONE, path / "c.hdf5", np.zeros(6))),
}


def _with_joint_friction() -> gauss.System:
    scene = stack(1)
    scene.body("slider", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("rail", "ground", "slider", axis=(1.0, 0.0, 0.0))
    scene.joint_friction("rail", 1.0)
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused(what, tmp_path):
    kind, text, call = REFUSED[what]
    with pytest.raises(kind, match=text):
        call(tmp_path)


def test_names_and_numbers_of_files_are_kept_or_refused(tmp_path):
    W = np.diag([2.0, 1.0, 1.0, 3.0, 1.0, 1.0])
    problem = FrictionProblem(W, np.arange(6.0), np.array([0.3, 0.0]), ("Kugel – Wand", "玉"))
    path = tmp_path / "problem.hdf5"
    save_fclib(problem, path, problem.q)
    found, r = load_fclib(path)
    assert found.names == problem.names and np.array_equal(r, problem.q)
    for broken in (problem._replace(W=W * np.nan), problem._replace(mu=problem.mu + np.inf)):
        with pytest.raises(ArgumentError, match="finite"):
            save_fclib(broken, path)
    with pytest.raises(ArgumentError, match="finite"):
        save_fclib(problem, path, problem.q * np.inf)
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "a") as file:
        file["fclib_local/vectors/q"][0] = np.nan
    with pytest.raises(FileError, match="finite"):
        load_fclib(path)


DAMAGES = {  # data set of "fclib_local", what stands there instead
    "an index beyond the matrix": ("W/i", np.array([0, 1, 10**6])),
    "a negative index": ("W/i", np.array([0, 1, -7])),
    "columns that end beyond the numbers": ("W/p", np.array([0, 1, 2, 10**6])),
    "triplets without numbers": ("W/nz", np.array([7])),
    "a matrix of another size": ("W/m", np.array([10**9])),
    "a matrix without size": ("W/n", np.zeros(0)),
    "text": ("vectors/q", np.array([b"a", b"b", b"c"])),
    "negative friction": ("vectors/mu", np.array([-0.5])),
    "names of other contacts": ("info/contacts", np.array([b"C", b"D"])),
    "no vectors": ("vectors", None),
    "impulses of another problem": ("solution/r", np.zeros(6)),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_refused(damage, tmp_path):
    place, other = DAMAGES[damage]
    path, h5py = tmp_path / "damaged.hdf5", pytest.importorskip("h5py")
    save_fclib(ONE, path, np.zeros(3))
    with h5py.File(path, "r+") as file:
        place = f"fclib_local/{place}" if place not in file else place
        del file[place]
        if other is not None:
            file[place] = other
    with pytest.raises(FileError, match="damaged"):
        load_fclib(path)


def test_files_that_end_too_early_are_refused(tmp_path):
    path = tmp_path / "short.hdf5"
    save_fclib(ONE, path)
    path.write_bytes(path.read_bytes()[:-64])
    with pytest.raises(FileError, match="short"):
        load_fclib(path)


@pytest.mark.parametrize("of", ["data", "a link", "a link of a link"])
def test_numbers_of_other_files_are_not_read(of, tmp_path):
    path, elsewhere, h5py = tmp_path / "linked.hdf5", tmp_path / "other.hdf5", pytest.importorskip("h5py")
    save_fclib(ONE, path)
    save_fclib(ONE, elsewhere)
    with h5py.File(path, "r+") as file:
        vectors = file["fclib_local/vectors"]
        del vectors["q"]
        if of == "data":
            vectors.create_dataset("q", (3,), dtype="f8", external=[(elsewhere, 0, 24)])
        else:
            file["other"] = h5py.ExternalLink(elsewhere, "fclib_local/vectors")
            vectors["q"] = h5py.SoftLink("/other/q") if of == "a link of a link" else h5py.ExternalLink(elsewhere, "other")
    with pytest.raises(FileError, match="another file"):
        load_fclib(path)
