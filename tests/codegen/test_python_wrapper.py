"""A compiled function called from Python takes what it should, refuses what it must, and leaves nothing behind."""

import copy
import gc
import inspect
import os
import pickle
import subprocess
import sys
import threading
import weakref
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gauss.codegen import Interface, PythonWrapper, cpython_layout, entry_code, fastcall, write
from gauss.errors import StateError

N = 3
LIMIT = 100.0
Q, V = np.array([0.5, -1.0, 2.0]), np.array([3.0, 0.25, -0.75])


def formula(q, v, t=0.0):
    return np.array([q[0] * v[1] + t, q[1] - v[2], np.sin(q[2]), q @ v])


def make(otherwise=lambda *_: np.full(4, -1.0)):
    """Function of two vectors and a number, whose results hold while |q₀| ≤ LIMIT; beyond, another is asked."""
    function = write(lambda q, v, t: [*formula(q, v, t[0]), np.abs(q[0])], N, N, 1)
    interface = Interface({"q": N, "v": N}, "t", limits=(LIMIT,))
    other = PythonWrapper(lambda x: otherwise(*interface.split(x)), replace(interface, limits=()), 4, None, "f", "Another.")
    return fastcall(entry_code(function, interface), interface, other, "f", "Four numbers.")


@pytest.fixture(scope="module")
def machine_code():
    return make()


@pytest.fixture(scope="module")
def plain():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cpython_layout, "is_known", lambda: False)
        return make()


@pytest.fixture(params=["machine_code", "plain"])
def f(request):
    return request.getfixturevalue(request.param)


def calls_of_python(function) -> int:
    """Python functions that are entered while a function runs."""
    entered = []
    sys.setprofile(lambda frame, event, _: entered.append(frame.f_code.co_qualname) if event == "call" else None)
    try:
        function()
    finally:
        sys.setprofile(None)
    return len(entered) - 1  # the function itself


def test_what_can_be_converted_gives_the_same_numbers(f):
    wide = np.zeros((N, 2))
    wide[:, 0] = Q
    unaligned = np.frombuffer(b"x" + Q.tobytes(), dtype=np.uint8)[1:].view(float)
    locked = Q.copy()
    locked.flags.writeable = False
    expected = formula(Q, V)
    same = [Q, list(Q), tuple(Q), wide[:, 0], Q[::-1].copy()[::-1], Q.astype(">f8"), Q.astype(np.float32), unaligned]
    same += [locked, Q.astype(object), Q.view(type("Vector", (np.ndarray,), {}))]
    for q in same:
        assert np.array_equal(f(q, V), expected)
    assert f([1, 2, 3], V) == pytest.approx(formula(np.array([1, 2, 3]), V), rel=1e-15)
    assert type(f(same[-1], V)) is np.ndarray


def test_every_way_to_pass_arguments(f):
    expected, later = formula(Q, V), formula(Q, V, 2.5)
    out = np.zeros(4)
    for result in (f(Q, V), f(Q, V, None), f(v=V, q=Q), f(Q, v=V), f(Q, V, out=None), f(Q, V, t=0)):
        assert np.array_equal(result, expected) and result.flags.owndata and result is not out
    for call in (lambda: f(Q, V, out), lambda: f(Q, V, out=out), lambda: f(q=Q, v=V, out=out), lambda: f(Q, V, out, 0.0)):
        out[:] = 0.0
        assert call() is out and np.array_equal(out, expected)
    for result in (f(Q, V, None, 2.5), f(Q, V, out, 2.5), f(Q, V, t=2.5), f(Q, V, t=np.float64(2.5), out=out)):
        assert np.array_equal(result, later)


def test_arrays_of_doubles_do_not_pass_through_python(machine_code):
    out, f = np.zeros(4), machine_code
    unpickled = pickle.loads(pickle.dumps(Q))
    assert unpickled.dtype is not Q.dtype  # it has its own type of doubles
    for call in (lambda: f(Q, V), lambda: f(Q, V, out), lambda: f(Q, V, out=out), lambda: f(Q, V, None, 1.0)):
        assert calls_of_python(call) == 0
    assert calls_of_python(lambda: f(unpickled, V, unpickled.repeat(4)[:4])) == 0
    assert calls_of_python(lambda: f(list(Q), V)) > 0


