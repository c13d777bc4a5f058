"""Arguments of functions of a state: batches of states, arrays of other libraries, quaternions, mistakes."""

import copy
from contextlib import suppress

import numpy as np
import pytest

import gauss
from gauss.codegen import content_digest
from gauss.codegen.python_wrapper import as_doubles
from gauss.errors import ArgumentError, StateError
from gauss.system import random_state
from tests.support.state_functions import names, relative

AGREEMENT = 1e-12  # relative to the largest entry, of sums in another order


class Foreign:
    """Array of another library on the CPU: its memory is shared by DLPack alone."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


@pytest.fixture(scope="module")
def arm():
    return gauss.compile_scene(gauss.load("random_tree", n=6, seed=0))


def states(system, count):
    rng = np.random.default_rng(2)
    found = [random_state(system, rng) for _ in range(count)]
    return np.array([state.q for state in found]), np.array([state.v for state in found])


@pytest.mark.slow
def test_a_batch_is_made_of_single_states_bit_for_bit(arm):
    Q, V = states(arm, 13)
    functions = [arm.bias_forces, arm.mass_matrix, arm.function(*names(arm)), arm.function("kinetic_energy")]
    for f in functions:
        given = (Q,) if f is arm.mass_matrix else (Q, V)
        found, alone = f(*given), [f(*(x[k] for x in given)) for k in range(13)]
        if isinstance(found, tuple):
            for k, part in enumerate(found):
                assert np.array_equal(part, [one[k] for one in alone])
        else:
            assert np.array_equal(found, alone)
    assert arm.mass_matrix(Q[:0]).shape == (0, arm.n_v, arm.n_v)
    assert np.array_equal(arm.mass_matrix(Q[:12].reshape(3, 4, -1)).reshape(12, arm.n_v, arm.n_v), arm.mass_matrix(Q[:12]))


@pytest.mark.slow
def test_arrays_of_any_strides_types_and_libraries_give_the_same(arm):
    Q, V = states(arm, 9)
    expected, wide = arm.bias_forces(Q, V), np.zeros((9, 2 * arm.n_q))
    wide[:, ::2] = Q
    unaligned = np.frombuffer(b"x" + Q.tobytes(), dtype=np.uint8)[1:].view(float).reshape(Q.shape)
    for q in (wide[:, ::2], np.asfortranarray(Q), Q[::-1].copy()[::-1], unaligned, Q.tolist(), Foreign(Q), Q.astype(">f8")):
        assert np.array_equal(arm.bias_forces(q, V), expected)
    assert np.array_equal(arm.bias_forces(Q, V[0]), [arm.bias_forces(q, V[0]) for q in Q])
    out, room = np.zeros_like(V), np.zeros((9, 2, arm.n_v))
    assert arm.bias_forces(Q, V, out=out) is out and np.array_equal(out, expected)
    arm.bias_forces(Q, V, out=room[:, 1])
    assert np.array_equal(room[:, 1], expected) and not room[:, 0].any()
    other = Foreign(np.zeros_like(V))
    assert arm.bias_forces(Q, V, out=other) is other and np.array_equal(other.array, expected)
    rates = V.copy()
    assert np.array_equal(arm.bias_forces(Q, rates, out=rates), expected)  # over one of the arguments
    empty = np.zeros((9, 0)), np.zeros((9, 0, arm.n_v)), np.zeros((9, 0))
    assert arm.loop_constraints(Q, V, out=empty) is empty  # of no loops
    parts = np.zeros((9, 3, 3)), np.zeros((9, 3))
    frame = list(arm.frames)[-1]
    assert arm.forward_kinematics(Q, frame, out=parts) is parts
    assert all(np.array_equal(*pair) for pair in zip(parts, arm.forward_kinematics(Q, frame), strict=True))


def test_tensors_of_torch_share_their_memory(arm):
    torch = pytest.importorskip("torch")
    Q, V = states(arm, 9)
    q, v, out = torch.from_numpy(Q), torch.from_numpy(V), torch.zeros(9, arm.n_v, dtype=torch.float64)
    taken = as_doubles(q)
    assert taken is not None and taken.ctypes.data == q.data_ptr()
    expected, place = arm.bias_forces(Q, V), out.data_ptr()
    assert arm.bias_forces(q, v, out=out) is out and out.data_ptr() == place and np.array_equal(out.numpy(), expected)
    found = arm.bias_forces(q, v)
    assert torch.from_dlpack(found).data_ptr() == found.ctypes.data and np.array_equal(found, expected)
    with pytest.raises(StateError, match="detach"):
        arm.bias_forces(q.clone().requires_grad_(True), v)
    with pytest.raises(StateError, match="Tensor of shape"):
        arm.bias_forces(torch._neg_view(q), v)  # noqa: SLF001  # as the imaginary part of a conjugate: memory of the other sign


def test_arrays_of_jax_share_their_memory(arm):
    jax = pytest.importorskip("jax")
    Q, V = states(arm, 9)
    with jax.enable_x64(True):
        q, v = jax.numpy.array(Q), jax.numpy.array(V)
        taken = as_doubles(q)
        assert taken is not None and taken.ctypes.data == q.unsafe_buffer_pointer()
        found = arm.bias_forces(q, v)
        assert jax.dlpack.from_dlpack(found).unsafe_buffer_pointer() == found.ctypes.data
        assert np.array_equal(found, arm.bias_forces(Q, V))
        with pytest.raises(StateError, match="writeable"):
            arm.bias_forces(q, v, out=jax.numpy.zeros_like(v))


def test_functions_that_a_system_keeps_leave_its_content_known():
    system = gauss.compile_scene(gauss.load("four_bar"))
    q, before = system.initial_state().q, content_digest(system)
    system.mass_matrix(q), system.jacobian(q, "coupler"), system.null_space(q, independent="A")  # noqa: B018
    assert before is not None and content_digest(system) == before
    assert not {"mass_matrix", "jacobian", "null_space"} & vars(copy.copy(system)).keys()


def test_quaternions_are_normalised_or_refused(arm):
    Q, V = states(arm, 5)
    place = next(iter(arm.quaternions.values()))
    typed = Q.copy()
    typed[3, place] *= 1 + 1e-7
    assert relative(arm.bias_forces(typed, V), arm.bias_forces(Q, V)) <= AGREEMENT
    typed[3, place] *= 2
    with pytest.raises(StateError, match="has length 2, not 1") as refusal:
        arm.bias_forces(typed, V)
    assert refusal.value.__notes__ == ["in row 3 of the batch"]


MISTAKES = {
    "size": (lambda s, q, v: s.mass_matrix(q[1:]), StateError, r"q: expected \d+ numbers, or rows of them"),
    "batches": (lambda s, q, v: s.bias_forces([q] * 2, [v] * 3), StateError, "batches of different lengths: q .2, "),
    "rates": (lambda s, q, v: s.bias_forces(q, np.full_like(v, np.inf)), StateError, "v: expected .* finite numbers"),
    "frame": (lambda s, q, v: s.jacobian(q, "hand"), StateError, "no body or frame 'hand'. Known: "),
    "no frame": (lambda s, q, v: s.jacobian(q), ArgumentError, "jacobian: expected the name of a frame .* one of 'ground'"),
    "axes": (lambda s, q, v: s.jacobian(q, "ground", reference="globe"), ArgumentError, "no axes 'globe'. Known: local, "),
    "name": (lambda s, q, v: s.function("mass_matrx"), ArgumentError, "Did you mean 'mass_matrix'"),
    "frame of none": (lambda s, q, v: s.function("mass_matrix:hand"), ArgumentError, "takes no frame, got 'hand'"),
    "no coordinates": (lambda s, q, v: s.null_space(q), ArgumentError, "expected the names of independent joints"),
    "few": (lambda s, q, v: s.function("mass_matrix", independent=()), StateError, r"expected \d+ different .* got none"),
    "argument": (lambda s, q, v: s.evaluate("bias_forces", q), StateError, "bias_forces: expected v as well"),
    "masked": (lambda s, q, v: s.mass_matrix(np.ma.array(q, mask=q > q.min())), StateError, r"q: expected \d+ numbers"),
    "beside": (lambda s, q, v: s.function("forward_dynamics", "momentum"), ArgumentError, "forward_dynamics: compiled"),
    "of parameter": (lambda s, q, v: s.parameter_derivatives("mass"), ArgumentError, "'mass': expected 'gravity', or"),
    "one out": (
        lambda s, q, v: s.acceleration_derivatives(q, v, v, out=(np.zeros((s.n_v, s.n_v)),) * 3),
        StateError,
        "out: expected 3 arrays, one for each result, got arrays that share memory",
    ),
    "out": (lambda s, q, v: s.mass_matrix(q, out=np.zeros(3)), StateError, r"out: expected a writeable array of shape"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_are_named(arm, case):
    call, kind, words = MISTAKES[case]
    (q,), (v,) = states(arm, 1)
    with pytest.raises(kind, match=words):
        call(arm, q, v)


OF_SQUARED_RATES = (
    "bias_forces",
    "kinetic_energy",
    "inverse_dynamics",
    "inverse_dynamics_derivatives",
    "acceleration_derivatives",
)


@pytest.mark.parametrize("name", OF_SQUARED_RATES)
def test_results_that_overflow_are_refused(arm, name):
    function, ((q,), (v,)) = arm.function(name), states(arm, 1)
    given = [v] * (name.startswith("inverse") or name.startswith("acceleration"))
    assert np.isfinite(np.concatenate([np.ravel(part) for part in np.atleast_1d(function(q, 1e100 * v, *given))])).all()
    for rates in (1e200 * v, np.array([v, 1e200 * v])):
        with pytest.raises(StateError, match="no finite result"):
            function(
                np.broadcast_to(q, rates.shape[:-1] + q.shape), rates, *(np.broadcast_to(u, rates.shape) for u in given)
            )


@pytest.mark.parametrize("power", np.arange(153.0, 156.0, 0.25))
@pytest.mark.parametrize("name", ["bias_forces", "kinetic_energy", "inverse_dynamics"])
def test_no_result_is_infinite(arm, name, power):
    """Of either sign, where squares of rates begin to overflow."""
    (q,), (v,) = states(arm, 1)
    for rates in (10.0**power * v, -(10.0**power) * v):
        with suppress(StateError):
            assert np.isfinite(arm.function(name)(q, rates, *([0.0 * v] if name == "inverse_dynamics" else []))).all()


@pytest.mark.slow
def test_a_number_that_is_not_finite_is_found_wherever_it_stands(arm):
    (q,), (v,) = states(arm, 1)
    for function in (arm.function("inverse_dynamics"), arm.forward_dynamics):
        for k in range(q.size + 2 * v.size):
            for wrong in (np.nan, np.inf, -np.inf):
                given = np.concatenate([q, v, v])
                given[k] = wrong
                with pytest.raises(StateError, match="finite"):
                    function(*np.split(given, [q.size, q.size + v.size]))


@pytest.mark.parametrize("name", ["coriolis_matrix", "momentum"])
def test_results_that_are_linear_in_the_rates_do_not_overflow(arm, name):
    (q,), (v,) = states(arm, 1)
    np.testing.assert_allclose(arm.function(name)(q, 1e200 * v) / 1e200, arm.function(name)(q, v), rtol=1e-12, atol=1e-12)


def test_a_scene_in_which_nothing_moves_has_functions_of_its_state():
    scene = gauss.Scene("still")
    scene.fixed("base", "ground", scene.body("post", mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.0, 0.0, 0.5)))
    system, none = gauss.compile_scene(scene), np.zeros(0)
    assert system.jacobian(none, "post").shape == system.jacobian_rate(none, none, "post").shape == (6, 0)
    np.testing.assert_array_equal(system.center_of_mass(none), [0.0, 0.0, 0.5])
    assert not system.momentum(none, none).any() and system.inverse_dynamics(none, none, none).shape == (0,)
