"""Compiled assembly of the compulsion: a microsecond instead of a millisecond by numpy."""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.codegen import trace
from gauss.dynamics.assemble import assemble_motion, checked_load, units
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SceneError
from gauss.system import State, System


class Assembler:
    """Compulsions of one system, assembled by a kernel traced from :func:`gauss.assemble`.

    TypeError if a law cannot be traced.
    SceneError if there are unilateral constraints, which have no fixed rows.

    Parameters
    ----------
    system : System
        The system; the laws of its loads must be written with :mod:`gauss.math`.

    Attributes
    ----------
    power : ndarray, shape (3,)
        Power of drives, of forces on bodies, and lost in dampers at the last state [W].
    """

    def __init__(self, system: System):
        if system.contacts.placed or system.set_valued.placed or system.losses:
            raise SceneError(
                "unilateral constraints, set-valued elements and losses have no fixed rows; they are solved state by state."
            )
        self.system, self.power = system, np.zeros(3)

        def flat(t, q, v):
            motion = kinematics(system, State(t[0], q, v))
            applied = Applied(motion)
            compulsion = assemble_motion(motion, applied)
            self._shapes = [[block.shape for block in blocks] for blocks in _blocks(compulsion)]
            entries = [block.ravel() for blocks in _blocks(compulsion) for block in blocks]
            power = [applied.driven, applied.loaded, applied.dissipated]
            vectors = compulsion.impressed, compulsion.P, compulsion.C, compulsion.D
            return *vectors, [compulsion.constraint_residual], power, np.concatenate(entries)

        self.kernel = trace(flat, 1, system.n_q, system.n_v, batch=False)
        n_rows = system.structure.n_rows
        self._ends = np.cumsum([system.Phi.size, system.n_v, n_rows, n_rows, 1, 3])

    def __call__(self, state: State, load=None) -> Compulsion:
        """Compulsion in a state; see :func:`gauss.assemble`."""
        system = self.system
        numbers = self.kernel(np.concatenate([[state.t], state.q, state.v]))
        impressed, P, C, D, (gap,), self.power, entries = np.split(numbers, self._ends)
        blocks, place = [], 0
        for shapes in self._shapes:
            row = []
            for shape in shapes:
                size = shape[0] * shape[1]
                row.append(entries[place : place + size].reshape(shape))
                place += size
            blocks.append(tuple(row))
        count = len(system.structure.constraints)
        none = np.zeros((0, system.Phi.size + system.n_v))
        A, B = tuple(blocks[:count]), tuple(blocks[count:])
        P = P + checked_load(system, load)
        return Compulsion(
            system.structure, system.Phi, impressed, P, A, B, C, D, none, np.zeros(0), float(gap), units(system)
        )


def _blocks(compulsion: Compulsion):
    return *compulsion.A_blocks, *compulsion.B_blocks