REFUSED = {
    "size": ((Q[:2], V), {}, r"q: expected 3 numbers, got a ndarray of shape \(2,\)"),
    "dimensions": ((Q, V[None]), {}, r"v: expected 3 numbers, got a ndarray of shape \(1, 3\)"),
    "no dimension": ((1.0, V), {}, "q: expected 3 numbers, got 1.0"),
    "complex": ((Q + 0j, V), {}, "q: expected 3 numbers, got a ndarray .* type complex128"),
    "words": ((["a", "b", "c"], V), {}, r"q: expected 3 numbers, got \['a', 'b', 'c'\]"),
    "ragged": (([1.0, [2.0], 3.0], V), {}, "q: expected 3 numbers"),
    "none": ((None, V), {}, "q: expected 3 numbers, got None"),
    "time": ((Q, V, None, "1"), {}, "t: expected a number, got '1'"),
    "several times": ((Q, V), {"t": [0.0, 1.0]}, "t: expected a number"),
    "out list": ((Q, V, [0.0] * 4), {}, "out: expected a writeable array of 4 doubles, got \\[0.0"),
    "out size": (
        (Q, V),
        {"out": np.zeros(5)},
        r"out: expected a writeable array of 4 doubles, got a ndarray of shape \(5,\)",
    ),
    "out type": ((Q, V, np.zeros(4, dtype=np.float32)), {}, "out: expected .* type float32"),
    "out order": ((Q, V, np.zeros(4, dtype=">f8")), {}, "out: expected .* type >f8"),
    "out matrix": ((Q, V, np.zeros((4, 1))), {}, "out: expected"),
    "out locked": ((Q, V, np.broadcast_to(0.0, 4)), {}, "out: expected .* got a read-only ndarray"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused(f, case):
    args, kwargs, words = REFUSED[case]
    with pytest.raises(StateError, match=words):
        f(*args, **kwargs)


@pytest.mark.parametrize(
    "args, kwargs",
    [
        ((), {}),
        ((Q,), {}),
        ((Q, V, None, 0.0, 1), {}),
        ((Q, V), {"ouch": 1}),
        ((Q, V, None), {"out": None}),
        ((Q,), {"out": Q}),
    ],
)
def test_wrong_calls_name_the_signature(f, args, kwargs):
    with pytest.raises(TypeError, match=r"f\(q, v, out=None, t=0.0\): "):
        f(*args, **kwargs)


def test_results_go_into_any_writeable_array_of_doubles_even_one_of_the_arguments(f):
    strided = np.zeros(8)
    assert np.array_equal(f(Q, V, strided[::2]), formula(Q, V)) and not strided[1::2].any()
    room = np.zeros(7)
    room[1:4], room[4:7] = Q, V
    f(room[1:4], room[4:7], room[0:4])
    assert np.array_equal(room[:4], formula(Q, V)) and np.array_equal(room[4:], V)


def test_results_off_their_limits_are_left_to_another(f):
    far = Q + [2 * LIMIT, 0, 0]
    assert np.array_equal(f(far, V), np.full(4, -1.0))
    assert np.array_equal(f([np.nan, 0, 0], V), np.full(4, -1.0))
    out = np.zeros(4)
    assert f(far, V, out) is out and out[0] == -1.0


def test_another_function_gets_the_arguments_as_they_are(machine_code):
    asked = []
    function = write(lambda q, v, t: [*formula(q, v, t[0]), np.abs(q[0])], N, N, 1)
    interface, out, far = Interface({"q": N, "v": N}, "t", limits=(LIMIT,)), np.zeros(4), Q + [2 * LIMIT, 0, 0]
    f = fastcall(
        entry_code(function, interface), interface, lambda *args, **named: asked.append((args, named)), "f", "Four numbers."
    )
    f(far, V, out=out)
    f(far, V, out, 2.0)
    f(list(far), V)
    assert asked[0][0][0] is far and asked[0][1]["out"] is out and asked[1] == ((far, V, out, 2.0), {})
    assert np.array_equal(asked[2][0][0], far) and asked[2][0][2:] == (None, 0.0)


def test_each_function_keeps_its_own_objects_though_the_code_is_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))
    asked = []
    one, other = (make(lambda q, v, t, k=k: asked.append((k, q[0], t)) or np.full(4, k)) for k in (1.0, 2.0))
    assert len([path for path in tmp_path.iterdir() if path.name != "key"]) == 1
    far = Q + [2 * LIMIT, 0, 0]
    assert one(far, V)[0] == 1.0 and other(far, V, None, 3.0)[0] == 2.0 and asked == [(1.0, far[0], 0.0), (2.0, far[0], 3.0)]

    def refuse(*_):
        raise StateError("far away")

    with pytest.raises(StateError, match="far away"):
        make(refuse)(far, V)


