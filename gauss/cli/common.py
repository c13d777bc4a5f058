"""Arguments, loading, figures and conclusions of several commands."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import gauss
from gauss.errors import FileError, did_you_mean

SceneName = Annotated[
    str,
    typer.Argument(
        help="A scene file (.toml), a robot (.urdf), MJCF (.xml), the name of a shipped model (see `gauss models`), "
        "or robot:NAME for a robot of the package example-robot-data, e.g. robot:panda.",
        show_default=False,
    ),
]
Root = Annotated[str, typer.Option(help="How the base of a robot stands: fixed or free.")]
READS: dict[str, dict[str, object]] = {
    "limits": {"limits": "start"},
    "stops": {"limits": "stops"},
    "resistance": {"resistance": True},
    "collisions": {"collisions": True},
    "motors": {"motors": True},
    "contacts": {"contacts": True},
    "inertia": {"inertia": "as given"},
}
Read = Annotated[
    list[str] | None,
    typer.Option(help=f"What else is read of a URDF or MJCF file: {', '.join(READS)}; may be repeated."),
]
Backend = Annotated[str, typer.Option(help="How accelerations are solved: auto, recursion, kkt, schur, osqp, clarabel, …")]
Atol = Annotated[
    list[str] | None,
    typer.Option(
        help="Absolute local error [rad, m, rad/s, m/s]: a number, or NAME=NUMBER for angle, length or a joint; "
        "COORDINATES,RATES instead of a number for two, e.g. wrist=1e-8,1e-6; may be repeated."
    ),
]
LONGEST_SUMMARY = 1000  # characters of a command's summary: none is cut
Seed = Annotated[int, typer.Option(help="Seed of the random states.")]


class CommandGroup(TyperGroup):
    """Group of commands whose help lists each with the whole first sentence, not with what fits one line."""

    def format_commands(self, ctx, formatter):
        """Write names and summaries of the commands."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl([(name, found.get_short_help_str(LONGEST_SUMMARY)) for name, found in commands if found])


def group(**settings: Any) -> typer.Typer:
    """Typer of a group of commands; plain help: panels would cost the import of rich, and read [rad] as markup."""
    return typer.Typer(
        cls=CommandGroup,
        no_args_is_help=True,
        rich_markup_mode=None,
        context_settings={"max_content_width": 100},
        **settings,
    )


def load(scene: str, root: str, read: list[str] | None = None):
    """Scene or servo; how its base stands, and what else is read, is asked of robots only."""
    options: dict[str, Any] = {} if root == "fixed" else {"root": root}
    for what in read or ():
        if what not in READS:
            raise FileError(f"--read: no {what!r}. {did_you_mean(what, READS)}")
        options |= READS[what]
    return gauss.load(scene, **options)


def started(scene, start, speed):
    """Scene with the starts that the command line gives."""
    given: dict[str, dict] = {}
    for key, entries in (("position", start), ("rate", speed)):
        for entry in entries or ():
            name, _, value = entry.rpartition("=")
            try:
                given.setdefault(name, {})[key] = float(value)
            except ValueError:
                raise FileError(f"{entry!r}: expected NAME=VALUE with a number, e.g. panda_joint2=0.5.") from None
    for name, values in given.items():
        scene.start(name, **values)
    return scene


def tolerances(entries: list[str] | None):
    """Absolute local error as :func:`gauss.simulate` takes it, from ``--atol``; None without it."""
    found: dict = {}
    for entry in entries or ():
        name, _, value = entry.rpartition("=")
        try:
            numbers = tuple(float(number) for number in value.split(","))
        except ValueError:
            numbers = ()
        if not 1 <= len(numbers) <= 2:
            expected = "a number, or NAME=NUMBER for angle, length or a joint, e.g. wrist=1e-8; two are COORDINATES,RATES"
            raise FileError(f"--atol {entry}: expected {expected}.")
        if name in found:
            raise FileError(f"--atol {entry}: {repr(name) if name else 'a number for all'} is given twice.")
        found[name] = numbers if len(numbers) == 2 else numbers[0]
    others = found.pop("", None)
    if not found:
        return others
    return found if others is None else {"angle": others, "length": others} | found


INTERRUPTED = 130  # exit code, by the custom of shells: 128 and the number of the signal


def as_far_as_it_came(make):
    """Result of a function, and whether Ctrl-C ended it early: a motion is kept up to then.

    typer.Exit if nothing had been made yet.
    """
    try:
        return make(), False
    except KeyboardInterrupt as error:
        found = getattr(error, "trajectory", None)
        if found is None or not len(found.t):
            typer.secho("interrupted before the first sample.", fg="yellow", err=True)
            raise typer.Exit(INTERRUPTED) from None
        kept = f"at t = {found.t[-1]:.6g} s; what was simulated until then is kept"
        typer.secho(f"interrupted {kept}.", fg="yellow", err=True)
        return found, True


def check_files(kind: str, output: Path | None, *figures: Path | None):
    """Refuse files of results and figures that cannot be written, before time is spent.

    FileError if an ending does not fit, or there is no such folder.
    """
    if output is not None:
        import_module("gauss.io.load").writer(output, kind)
    for path in figures:
        if path is not None:
            import_module("gauss.view.style").check_format(path)


def equally_spaced(duration: float, samples: int):
    """Times of samples [s]."""
    return import_module("numpy").linspace(0.0, duration, samples)


def view():
    """Figures, whose library takes long to import."""
    return import_module("gauss.view")


def conclude(comparison):
    """Print a comparison; exit code 1 when it did not pass."""
    typer.echo(str(comparison))
    if not comparison.passed:
        raise typer.Exit(1)
