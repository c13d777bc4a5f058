"""Commands ``gauss bench``, ``gauss chart`` and ``gauss problems``: parse arguments, call three functions."""

import os
import sys
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import Root, SceneName, group, load
from gauss.codegen.tiers import OPTIMISED, VARIABLE
from gauss.errors import FileError

bench = group(help="Compare backends, and see where methods fail.")
problems = group(help="The quadratic programmes of mechanisms, for other solvers.")

Folder = Annotated[Path, typer.Option(help="Folder of the tables, the report and the charts.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Measure again what the tables in the folder already have.")]


@bench.callback()
def _in_steady_state():
    # the help of the group stays that of its Typer
    os.environ.setdefault(VARIABLE, OPTIMISED)


@bench.command()
def qp(
    output: Folder = Path("bench"),
    backend: Annotated[list[str] | None, typer.Option(help="This backend; may be repeated; all if not given.")] = None,
    problem: Annotated[
        list[str] | None, typer.Option(help="This problem (see `gauss problems list`); may be repeated; all if not given.")
    ] = None,
    form: Annotated[
        list[str] | None,
        typer.Option(help="This form, F1, F2, F2s or F3; may be repeated. If not given, F2 and F2s; for classes, F2s."),
    ] = None,
    level: Annotated[
        list[str] | None,
        typer.Option(
            help="This accuracy: low, mid, high or tightest; may be repeated. If not given, all; for classes, high, and low "
            "and mid of eight problems each."
        ),
    ] = None,
    group: Annotated[
        list[str] | None,
        typer.Option(
            "--class",
            help="A class of problems (see `gauss problems classes`), equality, inequality, inconsistent or friction, which "
            "is cones and coulomb: a table and a report of its own; may be repeated.",
        ),
    ] = None,
    solver: Annotated[
        list[str] | None, typer.Option(help="A solver of yours, module:Class, importable from here; may be repeated.")
    ] = None,
    scene: Annotated[
        list[str] | None, typer.Option(help="Instants of the motion of this scene instead of the problems; may be repeated.")
    ] = None,
    problems: Annotated[
        list[Path] | None,
        typer.Option(
            help="The files in this folder instead: .npz, .mat (P, q, A, l, u), .mps, .hdf5 (FCLIB); may be repeated."
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Eight problems, or eight of each class, in form F2s at one level, without solvers on JAX: two minutes.",
        ),
    ] = False,
    motions: Annotated[bool, typer.Option(help="Also measure kept workspaces and warm starts along motions.")] = True,
    fresh: Fresh = False,
):
    """Compare QP backends and gauss's own methods: time, error, residuals, claims. Goes on where it was interrupted."""
    from gauss.bench.publish import publish
    from gauss.bench.qp import FORMS, QUICK, compare
    from gauss.bench.reuse import compare_reuse

    given, usual = _instances(scene, problems), list(QUICK) if quick else None
    chosen = _selection(backend, form, level, solver, quick) | {"fresh": fresh}
    if group:
        _compare_classes(output, group, problems=problem, quick=quick, **chosen)
        if given is None:
            return
    forms = chosen.pop("forms") or FORMS
    table = compare(output, problems=problem or usual, instances=given, forms=forms, **chosen)
    along = motions and given is None and not quick
    again = compare_reuse(output, fresh=fresh).path if along else None
    _report(table, publish(output, table.path, again))


def _selection(backend, form, level, solver, quick: bool) -> dict:
    """Backends, forms, levels and solvers of the user, with the usual ones where there are none."""
    from gauss.bench.instances import MAIN_FORM
    from gauss.bench.levels import MAIN_LEVEL
    from gauss.bench.qp import quick_backends

    if solver:
        _import_from_here()
    forms, levels = ([MAIN_FORM], [MAIN_LEVEL]) if quick else (None, None)
    return {
        "backends": backend or (quick_backends() if quick else None),
        "forms": form or forms,
        "levels": level or levels,
        "solvers": solver or [],
    }


def _import_from_here():
    """Let modules of the working folder be imported."""
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.insert(0, here)


