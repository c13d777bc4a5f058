"""Linear models of many states, one after the other, for systems whose loops are too many for one function of machine code.

Each is that of :func:`gauss.linearise`, in the same independent coordinates, whose derivatives are machine code.
"""

import numpy as np

from gauss.analysis.linear_model import LinearModel, linearise
from gauss.arguments import real_array
from gauss.dynamics.state_functions import RESIDUAL_TOLERANCE, distance_of_loops, refused_state
from gauss.errors import StateError

Matrices = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class LinearModelOfEach:
    """Function (q, v, load, out, t) → A, B, C, D of one system.

    Parameters
    ----------
    model : LinearModel
        Model about one state, whose names are those of all.
    independent : sequence of str
        Independent coordinates.
    """

    def __init__(self, model: LinearModel, independent: list[str]):
        self.model, self.independent = model, independent

    def __call__(self, q, v, load, out=None, t=0.0) -> Matrices:
        """Matrices about a state, or about each of a batch of states.

        Raises
        ------
        StateError
            If a state does not fit, is off the constraints, or the independent coordinates do not determine the others
            there.
        """
        given = [real_array(part, name) for name, part in (("q", q), ("v", v), ("load", load))]
        time = real_array(t, "t", "times [s]")
        shape = np.broadcast_shapes(*(part.shape[:-1] for part in given), time.shape)
        rows = [np.broadcast_to(part, (*shape, part.shape[-1])).reshape(-1, part.shape[-1]) for part in given]
        times = np.broadcast_to(time, shape).ravel()
        found = [self._about(*one) for one in zip(*rows, times, strict=True)]
        A, B, C, D = (
            np.array([one[k] for one in found]).reshape(*shape, *getattr(self.model, name).shape)
            for k, name in enumerate("ABCD")
        )
        return A, B, C, D

    def _about(self, q, v, load, t) -> Matrices:
        """Matrices about one state."""
        system, model = self.model.system, self.model
        state = system.state(q, v, t)
        if distance_of_loops(system, state) > RESIDUAL_TOLERANCE:
            raise StateError(refused_state(system, state, "linear model", ()))
        names = {"inputs": model.inputs, "outputs": output_names(model), "independent": self.independent}
        found = linearise(system, state, load=load, **names)
        if found.states != model.states:
            raise StateError(f"linear model: its states here are {found.states}, those of the prepared one {model.states}.")
        return found.A, found.B, found.C, found.D


def output_names(model: LinearModel) -> list[str]:
    """Names of the outputs of a model without their entries, "tip" of "tip[0]"."""
    coordinates = model.system.coordinates
    return list(dict.fromkeys(label if label in coordinates else label.partition("[")[0] for label in model.outputs))
