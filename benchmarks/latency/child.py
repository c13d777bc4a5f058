"""One scene in a fresh process: CPU time of the first answer by parts, and of a later one; prints JSON.

    python -m benchmarks.latency.child SCENE ANSWER

Parts are exclusive: what a part calls of another part counts there. The time of the main thread is the answer's; what a
thread in the background compiles meanwhile is stated apart.
"""

import builtins
import json
import sys
import time
from functools import partial

import numpy as np

CLOCK = time.thread_time  # CPU time of the main thread [s]
DURATION = 0.2  # of the motion [s]
RTOL = 1e-9
STEP = 1e-3  # s, of time stepping
BEFORE = ("import", "read")  # parts that do not count in the first answer
PARTS = (*BEFORE, "build", "trace", "write", "LLVM", "link")


class Stopwatch:
    """Exclusive times of named parts [s]."""

    def __init__(self):
        self.spent = dict.fromkeys((*PARTS, "rest"), 0.0)
        self.running = ["rest"]
        self.since = CLOCK()

    def part(self, name: str, function):
        """Function whose calls count as a part."""

        def timed(*args, **kwargs):
            self.lap()
            self.running.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                self.lap()
                self.running.pop()

        return timed

    def lap(self):
        """Count the time since the last lap."""
        now = CLOCK()
        self.spent[self.running[-1]] += now - self.since
        self.since = now


def main(name: str, answer: str) -> dict:
    """Times [s], and facts of the answer."""
    watch = Stopwatch()
    imported = builtins.__import__
    builtins.__import__ = watch.part("import", imported)
    import gauss
    from benchmarks.latency.scenes import STEPPED, scenes
    from gauss.codegen import emit, function, machine, staging

    compile_scene, ask = gauss.compile_scene, partial(ANSWERS[answer], gauss)
    if name in STEPPED:
        ask = partial(_stepped, gauss)
    for tracer in (function.write, staging.staged):
        _replace(tracer, watch.part("trace", tracer))
    setattr(emit.Writer, "body", watch.part("write", emit.Writer.body))  # noqa: B010  # a method, for a type checker
    for compiler in ("quick_objects", "optimised_objects"):
        setattr(machine, compiler, watch.part("LLVM", _at_once(getattr(machine, compiler))))
    machine.linked = watch.part("link", machine.linked)
    scene = watch.part("read", scenes()[name])()
    watch.lap()
    before, whole = sum(watch.spent.values()) - watch.spent["import"], time.process_time()
    system = watch.part("build", compile_scene)(scene)
    state = system.initial_state()
    found = ask(system, state)
    watch.lap()
    whole = time.process_time() - whole
    builtins.__import__ = imported
    first = sum(watch.spent.values()) - watch.spent["import"] - before
    later, result = min(_again(ask, system, state) for _ in range(3)), float(np.abs(found).sum())
    parts = {part: watch.spent[part] for part in PARTS}
    rest = first - sum(parts[part] for part in PARTS if part not in BEFORE)
    return {
        "first": first,
        **parts,
        "rest": rest,
        "whole process": whole,
        "later": later,
        "rates": system.n_v,
        "result": result,
    }


def _replace(function, by):
    """Put another function in the place of one in all modules of gauss that name it."""
    name = function.__name__
    for module in [module for key, module in sys.modules.items() if key.startswith("gauss.")]:
        if getattr(module, name, None) is function:
            setattr(module, name, by)


def _at_once(generate):
    return lambda *given: list(generate(*given))


def _again(ask, system, state) -> float:
    begin = CLOCK()
    ask(system, state)
    return CLOCK() - begin


def _motion(gauss, system, state) -> np.ndarray:
    return gauss.simulate(system, DURATION, rtol=RTOL, progress=False).q[-1]


def _stepped(gauss, system, state) -> np.ndarray:
    return gauss.simulate(system, DURATION, integrator="time_stepping", step=STEP, progress=False).q[-1]


def _accelerations(gauss, system, state) -> np.ndarray:
    return system.accelerations(state)


def _derivatives(gauss, system, state) -> np.ndarray:
    return gauss.derivatives(system, state).q


def _inverse_dynamics(gauss, system, state) -> np.ndarray:
    return system.inverse_dynamics(state.q, state.v, np.zeros(system.n_v))


ANSWERS = {
    "motion": _motion,
    "accelerations": _accelerations,
    "derivatives": _derivatives,
    "inverse dynamics": _inverse_dynamics,
}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