def test_it_introduces_itself(f):
    assert f.__name__ == "f" and f.__doc__ == "Four numbers."
    assert str(inspect.signature(f)) == "(q, v, out=None, t=0.0)"


def changes_of_references(watched, rounds, call) -> list[int]:
    before = [sys.getrefcount(thing) for thing in watched]
    for _ in range(rounds):
        call()
    return [sys.getrefcount(thing) - count for thing, count in zip(watched, before, strict=True)]


def test_machine_code_neither_loses_nor_keeps_references(machine_code):
    out, now, f = np.zeros(4), 1.5e10, machine_code
    watched = [Q, V, out, now, np.dtype(float), np.ndarray, f, f.__self__.fallback]
    for call in (lambda: f(Q, V, out), lambda: f(Q, V), lambda: f(Q, V, out=out), lambda: f(Q, V, None, now)):
        assert max(np.abs(changes_of_references(watched, 100_000, call))) <= 2  # one in every call would be 100 000


def test_no_way_through_keeps_references(f):
    out, locked, far, times = np.zeros(4), np.broadcast_to(0.0, 4), Q + [2 * LIMIT, 0, 0], [0.0, 1.0]

    def refused():
        with pytest.raises(StateError):
            f(Q, V, locked)
        with pytest.raises(StateError):
            f(Q, V, out, times)
        with pytest.raises(TypeError):
            f(Q, V, ouch=out)

    for call in (lambda: f(far, V, out), lambda: f(list(Q), V, out=out), refused):
        assert max(np.abs(changes_of_references([Q, V, out, locked, far, times, f], 1_000, call))) <= 10


HOLDERS = {
    "a name": lambda array: array,
    "a view": lambda array: array[1:].reshape(-1, 1),
    "memory": lambda array: memoryview(array),
    "DLPack": lambda array: np.from_dlpack(array),
    "a weak reference": lambda array: weakref.ref(array),
}


@pytest.mark.parametrize("hold", HOLDERS.values(), ids=HOLDERS)
def test_results_that_something_refers_to_stay_as_they_are(f, hold):
    rows = [Q + k * V for k in range(4)]
    held = [hold(f(q, V)) for q in rows]
    f(Q, V)
    for q, one in zip(rows, held, strict=True):
        found = one() if isinstance(one, weakref.ref) else np.asarray(one)
        assert found is None or np.array_equal(found.ravel(), formula(q, V)[-found.size :])


@pytest.mark.slow
def test_it_is_collected_and_its_results_stay():
    f = make()
    owner = weakref.ref(f.__self__.fallback) if cpython_layout.is_known() else weakref.ref(f)
    result = f(Q, V)
    bound = [f]
    bound.append(bound)  # a cycle
    del f, bound
    gc.collect()
    assert owner() is None and np.array_equal(result, formula(Q, V))


@pytest.mark.slow
def test_a_cycle_through_it_is_collected():
    found = []
    f = make(lambda *_, found=found: found[0](Q, V))
    found.append(f)
    watched = weakref.ref(f)
    assert not any(gc.is_tracked(part) for part in f.__self__.definition)  # the collector would empty it too early
    del f, found
    gc.collect()
    assert watched() is None


