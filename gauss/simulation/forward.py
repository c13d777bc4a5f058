"""Forward dynamics of a system as a function to be called from Python at the speed of machine code."""

from collections.abc import Callable
from functools import cache

import numpy as np

from gauss.assembly import forward_sweep
from gauss.errors import SimulationError, StateError
from gauss.simulation.laws import Laws
from gauss.simulation.program import Program
from gauss.system import System, is_large, obstacles
from gauss.tracing import Kernel, Signature, direct, write

DOC = """forward_dynamics(q, v, load, out)
--

Joint accelerations (n_v,), written into out and returned; q (n_q,), v and load (n_v,). Not certified.
"""


def forward_dynamics(system: System) -> Callable:
    """Function (q, v, load, out) → out of a system whose loads do not depend on time.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, or depends on time.
    """
    laws = Laws(system)
    against = obstacles(system) + [f"the law of {name!r} cannot be traced ({why})" for name, why in laws.reasons.items()]
    if is_large(system) and system.loads:
        against.append("its loads are added in Python to a tree of that size")
    if against:
        raise SimulationError(f"scene {system.scene.name!r} cannot be compiled: {'; '.join(against)}; use accelerations.")
    n_q, n_v = system.n_q, system.n_v
    if is_large(system):
        function, constants = forward_sweep(system), (0.0, 0.0, 0.0, *(-np.array(system.scene.gravity)))
    else:
        function, constants = _written(system, laws), ()
    kernel = cache(lambda: Kernel(function, batch=False))

    def otherwise(*arguments):
        """Convert or refuse what the machine code did not take."""
        if len(arguments) != 4:
            raise TypeError(f"forward_dynamics takes q, v, load and out, got {len(arguments)} arguments.")
        *given, out = arguments
        sizes = {"q": n_q, "v": n_v, "load": n_v}
        parts = [_vector(value, *size) for value, size in zip(given, sizes.items(), strict=True)]
        if not isinstance(out, np.ndarray) or out.dtype != float or out.shape != (n_v,) or not out.flags.writeable:
            raise StateError(f"out: expected a writeable array of {n_v} floats, got {out!r:.80}.")
        out[:] = kernel()(np.concatenate([*parts, constants]))
        return out

    return direct(function, Signature((n_q, n_v, n_v), n_v, constants), otherwise, "forward_dynamics", DOC)


def _written(system: System, laws: Laws):
    """Function (q, v, load) → q̈."""
    program, n_q, n_v = Program(system, laws), system.n_q, system.n_v
    t = program.rates.inputs[0]
    if t in program.rates.nodes:
        raise SimulationError(
            f"scene {system.scene.name!r}: a load depends on time, which forward_dynamics(q, v, load, out) is not told; "
            "use accelerations(state)."
        )
    return write(lambda q, v, load: program.accelerations(q, v, load), n_q, n_v, n_v, name="accelerations")


def _vector(value, name: str, size: int) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise StateError(f"{name}: expected {size} numbers, got {value!r:.80}.") from error
    if array.shape != (size,):
        raise StateError(f"{name}: expected {size} numbers, got shape {array.shape}.")
    return array
