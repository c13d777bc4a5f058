"""Code of GPU threads: the same numbers as on this CPU, and PTX that NVIDIA's assembler takes."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gauss
from benchmarks.gpu_estimate import assembler
from gauss import math
from gauss.codegen import INTEGER, POINTER, write
from gauss.codegen.gpu import cuda_driver, devices, dlpack
from gauss.codegen.gpu.batches import DeviceKernel
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.codegen.gpu.ptx import ptx, refuse_libraries
from gauss.codegen.gpu.thread_code import ThreadCode
from gauss.codegen.kernels.small_linear_systems import space, write_equations
from gauss.errors import ArgumentError, DeviceError, MissingPackageError, SimulationError, StateError
from gauss.io.linkage import load_linkage
from gauss.io.rotors import load_rotors
from gauss.rotors import to_scene
from gauss.system import random_state
from tests.support import mechanisms

CAPABILITY = 90
# in units of the last place: the polynomials promise less than 1 and 2, the functions of numpy beside them less than 1
ELEMENTARY = {
    "sin": (math.sin, np.sin, 2.0),
    "cos": (math.cos, np.cos, 2.0),
    "exp": (math.exp, np.exp, 2.0),
    "log": (math.log, np.log, 2.0),
    "atan2": (math.atan2, np.arctan2, 3.0),
}
SINGLE_ERROR = 1e-5  # relative, of short chains: a hundred units of the last place of a single
ANGLES = 1e9  # [rad] up to which a GPU has sines
ROOT = Path(gauss.__file__).parents[1]
SHIPPED = [path for folder in ("", "linkages", "servo") for path in sorted((ROOT / "models" / folder).glob("*.toml"))]
CONTACTS = 1e-12  # relative: the compiler fuses multiply-adds of contact problems as it likes
LOOPS = 1e-10  # the host eliminates each loop at its innermost link, devices all loops at once
LEAST_NORM = 1e-9  # relative: random matrices of this size have condition numbers up to 1e4
CONTRACTIBLE = re.compile(r"\b(?:mul|add|sub)\.f64")
FIXED = {"steps": 20, "step": 1e-3, "every": 5}
RUNS = [
    {"integrator": "rk4", **FIXED},
    {"integrator": "semi_implicit_euler", **FIXED},
    {"integrator": "dop853", "times": np.linspace(0.0, 0.1, 5), "rtol": 1e-9},
]
SPECIAL = [0.0, -0.0, 1.0, -1.0, 5e-324, 1e-310, 1e-8, 709.7, -745.0, 800.0, -800.0, np.inf, -np.inf, np.nan]


def _arguments(name: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    spread = np.sign(rng.normal(size=2000)) * 10.0 ** rng.uniform(-12.0, 9.0, 2000)
    if name == "atan2":
        return np.array(
            [
                np.concatenate([spread, np.repeat(SPECIAL, len(SPECIAL))]),
                np.concatenate([rng.normal(size=2000), np.tile(SPECIAL, len(SPECIAL))]),
            ]
        )
    near = rng.normal(size=2000)
    wide = {"exp": rng.uniform(-745.0, 709.0, 2000), "log": 10.0 ** rng.uniform(-320.0, 308.0, 2000)}.get(name, spread)
    return np.concatenate([near, wide, SPECIAL])[None]


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_functions_need_no_library(name):
    traced, known, ulps = ELEMENTARY[name]
    x = _arguments(name)
    kernel = DeviceKernel("lanes", write(lambda given: [traced(*given)], len(x)))
    found = kernel(x)[0]
    with np.errstate(all="ignore"):
        right = known(*x)
    regular = np.isfinite(right) & (np.abs(x[0]) <= ANGLES if name in ("sin", "cos") else True)
    assert (np.abs(found - right)[regular] <= ulps * np.spacing(np.abs(right[regular]))).all()
    signed = regular if name == "atan2" else regular & (right != 0.0)  # the sine of -0 is +0
    assert np.array_equal(np.signbit(found[signed]), np.signbit(right[signed]))
    assert np.array_equal(found[~regular], right[~regular], equal_nan=True) or name in ("sin", "cos")
    assert np.isnan(found[~regular]).all() or name not in ("sin", "cos")  # never a wrong sine of a huge angle


class Assembled(LaneByLane):
    """This CPU lane by lane; what it runs is assembled for a GPU, too."""

    def __init__(self, folder: Path):
        self.folder, self.texts = folder, []

    def lowered(self, code):
        text, ptxas = ptx(code.gpu_text(), CAPABILITY), assembler()
        self.texts.append(text)
        if ptxas is not None:
            source = self.folder / f"{code.name}.ptx"
            source.write_text(text)
            arguments = [ptxas, f"-arch=sm_{CAPABILITY}", "-O1", source, "-o", source.with_suffix(".cubin")]
            done = subprocess.run(arguments, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
        return super().lowered(code)


@pytest.fixture
def assembled(tmp_path, monkeypatch) -> Assembled:
    device = Assembled(tmp_path)
    monkeypatch.setattr(devices, "_device", lambda number: device)
    return device


def _states(system, count: int):
    rng = np.random.default_rng(0)
    starts = [system.initial_state(s.q, s.v) for s in (random_state(system, rng, spread=0.2) for _ in range(count))]
    return np.array([s.q for s in starts]), np.array([s.v for s in starts])


@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenes_run_on_a_device(path, assembled):
    scene = load_linkage(path).to_scene() if path.parent.name == "linkages" else gauss.load(path)
    system = scene.system if path.parent.name == "servo" else gauss.compile_scene(scene)
    if not system.n_v:
        return
    if system.nonsmooth:
        start, run = system.initial_state(), {"integrator": "time_stepping", "steps": 20, "step": 1e-3}
        q, v = np.tile(start.q, (2, 1)), np.tile(start.v, (2, 1))
        here, there = (gauss.rollout(system, q, v, device=device, **run) for device in (None, "lanes"))
        assert np.allclose(here.q, there.q, rtol=CONTACTS, atol=CONTACTS)
        assert np.allclose(here.v, there.v, rtol=CONTACTS, atol=CONTACTS)
    else:
        q, v = _states(system, 3)
        load = np.ones_like(v)
        function = system.function("forward_dynamics", device="lanes")
        there, here = function(q, v, load), system.forward_dynamics(q, v, load)
        assert np.allclose(there, here, rtol=LOOPS, atol=LOOPS) if system.structure.closures else np.array_equal(there, here)
        assert not CONTRACTIBLE.search(assembled.texts[0])  # by the assembler, which rounds once then
    assert ".entry" in assembled.texts[0]


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((ROOT / "models" / "rotors").glob("*.toml")), ids=lambda path: path.stem)
def test_links_that_time_stepping_does_not_take_are_named(path):
    system = gauss.compile_scene(to_scene(load_rotors(path)))
    start = system.initial_state()
    for device in (None, "lanes"):
        with pytest.raises(SimulationError, match="|".join(system.losses)):
            gauss.rollout(
                system, start.q[None], start.v[None], integrator="time_stepping", steps=20, step=1e-3, device=device
            )


def test_singular_systems_are_solved_without_a_library():
    code = ThreadCode("solve", [INTEGER, POINTER, POINTER, POINTER])
    code.b.call(write_equations(code.writer.module), list(code.arguments))
    code.b.ret_void()
    device, rng = LaneByLane(), np.random.default_rng(0)
    solve = device.program(device.lowered(code))
    for order in (1, 2, 5, 9):
        for rank in range(order + 1):
            A, b = rng.normal(size=(order, rank)) @ rng.normal(size=(rank, order)), rng.normal(size=order)
            columns, x, room = device.put(A.T), device.put(b), device.put(np.zeros(space(order)))
            solve(1, [order, columns, x, room])
            right = np.linalg.lstsq(A, b, rcond=order * np.finfo(float).eps)[0]
            assert np.abs(x.numpy() - right).max() <= LEAST_NORM * max(1.0, np.abs(right).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double_pendulum", "four_bar", "heavy_top"])
@pytest.mark.parametrize("run", RUNS, ids=lambda run: run["integrator"])
def test_batches_on_a_device_are_those_of_this_cpu(name, run, assembled):
    system = gauss.compile_scene(gauss.load(name))
    q, v = _states(system, 5)
    here, there = gauss.rollout(system, q, v, **run), gauss.rollout(system, q, v, device="lanes", **run)
    assert np.array_equal(here.q, there.q) and np.array_equal(here.v, there.v)
    assert np.array_equal(here.steps, there.steps) and here.repeated == there.repeated
    assert assembled.texts


@pytest.mark.slow
def test_inputs_of_each_lane_are_held_on_a_device():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=10.0)
    system = gauss.compile_scene(scene)
    q, v = _states(system, 5)
    control = np.random.default_rng(0).normal(size=(5, 10, 1))
    run = {"steps": 50, "step": 1e-3, "every": 10, "control": control}
    here, there = gauss.rollout(system, q, v, **run), gauss.rollout(system, q, v, device="lanes", **run)
    assert np.array_equal(here.q, there.q) and np.array_equal(here.v, there.v)


def test_functions_of_a_state_on_a_device_are_those_of_this_cpu():
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5]))
    q, v = _states(system, 7)
    frame = next(iter(system.frames))
    for names in (("mass_matrix",), ("bias_forces", "kinetic_energy"), (f"forward_kinematics:{frame}",)):
        here, there = system.function(*names), system.function(*names, device="lanes")
        given = [q] if len(there.interface.vectors) == 1 else [q, v]
        for one, other in zip(_several(here(*given)), _several(there(*given)), strict=True):
            assert one.shape == other.shape and np.array_equal(one, other)


def _several(results):
    return results if isinstance(results, tuple) else (results,)


def test_what_a_device_refuses():
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0]))
    q, v = _states(system, 3)
    mass = system.function("mass_matrix", device="lanes")
    with pytest.raises(ArgumentError, match="cuda:NUMBER"):
        system.function("mass_matrix", device="gpu")
    with pytest.raises(ArgumentError, match="lanes"):
        gauss.rollout(system, q, v, steps=1, step=1e-3, device=0)
    with pytest.raises(StateError, match="q"):
        mass(q[:, :1])
    with pytest.raises(StateError, match="1 argument|expected q"):
        mass(q, v)
    with pytest.raises(StateError, match="t: expected"):
        mass(q, t=[0.0, 1.0])
    with pytest.raises(DeviceError, match="one device"):
        system.function("mass_matrix", device=["lanes", "lanes"])(q, stream=1)
    for wrong in (q + 1j, "q", [[1.0, 2.0], [3.0]], q[None]):
        with pytest.raises(StateError, match="q: expected rows"):
            mass(wrong)
    with pytest.raises(StateError, match="t: expected"):
        mass(q, t=1j)
    assert mass(q[:0]).shape == (0, 2, 2)
    q[2] = np.nan
    with pytest.raises(StateError, match="finite") as caught:
        mass(q)
    assert "row 2" in caught.value.__notes__[0]
    with pytest.raises(DeviceError, match="gauss_lapack_dgeqp3.*leave out device"):
        refuse_libraries("declare void @gauss_lapack_dgeqp3()")


@pytest.mark.slow
def test_batches_beyond_the_memory_of_a_device_are_split(monkeypatch):
    system = gauss.compile_scene(mechanisms.rods(1))
    q, v = _states(system, 9)
    run = {"steps": 20, "step": 1e-3}
    whole = gauss.rollout(system, q, v, **run)
    adaptive = {"integrator": "dop853", "times": [0.01, 0.02], "rtol": 1e-9}
    alone = gauss.rollout(system, q, v, **adaptive)
    mass = system.function("mass_matrix", device=["lanes", "lanes"])
    monkeypatch.setattr(LaneByLane, "free_bytes", lambda self: 5000)
    for device in ("lanes", ["lanes", "lanes"]):
        assert np.array_equal(gauss.rollout(system, q, v, device=device, **run).q, whole.q)
        assert np.array_equal(gauss.rollout(system, q, v, device=device, **adaptive).q, alone.q)
    assert np.array_equal(mass(q), system.mass_matrix(q))
    monkeypatch.setattr(LaneByLane, "free_bytes", lambda self: 100)
    with pytest.raises(DeviceError, match="fewer samples"):
        gauss.rollout(system, q, v, device="lanes", **run)


@pytest.mark.slow
def test_single_precision_says_its_error():
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5]))
    q, v = _states(system, 200)
    shared = ["lanes float32", "lanes float32"]
    for name, given in (("mass_matrix", [q]), ("bias_forces", [q, v]), ("forward_dynamics", [q, v, v])):
        here, there = system.function(name), system.function(name, device="lanes float32")
        assert np.array_equal(system.function(name, device=shared)(*given), there(*given))
        right, found = here(*given), there(*given)
        error = np.abs(found - right).max() / np.abs(right).max()
        assert 0.0 < there.error <= SINGLE_ERROR and error <= 4.0 * there.error  # which is that of some rows
    assert system.function("mass_matrix", device="lanes").error == 0.0
    with pytest.raises(DeviceError, match="double precision"):
        gauss.rollout(system, q, v, steps=1, step=1e-3, device="lanes float32")
    with pytest.raises(DeviceError, match="stream"):
        system.function("mass_matrix", device="lanes")(q, stream=1)


def test_devices_have_names():
    names = {"cuda": "cuda:0", "cuda:1": "cuda:1", ("cuda:0", "cuda:1"): "cuda:0,cuda:1", "lanes float32": "lanes float32"}
    names[("cuda float32", "cuda:1 float32")] = "cuda:0 float32,cuda:1 float32"
    for given, name in names.items():
        assert devices.device_name(given) == name == devices.device_name(name)
    for wrong in ("gpu", "", 0, [], ["cuda", 1], ["cuda", "lanes"], ["lanes", "lanes float32"], "cuda:-1", "cuda float16"):
        with pytest.raises(ArgumentError, match="device"):
            devices.device_name(wrong)


def test_without_its_package_a_gpu_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "cuda.bindings", None)
    cuda_driver.driver.cache_clear()
    devices._device.cache_clear()
    with pytest.raises(MissingPackageError, match="pip install cuda-bindings"):
        devices.device("cuda")


class Lent:
    def __init__(self, array: np.ndarray):
        self.array = array

    def __dlpack_device__(self):
        return dlpack.CPU, 0

    def __dlpack__(self, **_):
        return dlpack.capsule(self, self.array.ctypes.data, self.array.shape, dlpack.CPU, 0)


def test_arrays_are_lent_until_they_are_given_back():
    kept, given = len(dlpack._lent), np.arange(6.0).reshape(2, 3)
    taken = np.from_dlpack(Lent(given))
    assert np.array_equal(taken, given) and np.shares_memory(taken, given) and len(dlpack._lent) == kept + 1
    del taken
    assert len(dlpack._lent) == kept
    Lent(given).__dlpack__()  # that nobody takes
    assert len(dlpack._lent) == kept
