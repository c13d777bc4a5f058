"""Inputs held between samples of a control law (zero-order hold): u(t) = law(t_k, q_k, v_k) for t_k ≤ t < t_k+1."""

import inspect
from collections.abc import Callable
from math import isfinite

import numpy as np

from gauss.arguments import LARGEST_FLOAT, real_numbers
from gauss.codegen import Scalar
from gauss.dynamics.inputs import driven_scene
from gauss.dynamics.scene_compilation import compile_scene
from gauss.errors import GaussError, SimulationError
from gauss.simulation.memory_limit import SHORTER, refuse_beyond_memory
from gauss.system import System

FLOAT = np.dtype(float)
SAMPLE_NUMBERS = 4  # in memory for each sample of the inputs
EQUAL_SAMPLES = 1e-9  # relative to the time from one sample to the next: closer times are one


class HeldInputs:
    """Inputs of one motion, from a start to an end [s], of a system whose scene has inputs.

    ``control`` is a law (t, q, v) → values (n_u,) of the inputs in the order of the scene, called once for each sample, or a
    table (k, n_u) of them. ``times`` (k,) are the samples [s], ``rate`` of them in a second [Hz], the first at the start;
    ``values`` those of the inputs so far, (n_u,) each. SimulationError if the scene has no inputs, or an argument is
    invalid.
    """

    def __init__(self, system: System, control, rate: float | None, start: float, end: float):
        self.system, self.names = system, tuple(system.scene.inputs)
        if not self.names:
            raise SimulationError(f"control: scene {system.scene.name!r} has no inputs; declare some with scene.input.")
        rate = rate.item() if isinstance(rate, np.number) else rate
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate <= LARGEST_FLOAT:
            raise SimulationError(f"rate: expected a positive number of samples in a second [Hz], got {rate!r}.")
        asked = (end - start) * rate
        refuse_beyond_memory(SAMPLE_NUMBERS * asked, f"rate: {rate:.3g} Hz are {asked:.2g} samples that", SHORTER)
        count = max(1, int(np.ceil((end - start) * rate - EQUAL_SAMPLES)))
        self.rate, self.times, self.end = float(rate), start + np.arange(count) / rate, end
        self.values: list[np.ndarray] = []
        self.law = _called(control) if callable(control) else self._tabulated(control)

    def _tabulated(self, control) -> Callable:
        """Law of a table."""
        table = real_numbers(control)
        if table is not None and table.ndim == 1 and len(self.names) == 1:
            table = table[:, None]
        count, n = len(self.times), len(self.names)
        if table is None or table.ndim != 2 or table.shape[1] != n or len(table) < count:
            raise SimulationError(
                f"control: expected a function of (t, q, v), or a table of {count} samples × {n} inputs "
                f"({', '.join(self.names)}), got {'shape ' + str(table.shape) if table is not None else repr(control)}."
            )
        return lambda t, q, v: table[len(self.values)]

    def at(self, k: int, t: Scalar, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Values (n_u,) of sample k; the law is called on the first request.

        SimulationError if the law raises an exception, or does not return a finite number for each input.
        """
        if k == len(self.values):
            try:
                value = self.law(t, q, v)
            except GaussError:
                raise
            except Exception as error:  # whatever it does
                raise SimulationError(f"control: at t = {t:.6g} s the law raised {type(error).__name__}: {error}") from error
            self.values.append(checked_inputs(value, self.names, t))
        return self.values[k]

    def hold_end(self, k: int) -> float:
        """Time at which sample k ends [s]."""
        return float(self.times[k + 1]) if k + 1 < len(self.times) else self.end

    def recorded(self) -> System:
        """System with drives by the values so far: that of the trajectory."""
        values, times = np.array(self.values).reshape(-1, len(self.names)), self.times[: len(self.values)]
        return driven_as(self.system, {name: RecordedInput(times, values[:, k]) for k, name in enumerate(self.names)})


class RecordedInput:
    """Piecewise constant law of time: each value holds from its time (k,) [s] on, the first one before, too."""

    def __init__(self, times: np.ndarray, values: np.ndarray):
        self.times, self.values = times, values

    def __call__(self, t) -> float:
        """Value at a time [s]."""
        k = int(np.searchsorted(self.times, float(t), side="right")) - 1
        return float(self.values[max(k, 0)]) if self.values.size else 0.0


def driven_as(system: System, laws: dict[str, Callable]) -> System:
    """System of the scene with drives for its inputs, whose laws are given by name."""
    return compile_scene(driven_scene(system.scene, laws))


def checked_inputs(value, names: tuple[str, ...], t: Scalar) -> np.ndarray:
    """Values (n_u,) of inputs as a control law returned them, or as they were given to a step.

    SimulationError if they are not a finite number for each input.
    """
    if type(value) is np.ndarray and value.dtype is FLOAT and value.shape == (len(names),):
        if isfinite(sum(value.tolist())):
            return value.copy()  # the usual case, quickly
    found = real_numbers(value)
    if found is None or found.size != len(names):
        expected = f"expected {len(names)} number(s) ({', '.join(names)})" if names else "the scene declares none"
        raise SimulationError(f"t = {t:.6g} s: the values of the inputs are {value!r}; {expected}.")
    found = found.reshape(-1)
    if not np.isfinite(found).all():
        k = int(np.flatnonzero(~np.isfinite(found))[0])
        raise SimulationError(f"t = {t:.6g} s: input {names[k]!r} is {found[k]}; expected a finite number.")
    return found


def numbers_in_words(numbers: np.ndarray | None) -> str:
    """What stands in place of finite numbers of a shape, for a message; None: no numbers."""
    if numbers is None:
        return "others"
    bad = np.argwhere(~np.isfinite(numbers))
    return f"shape {numbers.shape}" + (f" with {numbers[tuple(bad[0])]} in row {bad[0, 0]}" if bad.size else "")


def _called(law: Callable) -> Callable:
    """Law (t, q, v); SimulationError if it cannot be called with three arguments."""
    try:
        inspect.signature(law).bind(0.0, (), ())
    except TypeError:
        raise SimulationError(f"control: a law is called as law(t, q, v); {law!r} takes other arguments.") from None
    except ValueError:  # a builtin that hides its signature
        pass
    return law
