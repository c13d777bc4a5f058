import ctypes
import shutil
import subprocess

import numpy as np
import pytest

import gauss
from gauss import export
from gauss.analysis.tangents import Tangents
from gauss.errors import ArgumentError, FileError, SimulationError

ROUND_OFF = 1e-14  # relative to the largest entry, or 1, also of derivatives by other rules; 1.9e-15 is seen
COMPILER = shutil.which("cc")


def chain():
    """Pendulum of two links on a ball joint, with springs, a traced law, and an input."""
    scene = gauss.Scene("ball chain", gravity=(0, 0, -9.81))
    upper = scene.body("upper", 1.2, (0.02, 0.03, 0.01), com=(0.05, 0, -0.25))
    lower = scene.body("lower", 0.7, (0.02, 0.02, 0.001), com=(0, 0, -0.2), position=(0, 0, -0.5))
    scene.ball("shoulder", "ground", upper)
    scene.revolute("elbow", upper, lower, at=(0, 0, -0.5), axis=(0, 1, 0))
    scene.joint_spring("buffer", "elbow", stiffness=3.0, damping=0.4)
    scene.drive("elbow", torque=lambda t, at: gauss.math.where(at.rate("elbow") > 0.1, -1.0, np.sin(t) * np.exp(-t)))
    scene.input("motor", "elbow", limits=(-2.0, 1.5))
    return scene


SCENES = {
    "pendulum": lambda: gauss.load("pendulum"),
    "ball chain": chain,
    "four bar": lambda: gauss.load("four_bar"),
    "spatial tree": lambda: gauss.load("spatial_tree"),
}


def states(system, count=3):
    """Consistent states near the start."""
    rng = np.random.default_rng(1)
    start = system.initial_state()
    for _ in range(count):
        v = rng.normal(size=system.n_v)
        step = gauss.system.retract(system, start.q, 0.3 * rng.normal(size=system.n_v))
        yield system.projected(system.initial_state(step, v)) if system.has_closures else system.state(step, v)


def arguments(exported, system, state, rng):
    """Values of the arguments of an exported function."""
    given = {"q": state.q, "v": state.v, "t": 0.4}
    return {name: given.get(name, rng.normal(size=shape)) for name, shape in exported.inputs.items()}


def expected(system, exported, given):
    """The results of our own functions."""
    given = dict(given)
    u = given.pop("u", None)
    if u is not None:
        low, high = system.scene.inputs["motor"].bounds
        given["load"] = given["load"] + np.eye(system.n_v)[system.column("elbow")] * np.clip(u[0], low, high)
    function = system.function(exported.name)
    t = given.pop("t")
    found = function(*given.values(), None, t)
    return found if isinstance(found, tuple) else (found,)


def close(found, wanted):
    for one, other in zip(found, wanted, strict=True):
        size = np.abs(other).max(initial=1.0)
        np.testing.assert_allclose(np.reshape(one, np.shape(other)), other, atol=ROUND_OFF * size, rtol=0.0)


def slopes_along(system, state, load, t, by_q, by_v, by_load):
    """Changes of accelerations along the constraints, of loads, and what ours are; derivatives by entries of q and v."""
    tangents = Tangents(system, state)
    moved = np.array([gauss.system.coordinate_rates(system, state.q, column) for column in tangents.position.T]).T
    ours = system.acceleration_derivatives(state.q, state.v, load, None, t)
    found = by_q @ moved + by_v @ tangents.change, by_v @ tangents.rate, by_load
    return found, (ours[0] @ tangents.position + ours[1] @ tangents.change, ours[1] @ tangents.rate, ours[2])


