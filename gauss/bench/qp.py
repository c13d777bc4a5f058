"""``gauss bench qp``: every backend on every instance, in every form, at every level."""

import hashlib
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

from tqdm import tqdm

from gauss.backends.programme import FORMS as PROGRAMMES
from gauss.bench import compiled
from gauss.bench.clocks import BUDGET, COMPILING, FEWEST, ROUNDS, WALL_PER_CPU
from gauss.bench.contestants import everyone, imported, source_of, suits
from gauss.bench.instances import Instance, of_selection
from gauss.bench.levels import AUTO, LEVELS, LIMIT, OURS, OWN, promise, settings
from gauss.bench.machine import header, libraries, write_lock
from gauss.bench.measure import FIGURES, TERM_ROUNDING_RELATIVE, forms_of, measure, unanswered
from gauss.bench.problems import SELECTION, make_problem
from gauss.bench.suite import VERSION
from gauss.bench.table import ResultTable, chosen
from gauss.bench.worker import Reply, Workers
from gauss.errors import BackendError

NAME = "qp"  # of the table of the selection
LOCK, CLASS_LOCK = "qp.lock", "qp_classes.lock"  # beside it, and beside tables of classes
KEYS = ("problem", "form", "backend", "level")
DIGITS = 12  # of digests in tables
CONTENT = ("data", "settings")  # digests of the numbers of a problem, and of how a solver is set, measured and judged
VALUES = ("group", "verdict", "outcome", *FIGURES, "claimed", "certified", "iterations", "reason", *CONTENT)
FORMS = ("F2", "F2s")
QUICK = (
    "ur5",
    "talos",
    "four-bar",
    "stewart",
    "light tip 1e-9",
    "noisy copies",
    "three stops",
    "box on 8 points",
)  # problems
# Limits [s] of the wall time of a cell, whose CPU time is limited before, and of compilation.
CELL_TIME, COMPILATION_TIME = 60.0, 100.0
PACKAGES = tuple(
    "numpy scipy qpsolvers casadi clarabel cvxopt daqp ecos highspy osqp kvxopt piqp proxsuite pyqpmad qpalm qpax "
    "jax jaxlib jaxopt qtqp quadprog scs sip-qp-python mujoco".split()
)


def quick_backends() -> list[str]:
    """Backends of a quick comparison and of classes of the suite: those that do not compile for every size of problem."""
    return [name for name in (*OURS, *everyone()) if name not in COMPILING]


def compare(
    folder: Path,
    *,
    backends: Iterable[str] | None = None,
    problems: Iterable[str] | None = None,
    forms: Iterable[str] = FORMS,
    levels: Iterable[str] | None = None,
    instances: Iterable[Instance] | None = None,
    name: str = NAME,
    workers: Workers | None = None,
    solvers: Iterable[str] = (),
    fresh: bool = False,
    progress: bool = True,
) -> ResultTable:
    """Measure all cells that are not measured yet, and return the table.

    BackendError if there is no such backend, problem, form, level or solver, or two problems have the same name.

    Parameters
    ----------
    folder : Path
        Where the table is, or shall be; the versions of all packages are written to ``qp.lock`` beside it, or
        ``qp_classes.lock`` where the table has another name.
    backends, problems, forms, levels : sequence of str, optional
        What is measured; all that there are when not given.
    instances : iterable of Instance, optional
        What is measured instead of the selection of problems.
    name : str
        Name of the table, without ".csv".
    workers : Workers, optional
        Processes to call solvers in, which go on to live; new ones that end when not given.
    solvers : sequence of str
        Solvers of one's own, each "module:Class", measured beside the backends.
    fresh : bool
        Measure again what has been measured.
    progress : bool
        Show a bar.
    """
    solvers = tuple(solvers)
    for solver in solvers:
        imported(solver)
    names = (*chosen(backends, (*OURS, *everyone()), "backend"), *solvers)
    problems = chosen(problems, SELECTION, "problem")
    levels, forms = chosen(levels, LEVELS, "level"), chosen(forms, PROGRAMMES, "form")
    conditions = [*header(*PACKAGES), libraries(), f"problems: suite {VERSION} of gauss"]
    table = ResultTable(Path(folder) / f"{name}.csv", conditions, KEYS, VALUES, fresh)
    write_lock(Path(folder) / (LOCK if name == NAME else CLASS_LOCK))
    given = of_selection(problems) if instances is None else instances
    count = len(problems) if instances is None else None
    with nullcontext(workers) if workers else Workers() as places:
        named: set[str] = set()
        for instance in tqdm(given, total=count, unit="problem", disable=not progress, desc="bench qp"):
            if instance.name in named:
                raise BackendError(f"two problems have the name {instance.name!r}; the table tells them apart by it.")
            named.add(instance.name)
            for cell in _cells(instance, names, forms, levels):
                _measure(table, instance, cell, places)
            if instances is None:
                _add_compiled(table, instance)
    return table


