"""QP solvers as backends: the compulsion is handed to them as a quadratic programme, in a form that suits both."""

from dataclasses import replace

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.foreign import ForeignCode, call, real_array, truth, whole_number
from gauss.backends.forms import massless
from gauss.backends.programme import FORMS, Outcome, Programme, Solver, compressed, dense
from gauss.backends.solution import Answer, failure
from gauss.errors import BackendError, did_you_mean


class Programmed:
    """Backend that hands one form of the compulsion to a QP solver.

    Parameters
    ----------
    solver : Solver
        ``solver(programme)`` returns an :class:`Outcome`; it may keep a workspace from call to call.
    form : str, optional
        Form of the compulsion, see :data:`FORMS`; when not given "F2s", and "F3" where a body has no mass, which has no F2s.

    Raises
    ------
    BackendError
        If there is no such form.
    """

    def __init__(self, solver: Solver, form: str | None = None):
        if form is not None and form not in FORMS:
            raise BackendError(f"no form {form!r} of a compulsion. {did_you_mean(form, FORMS)}")
        self.name, self.solver, self.form = solver.name, solver, form

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        fitting = "F3" if massless(compulsion) else "F2s"
        programme = FORMS[self.form or fitting](compulsion, dense if getattr(self.solver, "dense", False) else compressed)
        if not programme.d.size and not programme.k.size and programme.form in ("F2", "F2s"):
            free = -programme.c / programme.H.diagonal()  # no rows bind the bodies
            return programme.answer(free, np.zeros(0), np.zeros(0))
        outcome = self._solved(programme.with_rows_of_unit_length())
        z = outcome.z if outcome.z is None or not programme.k.size else outcome.z / programme.lengths
        return read(compulsion, programme, replace(outcome, z=z))

    def _solved(self, programme: Programme) -> Outcome:
        """Outcome of the programme with its numbers scaled to about one, as absolute tolerances of solvers want."""
        size = programme.size
        return attempt(self.solver, programme.divided(size)).times(size)


def attempt(solver: Solver, programme: Programme) -> Outcome:
    """Outcome of a QP solver; whatever it raises or wrongly returns becomes the message of a failed one."""
    try:
        with ForeignCode():
            said = solver(programme)
        return checked_outcome(said, programme)
    except BackendError as error:
        return Outcome(None, None, None, False, f"{solver.name}: {error}")


def checked_outcome(said, programme: Programme) -> Outcome:
    """Outcome with vectors of the sizes of its programme.

    BackendError if it is no outcome, or holds other things than real numbers of these shapes, a claim and a number of
    iterations.
    """
    if not isinstance(said, Outcome):
        raise BackendError(f"failed: it returned a {type(said).__name__}, expected a gauss.backends.programme.Outcome.")
    sizes = {"x": programme.c.size, "y": programme.d.size, "z": programme.k.size}
    given = {name: getattr(said, name) for name in sizes}
    arrays = {name: None if part is None else real_array(name, part, sizes[name]) for name, part in given.items()}
    return Outcome(
        **arrays, found=truth(said.found), message=call(str, said.message), iterations=whole_number(said.iterations)
    )


def read(compulsion: Compulsion, programme: Programme, outcome: Outcome) -> Answer:
    """Answer of the compulsion from the outcome of its programme."""
    if outcome.x is None:
        return failure(compulsion, outcome.message, outcome.iterations)
    y = np.zeros(programme.d.size) if outcome.y is None else outcome.y
    z = np.zeros(programme.k.size) if outcome.z is None else outcome.z
    return programme.answer(outcome.x, y, z, found=outcome.found, message=outcome.message, iterations=outcome.iterations)