class Library:
    """Functions of C code, compiled by cc."""

    def __init__(self, code, folder):
        _, source = code.save(folder)
        flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-fPIC", "-shared"]
        subprocess.run([COMPILER, *flags, str(source), "-o", str(folder / "code.so"), "-lm"], check=True)
        self.name, self.library = code.name, ctypes.CDLL(str(folder / "code.so"))

    def __call__(self, exported, given, rows=None):
        """Results of one state, or of rows of them."""
        pointer = ctypes.POINTER(ctypes.c_double)
        lead = () if rows is None else (rows,)
        arrays = {name: np.ascontiguousarray(given[name], dtype=float) for name in exported.inputs}
        results = {name: np.empty(lead + shape) for name, shape in exported.outputs.items()}
        by_value = [name for name, shape in exported.inputs.items() if not shape and rows is None]
        values = [
            ctypes.c_double(array.item()) if name in by_value else array.ctypes.data_as(pointer)
            for name, array in (arrays | results).items()
        ]
        suffix = "" if rows is None else "_batch"
        count = [] if rows is None else [ctypes.c_size_t(rows)]
        getattr(self.library, f"{self.name}_{exported.identifier}{suffix}")(*count, *values)
        return tuple(results.values())


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", SCENES)
def test_code_of_c_is_the_functions_of_a_state(name, tmp_path):
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(2)
    frame = next(iter(system.structure.bodies))
    names = [*(one.name for one in export.exported_functions(system)), f"forward_kinematics:{frame}", f"jacobian:{frame}"]
    library = Library(export.to_c(system, names), tmp_path)
    for exported in export.exported_functions(system, names):
        given = [arguments(exported, system, state, rng) for state in states(system)]
        found = [library(exported, one) for one in given]
        for one, result in zip(given, found, strict=True):
            if not (exported.name == "acceleration_derivatives" and "u" in one):  # ours has no inputs
                close(result, expected(system, exported, one))
        stacked = {key: np.array([one[key] for one in given]) for key in exported.inputs}
        for part, rows in enumerate(library(exported, stacked, rows=len(given))):
            assert (rows == [result[part] for result in found]).all()


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_angles_of_any_size(tmp_path):
    scene = gauss.load("pendulum")
    system = gauss.compile_scene(scene)
    library = Library(export.to_c(system, "gravity_forces"), tmp_path)
    (exported,) = export.exported_functions(system, "gravity_forces")
    for angle in (0.0, -0.0, np.pi / 2, -np.pi, 1e-9, 3e4, -9.9e4, 1.1e5, 1e9, *np.linspace(-20, 20, 101)):
        (found,) = library(exported, {"q": [angle], "t": 0.0})
        close((found,), (system.gravity_forces(np.array([angle])),))


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", SCENES)
def test_functions_of_casadi_and_their_derivatives(name):
    casadi = pytest.importorskip("casadi")
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(3)
    for exported in export.exported_functions(system):
        function = export.to_casadi(system, exported.name)
        assert function.name_in() == list(exported.inputs) and function.name_out() == list(exported.outputs)
        for state in states(system):
            given = arguments(exported, system, state, rng)
            found = function(*given.values())
            if not (exported.name == "acceleration_derivatives" and "u" in given):
                close(
                    [np.array(one) for one in (found if isinstance(found, tuple) else (found,))],
                    expected(system, exported, given),
                )
    forward = export.to_casadi(system)
    symbols = [
        casadi.SX.sym(one, *shape)
        for one, shape in zip(forward.name_in(), map(forward.size_in, range(forward.n_in())), strict=True)
    ]
    slope = casadi.Function("slope", symbols, [casadi.jacobian(forward(*symbols), one) for one in symbols[:3]])
    for state in states(system):
        (exported,) = export.exported_functions(system, "forward_dynamics")
        given = arguments(exported, system, state, rng)
        given |= {"u": np.zeros(1)} if "u" in given else {}
        theirs = [np.array(one) for one in slope(*given.values())]
        close(*slopes_along(system, state, given["load"], given["t"], *theirs))


@pytest.mark.peer
@pytest.mark.parametrize("name", SCENES)
def test_functions_of_jax_and_their_derivatives(name):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(4)
    for exported in export.exported_functions(system, ("forward_dynamics", "mass_matrix")):
        function = jax.jit(export.to_jax(system, exported.name))
        given = [arguments(exported, system, state, rng) for state in states(system)]
        for one in given:
            close([function(*one.values())], expected(system, exported, one))
        stacked = [np.array([one[key] for one in given]) for key in exported.inputs]
        close([jax.vmap(function)(*stacked)], [np.array([function(*one.values()) for one in given])])
    dynamics = export.to_jax(system)
    forward = jax.jit(jax.jacfwd(dynamics, argnums=(0, 1, 2)))
    backward = jax.jit(jax.grad(lambda *given: dynamics(*given).sum(), argnums=(0, 1, 2)))
    (exported,) = export.exported_functions(system, "forward_dynamics")
    for state in states(system):
        given = arguments(exported, system, state, rng)
        given |= {"u": np.zeros(1)} if "u" in given else {}
        theirs = [np.array(one) for one in forward(*given.values())]
        close(*slopes_along(system, state, given["load"], given["t"], *theirs))
        close(backward(*given.values()), [one.sum(axis=0) for one in theirs])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "double_pendulum", "cart_pole", "four_bar"])
def test_formulas_have_the_values_of_the_functions(name):
    sympy = pytest.importorskip("sympy")
    system, rng = gauss.compile_scene(gauss.load(name)), np.random.default_rng(5)
    for function in ("mass_matrix", "bias_forces", "inverse_dynamics"):
        formulas = export.to_sympy(system, function, simplify=name != "four_bar")
        assert formulas.values and "m_" in str(next(iter(formulas.results.values())))
        given = {key: rng.normal(size=system.n_v) for key in ("q", "v", "acceleration")}
        symbols = [entry for key in given for entry in formulas.arguments[key]]
        (result,) = formulas.results.values()
        plain = sympy.lambdify(symbols, result.subs(formulas.values))
        vectors = list(given.values())
        used = {"mass_matrix": 1, "bias_forces": 2, "inverse_dynamics": 3}[function]
        wanted = system.function(function)(*vectors[:used])
        close([plain(*np.concatenate(vectors))], [wanted])