def _compare_classes(output: Path, kinds: list[str], **how):
    """Tables and pages of classes, whose solvers stay in the same processes."""
    from gauss.bench.classes import classes_named, compare_class
    from gauss.bench.publish import publish_class
    from gauss.bench.worker import Workers

    with Workers() as workers:
        for kind in classes_named(kinds):
            table = compare_class(output, kind, workers=workers, **how)
            _report(table, publish_class(output, kind, table.path))


def _instances(scenes: list[str] | None, folders: list[Path] | None):
    """Instances of scenes and folders; None where the selection is asked for."""
    from gauss.bench.folders import of_folder
    from gauss.bench.instances import of_scene

    if not (scenes or folders):
        return None
    makers = [of_scene(gauss.load(name), name) for name in scenes or ()] + [of_folder(folder) for folder in folders or ()]
    return chain.from_iterable(makers)


@bench.command()
def stability(
    output: Folder = Path("bench"),
    case: Annotated[list[str] | None, typer.Option(help="This case; may be repeated; all if not given.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="This method; may be repeated; all if not given.")] = None,
    fresh: Fresh = False,
):
    """See where methods fail, and whether they say so: cases by methods. Goes on where it was interrupted."""
    from gauss.bench.atlas.run import explore, publish

    table = explore(output, cases=case, methods=method, fresh=fresh)
    _report(table, publish(output, table.path))


@bench.command()
def fuzz(
    output: Folder = Path("bench"),
    count: Annotated[int, typer.Option(help="Random problems.", min=1)] = 10_000,
    seed: Annotated[int, typer.Option(help="Another seed, other problems.", min=0)] = 0,
    backend: Annotated[list[str] | None, typer.Option(help="This backend; may be repeated; all if not given.")] = None,
    share: Annotated[
        int, typer.Option(help="QP solvers get one block of problems out of so many; 0 leaves them out, 1 is all.", min=0)
    ] = 20,
    fresh: Fresh = False,
):
    """Solve random problems with every backend: is an answer ever worse than its certificate says? Goes on where it was."""
    from gauss.bench.fuzz import run as examination

    table = examination.fuzz(output, count=count, seed=seed, backends=backend, share=share, fresh=fresh)
    _report(table, examination.publish(output, table.path))


@bench.command()
def fuzz_motions(
    output: Folder = Path("bench"),
    count: Annotated[int, typer.Option(help="Random scenes.", min=1)] = 10_000,
    seed: Annotated[int, typer.Option(help="Another seed, other scenes.", min=0)] = 0,
    first: Annotated[int, typer.Option(help="Number of the first scene.", min=0)] = 0,
    fresh: Fresh = False,
):
    """Move random scenes by independent routes: do they agree, and are differences reported? Goes on where it was."""
    from gauss.bench.fuzz import motions

    table = motions.fuzz_motions(output, count=count, seed=seed, first=first, fresh=fresh)
    _report(table, motions.publish(output, table.path))


@bench.command()
def motion(
    output: Folder = Path("bench"),
    backend: Annotated[list[str] | None, typer.Option(help="This backend; may be repeated; all if not given.")] = None,
    scene: Annotated[list[str] | None, typer.Option(help="This scene; may be repeated; all if not given.")] = None,
    fresh: Fresh = False,
):
    """See what the tolerance of a backend does to ten seconds of motion. Goes on where it was interrupted."""
    from gauss.bench.motion import compare_motions, publish

    table = compare_motions(output, backends=backend, scenes=scene, fresh=fresh)
    _report(table, publish(output, table.path))


def _report(table, written):
    """Print the files that were written."""
    typer.echo(f"{len(table.rows)} rows in {table.path}")
    for path in written:
        typer.echo(f"written: {path}")


def chart(
    scene: SceneName,
    duration: Annotated[float, typer.Option(help="How long the scene moves [s].")] = 2.0,
    integrator: Annotated[
        list[str] | None,
        typer.Option(help="This integrator (see `gauss run --help`); may be repeated; the usual ones if not given."),
    ] = None,
    backend: Annotated[
        list[str] | None,
        typer.Option(help="A curve with this backend for the first of the integrators, or each given; may be repeated."),
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            "--patience",
            help="Settings get finer until one run takes this long [s]; at least three settings with each backend.",
        ),
    ] = 0.5,
    output: Annotated[Path, typer.Option(help="The figure (.png, .svg, .pdf).")] = Path("chart.png"),
    root: Root = "fixed",
):
    """Chart what a digit costs: error against wall time of integrators and backends, beside a reference made on the fly."""
    from gauss.bench.precision import attempts, described, front, reference
    from gauss.view.precision import plot_precision, refusals
    from gauss.view.style import check_format

    check_format(output)  # before minutes are spent

    found = load(scene, root)
    if not isinstance(found, gauss.Scene):
        raise FileError(f"{scene}: a scene with servos is moved by gauss.servo, which this chart does not know.")
    system = gauss.compile_scene(found)
    against = reference(system, duration)
    typer.echo(f"reference: {against.source}")
    done = []
    for one in attempts(system, duration, against, integrator, time_limit, backend):
        done.append(one)
        if not one.reason:
            typer.echo(f"  {one.method:20} {described(one):16}  error {one.error:.1e} m, {1e3 * one.seconds:.3g} ms")
    if refused := refusals(done):
        typer.echo("No result:")
    for reason, methods in refused.items():
        typer.echo(f"  {', '.join(methods)}: {reason}")
    typer.echo("Pareto front:")
    for one in front(done):
        error = f"{one.error:.1e} m" if one.error else "the reference to the last bit"
        typer.echo(f"  {error} in {1e3 * one.seconds:.3g} ms by {one.method}, {described(one)}")
    name = found.name or scene
    title, note = f"What a digit costs: {name}, {duration:g} s", f"reference: {against.source}"
    plot_precision({name: done}, output, title, note, {name: against.uncertainty})
    typer.echo(f"figure written to {output}")


@problems.command("list")
def list_problems():
    """List the problems that `gauss bench qp` solves."""
    from gauss.bench.problems import SELECTION

    width = max(len(name) for name in SELECTION)
    for name, entry in SELECTION.items():
        typer.echo(f"{name:{width}}  {entry.note}")


@problems.command("export")
def export_problems(
    scene: Annotated[
        str | None, typer.Argument(help="A scene, as for `gauss run`; the selection of problems if not given.")
    ] = None,
    format: Annotated[str, typer.Option(help="npz (qpsolvers), mat (Maros–Mészáros), or qpbenchmark.")] = "npz",
    form: Annotated[str, typer.Option(help="F1 (a, q̈), F2 (a), F2s (a, scaled), F3 (q̈).")] = "F2",
    output: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("problems"),
    duration: Annotated[float, typer.Option(help="How long the scene moves [s].")] = 1.0,
    instants: Annotated[int, typer.Option(help="Equally spaced instants of the motion.", min=1)] = 11,
    inequalities: Annotated[bool, typer.Option(help="With the rows of contacts and stops that touch.")] = True,
):
    """Write quadratic programmes of a motion, or of the selection, for other solvers."""
    from gauss.bench.export import along, export, without_inequalities
    from gauss.bench.problems import SELECTION
    from gauss.io import load

    found = [entry.make() for entry in SELECTION.values()] if scene is None else along(load(scene), duration, instants)
    if not inequalities:
        found = [without_inequalities(problem) for problem in found]
    paths = export(found, output, format, form)
    typer.echo(f"{len(found)} problems in form {form}: {len(paths)} files in {output}")


@problems.command("suite")
def export_suite_of_problems(
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--class", help="This class (see `gauss problems classes`); may be repeated; all but large if not given."
        ),
    ] = None,
    name: Annotated[list[str] | None, typer.Option(help="This instance; may be repeated; all if not given.")] = None,
    format: Annotated[str, typer.Option(help="npz (sparse), mat, qps, fclib, or qpbenchmark.")] = "npz",
    output: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("suite"),
):
    """Write classes of problems with references, active sets, units and stories, and a manifest with checksums."""
    from gauss.bench.suite.catalogue import made
    from gauss.bench.suite.files import export_suite

    paths = export_suite(made(kind, name), output, format)
    typer.echo(f"{len(paths)} files in {output}, checksums in {paths[-1]}")


@problems.command("classes")
def list_classes():
    """List the classes of problems that `gauss problems suite` writes, and how many instances each has."""
    from gauss.bench.suite.catalogue import CLASSES, recipes

    for kind, story in CLASSES.items():
        typer.echo(f"{kind:12} {len(recipes(kind)):3d}  {story}")
