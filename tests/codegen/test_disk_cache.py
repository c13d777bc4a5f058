"""Compiled objects are read from disk by the content that they are made from, and made anew whenever that is in doubt."""

import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, from_disk, machine, object_cache, trace
from gauss.codegen import cache_size as size
from gauss.codegen.file_trust import write_temporary
from gauss.errors import CacheWarning

disk_cache, source_digest = (import_module(f"gauss.codegen.{name}") for name in ("disk_cache", "source_digest"))
GIVEN = np.array([2.0, 3.0])
pytestmark = pytest.mark.disk


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Folder of its own."""
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("GAUSS_CACHE_SIZE", raising=False)
    monkeypatch.setattr(size, "_unseen", {})
    return tmp_path / "cache"


def made(factor: float, content=()) -> tuple[Kernel, bool]:
    """Kernel by way of the disk, and whether it was made anew."""
    calls = []

    def make():
        calls.append(factor)
        return trace(lambda x: [factor * x[0] * x[1], x[0]], 2)

    return from_disk((trace, factor, *content), make), bool(calls)


def entries(place: Path, begin: str = "made-") -> list[Path]:
    return sorted(place.glob(f"{begin}*"))


def test_what_was_made_once_is_read_and_gives_the_same(place):
    first, second = made(1.5), made(1.5)
    assert first[1] and not second[1]
    assert (first[0](GIVEN) == second[0](GIVEN)).all() and second[0](GIVEN).tolist() == [9.0, 2.0]
    assert second[0].operations == first[0].operations
    other, anew = made(np.nextafter(1.5, 2.0))
    assert anew and other(GIVEN)[0] != 9.0


@pytest.mark.slow
@pytest.mark.parametrize("what", ["made-", "object"])
@pytest.mark.parametrize("spoil", ["gone", "cut", "changed", "swapped"])
def test_what_is_damaged_is_made_anew(what, spoil, place):
    made(1.5), made(2.5)
    both = [path for path in place.iterdir() if path.name.startswith("made-") == (what == "made-")]
    before = {path: path.read_bytes() for path in both if path.name != "key" and not path.name.startswith("sources-")}
    assert len(before) == 2
    for path, content in before.items():
        if spoil == "gone":
            path.unlink()
        elif spoil == "cut":
            path.write_bytes(content[: len(content) // 2])
        elif spoil == "changed":
            path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        else:
            path.write_bytes(next(other for other_path, other in before.items() if other_path != path))
    for factor, value in ((1.5, 9.0), (2.5, 15.0)):
        kernel, anew = made(factor)
        assert anew and kernel(GIVEN)[0] == value
        assert not made(factor)[1]


@pytest.mark.parametrize("content", [object(), lambda: sys.path, iter([1.0])])
def test_what_has_no_digest_is_kept_by_no_content(content, place):
    assert [made(1.5, (content,))[1] for _ in range(2)] == [True, True]
    assert not entries(place)


def test_what_changes_while_it_is_made_is_not_kept(place):
    """A law that closes over a list may find another one in the middle."""
    numbers = [1.0]

    def law():
        return numbers

    def make():
        numbers[0] += 1.0
        return trace(lambda x: [numbers[0] * x[0]], 1)

    assert from_disk((law,), make)([1.0]) == 2.0
    assert from_disk((law,), make)([1.0]) == 3.0 and not entries(place)


def test_an_object_of_this_process_is_used_and_not_kept(place):
    assert from_disk(("x",), lambda: lambda: 1.0)() == 1.0
    assert not entries(place)


def test_no_content_stands_in_an_entry(place):
    """It is the object of the process that reads: a system holds its own machine code."""
    system = gauss.compile_scene(gauss.load("four_bar"))
    found = from_disk((dict, system), lambda: {"system": system, "n": 3.0})
    again = from_disk((dict, system), lambda: pytest.fail("made anew"))
    assert found["system"] is again["system"] is system and again["n"] == 3.0
    assert b"System" not in object_cache.read(entries(place)[0].name)


@pytest.mark.slow
def test_machine_code_is_pickled_for_no_one_else():
    for thing in (trace(lambda x: [x[0]], 1), trace(lambda x: [x[0]], 1).code):
        with pytest.raises((TypeError, ValueError, pickle.PicklingError)):
            pickle.dumps(thing)


@pytest.mark.parametrize("what", ["sources", "cpu", "numpy", "llvmlite", "python"])
def test_other_sources_and_another_machine_have_other_keys(what, place, monkeypatch):
    made(1.5)
    match what:
        case "sources":
            monkeypatch.setattr(disk_cache, "source_digest", lambda outer=False: b"other")
        case "cpu":
            monkeypatch.setattr(disk_cache.llvm, "get_host_cpu_name", lambda: "other")
        case "python":
            monkeypatch.setattr(disk_cache.sys, "version", "other")
        case _:
            monkeypatch.setattr(getattr(disk_cache, {"numpy": "np"}.get(what, what)), "__version__", "other")
    monkeypatch.setattr(disk_cache, "package_digest", disk_cache.package_digest.__wrapped__)
    assert made(1.5)[1]


def test_sources_changed_since_the_process_began_keep_nothing(place, monkeypatch):
    monkeypatch.setattr(source_digest, "LOADED_AT", 0)
    monkeypatch.setattr(disk_cache, "source_digest", source_digest.source_digest.__wrapped__)
    monkeypatch.setattr(disk_cache, "package_digest", disk_cache.package_digest.__wrapped__)
    assert made(1.5)[1] and made(1.5)[1] and not entries(place)


def test_many_at_once_have_what_one_has(place):
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda k: made(1.5 + k % 2)[0](GIVEN)[0], range(16)))
    assert found == [9.0, 15.0] * 8


def test_the_least_recently_used_is_removed(place, monkeypatch):
    contents = {object_cache.key(str(k)): bytes(100_000) for k in range(8)}
    for k, (name, content) in enumerate(contents.items()):
        object_cache.write(name, content)
        os.utime(place / name, (k, k))
    first = next(iter(contents))
    object_cache.read(first)
    (place / "numbers.txt").write_bytes(bytes(10_000_000))  # of the user, in a folder that he named
    (place / "partial-abc").write_bytes(b"of a process that broke off")
    os.utime(place / "partial-abc", (0, 0))
    monkeypatch.setenv("GAUSS_CACHE_SIZE", "0.55")
    monkeypatch.setattr(size, "_unseen", {})
    object_cache.write(object_cache.key("new"), bytes(100_000))
    left = {path.name for path in place.iterdir()}
    assert left == {first, [*contents][-1], [*contents][-2], object_cache.key("new"), "key", "numbers.txt"}
    assert sum(object_cache.file_sizes().values()) <= 0.55e6
    assert size.empty(place) == 4 and {path.name for path in place.iterdir()} == {"key", "numbers.txt"}


@pytest.mark.parametrize("given, expected", [("", 512e6), ("1.5", 1.5e6), ("0", 0.0)])
def test_the_largest_size_is_given_in_megabytes(given, expected, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE_SIZE", given)
    assert size.largest_size() == expected


@pytest.mark.parametrize("given", ["much", "-1", "nan"])
def test_a_size_that_is_none_is_said(given, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE_SIZE", given)
    with pytest.warns(CacheWarning, match="GAUSS_CACHE_SIZE"):
        assert size.largest_size() == size.DEFAULT_SIZE * 1e6


def test_a_file_that_cannot_be_written_whole_leaves_nothing(tmp_path):
    """As on a full disk: here, files may have ten bytes."""
    resource = pytest.importorskip("resource")
    kept = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, kept[1]))
    try:
        with pytest.raises(OSError):
            write_temporary(tmp_path, bytes(100))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, kept)
    assert not list(tmp_path.iterdir())


def test_a_cache_of_no_size_keeps_nothing_and_compiles(place, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE_SIZE", "0")
    assert [made(1.5)[0](GIVEN)[0] for _ in range(2)] == [9.0, 9.0]
    assert not object_cache.file_sizes()


MOTIONS = {
    "four_bar": [{}, {"integrator": "rk4", "step": 1e-3}, {"integrator": "taylor"}, {"stabilisation": "baumgarte"}],
    "heavy_top": [{"integrator": "verlet", "step": 1e-3}],
    "rolling_disk": [{}],
    "friction_oscillator": [{}, {"integrator": "time_stepping", "step": 1e-3}],
    "puck": [{"integrator": "time_stepping", "step": 1e-3}],
    "slack_rope": [{}],
}


SMOOTH = ("four_bar", "heavy_top")


def functions(name: str) -> list[np.ndarray]:
    """Results of everything compiled for a scene, by a system of its own."""
    system = gauss.compile_scene(gauss.load(name))
    start, found = system.initial_state(), []
    ones = np.ones(system.n_v)
    found.append(system.accelerations(start, ones))
    if name in SMOOTH:
        found += [system.forward_dynamics(start.q, start.v, ones), system.inverse_dynamics(start.q, start.v, ones)]
        found += [*system.loop_constraints(start.q, start.v), *vars(gauss.derivatives(system, start)).values()]
        many = np.tile(start.q, (5, 1)), np.tile(start.v, (5, 1))
        for settings in ({"steps": 10, "step": 1e-3}, {"integrator": "dop853", "times": [0.01]}):
            motions = gauss.rollout(system, *many, **settings)
            found += [motions.q, motions.v]
    for settings in MOTIONS[name]:
        motion = gauss.simulate(system, 0.05, progress=False, **settings)
        found += [motion.t, motion.q, motion.v, motion.work]
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_results_are_the_same_from_disk_and_without_compiling(name, place, monkeypatch):
    cold = functions(name)
    loaded = machine.load
    texts = []
    monkeypatch.setattr(machine, "load", lambda *given, **options: texts.append(given) or loaded(*given, **options))
    warm = functions(name)
    assert [one.tobytes() for one in warm] == [one.tobytes() for one in cold]
    if name in SMOOTH:
        assert not texts


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, settings",
    [
        ("four_bar", {}),
        ("four_bar", {"stabilisation": "partitioning"}),  # calls LAPACK, whose addresses differ by process
        ("puck", {"integrator": "time_stepping", "step": 1e-3}),  # so does this
        ("heavy_top", {"integrator": "verlet", "step": 1e-3}),
        ("planetary_gears", {}),
        ("double_pendulum_stops", {}),
        ("slack_rope", {}),
        ("block_on_incline", {"integrator": "time_stepping", "step": 1e-3}),
    ],
)
def test_a_new_process_reads_what_another_made(name, settings, place):
    code = f"""
import sys
import gauss
from gauss.codegen import machine
if "warm" in sys.argv:
    machine.load = None
motion = gauss.simulate(gauss.load({name!r}), 0.2, progress=False, **{settings!r})
print(motion.q[-1].tobytes().hex())
"""
    where = {"cwd": Path(__file__).parents[2], "capture_output": True, "text": True, "check": True}
    found = {subprocess.run([sys.executable, "-c", code, how], **where).stdout for how in ("cold", "warm", "warm")}
    assert len(found) == 1