@pytest.mark.slow
def test_whole_numbers_are_shown_as_such():
    sympy = pytest.importorskip("sympy")
    (result,) = export.to_sympy(gauss.load("four_bar"), "mass_matrix").results.values()
    assert not [number for number in result.atoms(sympy.Float) if float(number).is_integer()]


@pytest.mark.slow
def test_the_document_of_a_pendulum():
    pytest.importorskip("sympy")
    text = export.latex_document(gauss.load("pendulum"))
    assert r"c_{rod x} g m_{rod} \cos{\left(q_{A} \right)}" in text and text.endswith("\\end{document}\n")


@pytest.mark.parametrize("language", ["c", "casadi", "jax", "latex"])
def test_files_of_a_language(language, tmp_path):
    pytest.importorskip({"casadi": "casadi", "latex": "sympy"}.get(language, "numpy"))
    paths = export.save_as(gauss.load("pendulum"), language, tmp_path, ["mass_matrix"])
    assert paths and all(path.stat().st_size for path in paths)
    with pytest.raises(ArgumentError, match="casadi"):
        export.save_as(gauss.load("pendulum"), "casady", tmp_path)


@pytest.mark.parametrize("language", ["c", "jax", "latex", "fmu"])
def test_folders_that_cannot_be_written_are_named(tmp_path, language):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="file"):
        export.save_as(gauss.load("pendulum"), language, tmp_path / "file" / "folder")


def with_opaque_law():
    scene = gauss.load("pendulum")
    scene.drive("A", torque=lambda t: float(t), name="windup")
    return scene


def with_contact():
    scene = gauss.load("pendulum")
    scene.stop("A", highest=1.0, name="buffer")
    return scene


@pytest.mark.parametrize(("make", "named"), [(with_opaque_law, "windup"), (with_contact, "buffer")])
def test_what_cannot_be_exported_is_named(make, named):
    with pytest.raises(SimulationError, match=f"cannot be exported: .*{named}"):
        export.to_c(make(), "forward_dynamics")


def with_frames(*names):
    scene = gauss.load("pendulum")
    for name in names:
        scene.frame(name, "rod")
    return scene


@pytest.mark.parametrize("write", [export.to_c, export.jax_source])
def test_functions_of_the_same_name_as_code_are_refused(write):
    with pytest.raises(ArgumentError, match="jacobian_left_tip, jacobian_left_tip"):
        write(with_frames("left tip", "left_tip"), ["jacobian:left tip", "jacobian:left_tip"])


def test_names_in_remarks_do_not_end_them():
    scene = gauss.Scene("a */ #error /*", gravity=(0, 0, -9.81))
    scene.revolute("turn */ b", "ground", scene.body("rod", 1.0, (0.1, 0.1, 0.1)))
    assert export.to_c(scene, "mass_matrix").header.count("*/") == 1
    tip = 'tip """ \\x'
    compile(export.jax_source(with_frames(tip), [f"jacobian:{tip}"]), "module", "exec")


def test_unknown_functions_are_refused():
    with pytest.raises(ArgumentError, match="mass_matrix"):
        export.to_c(gauss.load("pendulum"), "mas_matrix")


def test_other_poses_of_loops_that_cannot_move_are_no_numbers():
    """Two rods with both ends on an arm are written in the pose of the scene: their mirror image is none of it."""
    casadi = pytest.importorskip("casadi")
    scene, top = gauss.Scene("brace", gravity=(0, -9.81, 0)), (0.5, 0.4, 0.0)
    scene.body("arm", 1.0, (0.1, 0.2, 0.3))
    scene.revolute("root", "ground", "arm", axis=(0, 0, 1))
    for name, end in (("one", (0.0, 0.0, 0.0)), ("two", (1.0, 0.0, 0.0))):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.2, 0.1, 0.0), position=end)
        scene.revolute(f"end of {name}", "arm", name, at=end, axis=(0, 0, 1))
    scene.revolute("top", "one", "two", at=top, axis=(0, 0, 1))
    turned, v = 2.0 * np.arctan2(0.4, 0.5), np.array([1.0, 0.0, 0.0, 0.0])
    for name in ("forward_dynamics", "acceleration_derivatives"):
        function = export.to_casadi(scene, name)
        results = []
        for q in ([0.3, 0.0, 0.0, 0.0], [0.3, -turned, turned, 2.0 * turned]):
            found = function(casadi.DM(q), v, 0.0 * v, 0.0)
            results.append(np.concatenate([np.ravel(part) for part in (found if isinstance(found, tuple) else (found,))]))
        assert np.isfinite(results[0]).all() and np.isnan(results[1]).all()