def test_threads_share_it(f):
    rng, wrong = np.random.default_rng(0), []

    def work(qs):
        out = np.zeros(4)
        for q in qs:
            if not np.array_equal(f(q, V, out), expected[q.tobytes()]) or not np.array_equal(f(q, V), out):
                wrong.append(q)

    parts = rng.standard_normal((4, 500, N))
    expected = {q.tobytes(): f(q, V) for q in parts.reshape(-1, N)}
    threads = [threading.Thread(target=work, args=(part,)) for part in parts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_it_cannot_be_pickled_but_copied(f):
    with pytest.raises(TypeError, match="'f'.*pickled"):
        pickle.dumps(f)
    if type(f).__name__ == "builtin_function_or_method":
        assert copy.deepcopy(f) is f


EXIT = """
import atexit, threading, numpy as np
from tests.codegen.test_python_wrapper import Q, V, make
f, around = make(), []
around.append(make(lambda *_: around))
del around
class Last:
    def __del__(self, f=f, q=Q, v=V):
        assert f(q, v)[1] == q[1] - v[2]
last = Last()
atexit.register(lambda: f(Q, V, np.zeros(4)))
def forever():
    while True:
        f(Q, V)
threading.Thread(target=forever, daemon=True).start()
print(f(Q, V)[1])
"""


@pytest.mark.slow
def test_the_interpreter_ends_in_peace():
    checked = os.environ | {"PYTHONMALLOC": "debug"}  # memory that was given back is overwritten
    ended = subprocess.run([sys.executable, "-c", EXIT], capture_output=True, text=True, timeout=60, env=checked)
    assert (ended.returncode, ended.stdout.strip(), ended.stderr) == (0, "-0.25", "")


@pytest.mark.parametrize(
    "what, value",
    [
        ("NUMPY_ABI", ()),
        ("NEWEST_CPYTHON", (3, 2)),
        ("ARRAY_OFFSETS", cpython_layout.ARRAY_OFFSETS | {"flags": 60}),
        ("TYPE_OFFSET", 0),
        ("TYPE_WORD_OFFSET", 16),
    ],
)
def test_unknown_layouts_are_not_relied_upon(monkeypatch, what, value):
    assert cpython_layout.is_known()
    monkeypatch.setattr(cpython_layout, what, value)
    assert not cpython_layout.is_known.__wrapped__()


ARRAYS = hnp.arrays(
    dtype=st.sampled_from([float, np.float32, int, bool, complex, ">f8", "U3"]),
    shape=st.sampled_from([(N,), (N,), (N,), (4,), (0,), (), (N, 1), (1, N)]),
    fill=st.nothing(),
)
ANYTHING = st.one_of(
    hnp.arrays(float, N),
    ARRAYS,
    st.lists(st.one_of(st.floats(), st.none(), st.text(max_size=1)), max_size=4),
    st.none(),
    st.text(max_size=2),
    st.integers(),
    st.floats(),
)
OUT = st.one_of(st.none(), hnp.arrays(float, st.sampled_from([(4,), (3,), (4, 1)])), ANYTHING)


def outcome(function, args):
    """What a call returns, or the error that it raises."""
    args = copy.deepcopy(args)
    try:
        result = function(*args)
    except (StateError, TypeError) as error:
        return type(error), str(error)
    return result is (args[2] if len(args) > 2 else None), result.tobytes()


@pytest.mark.slow
@given(
    args=st.one_of(
        st.tuples(ANYTHING, ANYTHING), st.tuples(ANYTHING, ANYTHING, OUT), st.tuples(ANYTHING, ANYTHING, OUT, ANYTHING)
    )
)
@settings(max_examples=400, deadline=None)
def test_machine_code_and_plain_function_do_the_same_with_anything(machine_code, plain, args):
    with np.errstate(all="ignore"):
        assert outcome(machine_code, args) == outcome(plain, args)
