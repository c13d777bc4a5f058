"""A motion enters the files of what its scene has, and no others: features that it does not have are refused at the door."""

import sys

import pytest

import gauss
from gauss.backends import registry

ROOT = gauss.__file__.removesuffix("__init__.py")
AGAIN = 24  # files of the second motion of a compiled system: checks of the arguments, plan, driver, run, trajectory
ANEW = 48  # those, the scene made a system, and its machine code read from disk
DEEPEST = 23  # calls of gauss within each other, from `simulate` to the reading of a file of the cache
# what a four-bar does not have: laws, contacts, events, time stepping, inputs, rigid loops
ABSENT = "laws/switching", "laws/prescribed", "laws/constraint", "contact/", "phases/", "moreau/", "history", "rigid"
FUNCTION = 0x1  # flag of the code of a function, not of the body of a class or a module


def chains(function) -> list[list[str]]:
    """Files of gauss that are entered by calls, each with those that called it, outermost first; imports do not count."""
    found: list[list[str]] = []
    stack: list[str] = []
    importing = 0

    def look(frame, event, _):
        nonlocal importing
        code = frame.f_code
        if code.co_filename.startswith("<frozen importlib") and code.co_name == "_find_and_load":
            importing += {"call": 1, "return": -1}.get(event, 0)
        if importing or not code.co_flags & FUNCTION or not code.co_filename.startswith(ROOT):
            return
        if event == "call":
            stack.append(code.co_filename.removeprefix(ROOT).replace("\\", "/"))
            found.append(stack.copy())
        elif event == "return" and stack:
            stack.pop()

    sys.setprofile(look)
    try:
        function()
    finally:
        sys.setprofile(None)
    return found


def left(chain: list[str]) -> list[str]:
    """Files of a chain of calls, without calls within one file."""
    return [file for k, file in enumerate(chain) if k == 0 or chain[k - 1] != file]


@pytest.mark.parametrize("name", ["pendulum", "cart_pole", "four_bar"])
def test_the_second_motion_enters_what_its_scene_has(name):
    system = gauss.compile_scene(gauss.load(name))
    move = lambda: gauss.simulate(system, 0.01, progress=False)  # noqa: E731
    move()
    found = chains(move)
    files = {chain[-1] for chain in found}
    assert len(files) <= AGAIN, sorted(files)
    assert [file for file in files if any(part in file for part in ABSENT)] == []


@pytest.mark.disk
@pytest.mark.slow  # machine code is made
def test_a_scene_whose_machine_code_is_on_disk_is_not_reduced_and_planned_again(monkeypatch, tmp_path):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))
    for _ in range(2):
        scene = gauss.load("four_bar")
        found = chains(lambda scene=scene: gauss.simulate(scene, 0.01, progress=False))
    files = {chain[-1] for chain in found}
    assert len(files) <= ANEW, sorted(files)
    assert max(map(len, found)) <= DEEPEST
    assert [file for file in files if "passes/" in file or any(part in file for part in ABSENT)] == []


@pytest.mark.parametrize("backend", ["auto", "recursion", "kkt", "nullspace", *registry.DIRECT])
def test_the_way_to_a_backend_returns_to_no_file_that_it_left(backend):
    if backend in registry.DIRECT:
        pytest.importorskip(backend)
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    compulsion = gauss.assemble(system, system.initial_state())
    gauss.solve(compulsion, backend=backend)
    ways = [left(chain) for chain in chains(lambda: gauss.solve(compulsion, backend=backend))]
    assert [way for way in ways if len(set(way)) < len(way)] == []
