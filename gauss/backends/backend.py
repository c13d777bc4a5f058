"""Protocol of a backend: compulsion → answer. Any object of this form is one."""

from typing import Protocol, runtime_checkable

from gauss.backends.compulsion import Compulsion
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.solution import Answer

# Methods of our own, for equality rows: name, which is also that of the file, and class. Files are imported when their
# method is first asked for: scipy takes long. QP solvers join by name in :func:`gauss.backends.registry.make`.
BACKENDS = {
    "recursion": "Recursion",
    "kkt": "KKT",
    "schur": "Schur",
    "nullspace": "NullSpace",
    "pinv": "Pinv",
    "sparse": "Sparse",
    "gradient": "Gradient",
    "proximal": "Proximal",
    "svd": "SVD",
}


@runtime_checkable
class Backend(Protocol):
    """A method: called with a compulsion, it answers. It may keep a workspace from call to call.

    Any object of this form can be given wherever a backend is named, also a class that makes one without arguments.
    Exceptions that it raises, and arrays of other shapes, become the reason of a status; accelerations and multipliers are
    certified. A QP solver is wrapped by :class:`gauss.backends.programmed.Programmed`, and then gets matrices.

    Attributes
    ----------
    name : str
        Its name in results and messages; not that of a method of gauss.

    Examples
    --------
    >>> class Dense:
    ...     name = "dense"
    ...
    ...     def __call__(self, compulsion):
    ...         rows, n = np.hstack([compulsion.A, compulsion.B]), compulsion.Phi.size
    ...         inertia = np.diag(np.append(compulsion.Phi, np.zeros(compulsion.P.size)))
    ...         K = np.block([[inertia, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    ...         x = np.linalg.solve(K, np.concatenate([compulsion.impressed, compulsion.P, compulsion.D]))
    ...         return Answer(x[:n], x[n : -len(rows)], x[-len(rows) :], np.zeros(0))
    >>> gauss.simulate(scene, 1.0, backend=Dense)
    """

    name: str

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""


@runtime_checkable
class Factored(Backend, Protocol):
    """A method that answers with a given factorisation: that of the certificate, which then is made once."""

    def solve_with(self, factor: KKTFactor) -> tuple[Answer, Correction]:
        """Answer, and the correction that the last step of its refinement left."""
