"""What machine code calls for the forces of opaque laws, and functions within which it does."""

import ctypes
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from gauss.codegen import CallingKernel, Kernel, Receiver
from gauss.codegen.kernels import address
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.outputs import output_function
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_system import Program
from gauss.system import State, System

T = TypeVar("T")
NUMBER = 8  # bytes


class LoadReceiver(Receiver):
    """Loads with opaque laws as machine code calls them: (t, q, v) → (generalised forces (n_v,), power (3,))."""

    def __init__(self, forces: LoadForces):
        self.forces, self.n_q, self.n_in, self.size = forces, forces.n_q, forces.n_in, NUMBER * forces.n_in

    def __call__(self, given: int, found: int):
        """Evaluate the loads of a state."""
        if self.forces.is_of_time:
            self.forces.write_of_time(given, found)
            return
        numbers = self.forces.room()  # new, for a law may keep it
        place = address(numbers)
        ctypes.memmove(place, given, self.size)
        state = State(numbers.item(0), numbers[1 : self.n_q], numbers[self.n_q : self.n_in])
        self.forces.write(state, numbers, place, found)


def received(function: Callable[..., T], receiver: LoadReceiver) -> Callable[..., T]:
    """Function within which machine code calls opaque laws."""

    def receiving(*given):
        with receiver:
            return function(*given)

    return receiving


def output_kernel(program: Program, system: System, of_step: bool, batch: bool) -> Callable[[np.ndarray], np.ndarray]:
    """Machine code of points → values of all outputs, within which it calls opaque laws where there are some.

    ``program``: functions of the system; a :class:`gauss.dynamics.programs.CalledProgram` if it has opaque laws. ``system``:
    system whose scene has the outputs; the program may be that of its smooth part. ``of_step``: as of
    :func:`gauss.dynamics.outputs.output_function`. ``batch``: whether many points will be given at once.
    """
    called = program.laws.called
    kind = CallingKernel if called else Kernel
    names = tuple(bound.load.name for bound in called)
    key = output_kernel, program.drift, program.laws.key, names, program.inputs, program.layout.size
    make = lambda: kind(output_function(program, system.scene, of_step), batch=batch and not called)  # noqa: E731
    kernel = cached_on_disk(program.system, (*key, of_step, batch), make, system)
    return received(kernel, LoadReceiver(LoadForces(program.system, called))) if called else kernel