def _measure(table: ResultTable, instance: Instance, cell: tuple[str, str, str], places: Workers):
    """Measure a cell that is not measured yet; methods of gauss share a worker, a foreign solver may kill its own."""
    backend, form, level = cell
    key = _key(instance, *cell)
    content = {"data": instance.data[:DIGITS], "settings": digest(backend, level)}
    if table.has(**key, **content):
        return
    place = "gauss" if backend in OURS else backend
    timeout = CELL_TIME + (COMPILATION_TIME if backend in COMPILING else 0.0)
    row = _row(places[place].call(measure, instance, backend, form, level, timeout=timeout))
    table.add(key | {"group": instance.group, "verdict": instance.verdict} | row | content)


def digest(backend: str, level: str) -> str:
    """Digest of what a row hinges on beside its problem: settings and promise of a solver, its own source, the clocks."""
    given = {} if level == OWN else settings(backend, level) | promise(backend, level)._asdict()
    source = source_of(backend) if ":" in backend else b""
    clock = LIMIT, ROUNDS, FEWEST, BUDGET, WALL_PER_CPU, TERM_ROUNDING_RELATIVE
    return hashlib.sha256(repr((sorted(given.items()), clock)).encode() + source).hexdigest()[:DIGITS]


def _key(instance: Instance, backend: str, form: str, level: str) -> dict[str, str]:
    """Columns that name the row of a cell."""
    return {"problem": instance.name, "form": form, "backend": backend, "level": level}


def _cells(instance: Instance, backends, forms, levels) -> list[tuple[str, str, str]]:
    """Backends with the forms and levels in which they are measured; those that take no such instance are left out."""
    found = []
    for backend in backends:
        ours = backend in OURS
        if ours and (instance.compulsion is None or (backend != AUTO and instance.compulsion.h.size)):
            continue
        if not ours and not suits(backend, instance):
            continue
        asked = (OWN,) if ours else levels
        found += [(backend, form, level) for form in forms_of(backend, instance, forms) for level in asked]
    return found


def _add_compiled(table: ResultTable, instance: Instance):
    """Measure the compiled dynamics of a problem with a reference, if it is that of a system and not measured yet."""
    key = _key(instance, compiled.NAME, OWN, OWN)
    content = {"data": instance.data[:DIGITS], "settings": digest(compiled.NAME, OWN)}
    if instance.expected is None or table.has(**key, **content):
        return
    row = compiled.compiled(make_problem(instance.name), instance.expected)
    if row is not None:
        table.add(key | {"group": instance.group, "verdict": instance.verdict} | row | content)


def _row(reply: Reply) -> dict:
    """Measurement of a worker, or the outcome of its call."""
    if reply.outcome == "answered":
        return reply.value
    return unanswered() | {"outcome": "refused" if reply.outcome == "raised" else reply.outcome, "reason": reply.reason}
