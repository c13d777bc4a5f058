"""Gauss problems as files that others read: arrays of numpy, of Matlab, and a test set of qpbenchmark."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.programme import FORMS, Programme
from gauss.bench.problems import MechanismProblem
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.errors import FileError, did_you_mean, writing
from gauss.simulation import simulate

TEST_SET = '''"""Quadratic programmes of mechanisms as a test set of qpbenchmark.

qpbenchmark --results-path results.csv gauss_problems.py run --author NAME
"""

from pathlib import Path

from qpbenchmark import Problem, TestSet


class GaussProblems(TestSet):
    """The problems in the .npz files beside this file."""

    @property
    def title(self) -> str:
        """Title of the report."""
        return "Gauss problems"

    @property
    def description(self) -> str:
        """What the problems are."""
        return "Accelerations of mechanisms as least compulsion under their constraints."

    @property
    def sparse_only(self) -> bool:
        """Whether only sparse solvers are asked."""
        return False

    def __iter__(self):
        """Yield the problems by name."""
        for file in sorted(Path(__file__).parent.glob("*.npz")):
            yield Problem.load(str(file))
'''


def along(scene, duration: float, instants: int, backend: str = "auto") -> list[MechanismProblem]:
    """Problems at equally spaced times of the motion of a scene."""
    system = compile_scene(scene)
    times = np.linspace(0.0, duration, instants)
    motion = simulate(system, duration, times=times, backend=backend)
    found = []
    for i, t in enumerate(motion.t):
        compulsion = assemble(system, motion.state(i))
        found.append(
            MechanismProblem(f"{scene.name} {i:03d}", f"{scene.name} at t = {t:.6g} s", compulsion, system, motion.state(i))
        )
    return found


def without_inequalities(problem: MechanismProblem) -> MechanismProblem:
    """The same problem without its one-sided rows."""
    compulsion = problem.compulsion
    bare: Compulsion = replace(compulsion, G=compulsion.G[:0], h=compulsion.h[:0])
    return replace(problem, compulsion=bare)


def export(problems: Iterable[MechanismProblem], folder: Path, kind: str, form: str = "F2") -> list[Path]:
    """Write problems and return the files.

    Parameters
    ----------
    problems : iterable of MechanismProblem
        Problems to write, one file each, named after it.
    folder : Path
        Folder of the files, made where there is none.
    kind : str
        * "npz": P, q, G, h, A, b, lb, ub, as ``qpsolvers.Problem.load`` reads them;
        * "mat": P, q, r, A, l, u, as the Maros–Mészáros problems are distributed for OSQP;
        * "qpbenchmark": "npz", and the module of a test set beside them.
    form : str
        "F1" full, "F2" without q̈, "F2s" that scaled, "F3" q̈ alone.

    Raises
    ------
    FileError
        If there is no such kind or form, or two problems have the same file name.
    """
    writers = {"npz": _write_npz, "mat": _write_mat, "qpbenchmark": _write_npz}
    if kind not in writers:
        raise FileError(f"no format {kind!r} of problems. {did_you_mean(kind, writers)}")
    if form not in FORMS:
        raise FileError(f"no form {form!r} of problems. {did_you_mean(form, FORMS)}")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    for problem in problems:
        path = folder / f"{file_name(problem.name)}.{'mat' if kind == 'mat' else 'npz'}"
        if path in paths:
            raise FileError(f"{path}: two problems have this file name.")
        writers[kind](path, FORMS[form](problem.compulsion))
        paths.append(path)
    if kind == "qpbenchmark":
        paths.append(folder / "gauss_problems.py")
        paths[-1].write_text(TEST_SET, encoding="utf-8")
    return paths


def file_name(name: str) -> str:
    """Name of a problem as part of a path."""
    return "".join(c if c.isalnum() or c in "-." else "_" for c in name)


def _write_npz(path: Path, programme: Programme):
    none = np.array(None)  # how qpsolvers writes what is not there
    rows = {"A": programme.C.toarray(), "b": programme.d} if programme.d.size else {"A": none, "b": none}
    rows |= {"G": programme.K.toarray(), "h": programme.k} if programme.k.size else {"G": none, "h": none}
    np.savez_compressed(path, P=programme.H.toarray(), q=programme.c, **rows, lb=none, ub=none)


def _write_mat(path: Path, programme: Programme):
    from scipy import io, sparse

    rows = sparse.vstack([programme.C, programme.K], format="csc")
    lower = np.concatenate([programme.d, np.full(programme.k.size, -np.inf)])
    upper = np.concatenate([programme.d, programme.k])
    sizes = {"m": float(rows.shape[0]), "n": float(rows.shape[1])}
    matrices = {"P": programme.H, "q": programme.c, "r": 0.0, "A": rows, "l": lower, "u": upper}
    io.savemat(path, matrices | sizes, do_compression=True, oned_as="column")
