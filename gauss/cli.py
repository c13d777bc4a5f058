"""Command line: parses arguments, calls three functions."""

import warnings
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import gauss
from gauss.bench import commands
from gauss.errors import FileError, GaussError, SimulationError
from gauss.io import linkages, networks, servos, write_csv
from gauss.simulation import INTEGRATORS

app = typer.Typer(
    help="Dynamics of mechanisms by Gauss's principle of least constraint, cross-checked against Pinocchio.",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # the default would swallow units in [brackets]
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(commands.bench, name="bench")
app.add_typer(commands.problems, name="problems")

SceneName = Annotated[
    str,
    typer.Argument(
        help="A scene file (.toml), a robot (.urdf), the name of a shipped model (see `gauss models`), or robot:NAME for a "
        "robot of the package example-robot-data, e.g. robot:panda.",
        show_default=False,
    ),
]
Root = Annotated[str, typer.Option(help="How the base of a robot stands: fixed or free.")]
Backend = Annotated[str, typer.Option(help="How accelerations are solved: auto, recursion, kkt, schur, osqp, clarabel, …")]
Seed = Annotated[int, typer.Option(help="Seed of the random states.")]


@app.command()
def run(
    scene: SceneName,
    duration: Annotated[float, typer.Option(help="How long to simulate [s].")] = 2.0,
    integrator: Annotated[str, typer.Option(help=f"One of {', '.join(INTEGRATORS)}.")] = "dop853",
    step: Annotated[float | None, typer.Option(help="Step of a fixed-step method, largest step of others [s].")] = None,
    rtol: Annotated[float, typer.Option(help="Relative local error of coordinates and rates.")] = 1e-8,
    atol: Annotated[float, typer.Option(help="Absolute local error [rad, m, rad/s, m/s].")] = 1e-10,
    backend: Backend = "auto",
    stabilisation: Annotated[
        str, typer.Option(help="How drift off the constraints is undone: projection, baumgarte or none.")
    ] = "projection",
    start: Annotated[
        list[str] | None, typer.Option(help="Where a joint starts, NAME=VALUE [rad, m]; may be repeated.")
    ] = None,
    speed: Annotated[list[str] | None, typer.Option(help="How fast it starts, NAME=VALUE [rad/s, m/s].")] = None,
    root: Root = "fixed",
    samples: Annotated[int | None, typer.Option(help="Number of equally spaced samples; every step when not given.")] = None,
    output: Annotated[Path | None, typer.Option(help="Write the motion to this file (.npz).")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw coordinates, rates and energies to this file (.png, .svg, .pdf).")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Confirm accelerations along the motion by Pinocchio.")] = False,
):
    """Simulate a scene and say what happened; a scene with servos is held by them, and their forces are drawn."""
    found = _load(scene, root)
    times = None if samples is None else np.linspace(0.0, duration, samples)
    if not isinstance(found, gauss.Scene):
        settings = {"integrator": integrator, "step": step, "rtol": rtol, "atol": atol, "times": times}
        if backend != "auto":
            raise FileError(f"{scene}: servos are solved by the coupled system; --backend has no meaning here.")
        if stabilisation != "projection":
            raise FileError(f"{scene}: servos are settled by their actuators; --stabilisation has no meaning here.")
        _run_servo(_started_servo(found, start, speed), duration, settings, output, plot, check)
        return
    system = gauss.compile_scene(_started(found, start, speed))
    trajectory = gauss.simulate(
        system,
        duration,
        integrator=integrator,
        step=step,
        rtol=rtol,
        atol=atol,
        backend=backend,
        stabilisation=stabilisation,
        times=times,
    )
    _report(trajectory)
    if output is not None:
        typer.echo(f"motion written to {gauss.save(trajectory, output)}")
    if plot is not None:
        _figure(trajectory, plot)
    if check:
        stride = max(1, len(trajectory) // 20)
        _conclude(
            gauss.crosscheck(system, [trajectory.state(i) for i in range(0, len(trajectory), stride)], backend=backend)
        )


@app.command()
def check(
    scene: SceneName,
    states: Annotated[int, typer.Option(help="Number of random states.")] = 20,
    seed: Seed = 0,
    tolerance: Annotated[float, typer.Option(help="Largest relative difference that passes.")] = 1e-10,
    backend: Backend = "auto",
    root: Root = "fixed",
):
    """Compare accelerations, reactions and energies with Pinocchio on random states; exit code 1 when they differ."""
    found = _load(scene, root)
    scene_alone = found if isinstance(found, gauss.Scene) else found.system
    _conclude(gauss.crosscheck(scene_alone, states, seed=seed, tolerance=tolerance, backend=backend))


@app.command()
def explain(scene: SceneName, root: Root = "fixed"):
    """Say what a scene consists of, what it can do, and how it is solved."""
    found = _load(scene, root)
    if isinstance(found, gauss.Scene):
        typer.echo(gauss.compile_scene(found).explain())
    else:
        typer.echo(import_module("gauss.servo").explain(found))


@app.command()
def linkage(
    file: Annotated[
        str,
        typer.Argument(
            help="A linkage file (.toml), or the name of a shipped linkage (see `gauss models`).", show_default=False
        ),
    ],
    steps: Annotated[int, typer.Option(help="Number of steps of a turn of the crank.", min=2)] = 360,
    speed: Annotated[float | None, typer.Option(help="Speed of the crank [rad/s]; that of the file when not given.")] = None,
    csv: Annotated[Path | None, typer.Option(help="Write torque, reactions and motion at every crank angle (.csv).")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the mechanism, torque, reactions and bearing forces (.png, .svg, .pdf).")
    ] = None,
    animation: Annotated[
        Path | None, typer.Option(help="Draw the turning mechanism (.gif, or .mp4 where ffmpeg is installed).")
    ] = None,
    fluctuation: Annotated[
        float | None, typer.Option(help="Size the flywheel for this fluctuation of speed, (ω_max − ω_min) / ω.")
    ] = None,
    run: Annotated[
        float | None, typer.Option(help="Run the linkage under its own motor from rest, for so long [s].")
    ] = None,
):
    """Analyse a planar linkage by its Assur groups: torque, reactions, work, quality of motion."""
    from gauss.linkages import report, table  # other commands need no linkages

    mechanism = gauss.load_linkage(file)
    if speed is not None:
        mechanism.set_speed(speed)
    cycle = mechanism.cycle(mechanism.sweep(steps))
    typer.echo(report(mechanism, cycle))
    if fluctuation is not None:
        wheel = mechanism.flywheel(fluctuation)
        typer.echo(f"  flywheel       {wheel.inertia:.6g} kg m² for δ = {fluctuation:g}; ΔE = {wheel.excess_energy:.6g} J")
    if run is not None:
        typer.echo(f"  run            {mechanism.run(run)}")
    if csv is not None:
        typer.echo(f"table written to {write_csv(table(cycle), csv)}")
    for path, draw in ((plot, "plot_linkage"), (animation, "animate_linkage")):
        if path is not None:
            getattr(_view(), draw)(cycle, path)
            typer.echo(f"{'figure' if path is plot else 'animation'} written to {path}")


@app.command("rotors")
def rotor_network(
    file: Annotated[
        str,
        typer.Argument(help="A rotor file (.toml) or the name of a shipped network, e.g. gear_runup.", show_default=False),
    ],
    duration: Annotated[float, typer.Option(help="How long to simulate [s].")] = 5.0,
    samples: Annotated[int, typer.Option(help="Number of equally spaced samples.", min=2)] = 501,
    rtol: Annotated[float, typer.Option(help="Relative local error of angles and speeds.")] = 1e-9,
    atol: Annotated[float, typer.Option(help="Absolute local error [rad, rad/s].")] = 1e-9,
    method: Annotated[str, typer.Option(help="auto, dop853 (explicit) or radau (implicit, for stiff slips).")] = "auto",
    steady: Annotated[bool, typer.Option("--steady", help="Find all steady operating points at the end.")] = False,
    modes: Annotated[bool, typer.Option("--modes", help="List torsional eigenfrequencies and modes.")] = False,
    explain: Annotated[bool, typer.Option("--explain", help="Say what the network is reduced to, in symbols.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw speeds, slips, torques and losses to this file.")] = None,
    network: Annotated[Path | None, typer.Option(help="Draw the network to this file (.png, .svg, .pdf).")] = None,
    csv: Annotated[Path | None, typer.Option(help="Write the samples to this file (.csv).")] = None,
):
    """Simulate a network of rotors: shafts, gears, friction drives, springs and clutches."""
    from gauss import rotors  # other commands need no rotors

    given = gauss.load_rotors(file)
    if explain:
        typer.echo(rotors.explain(given) + "\n")
    if network is not None:
        _view().draw_network(given, network)
        typer.echo(f"drawing written to {network}")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", rotors.BeltSlipWarning)
        times = np.linspace(0.0, duration, samples)
        motion = rotors.simulate(given, duration, times=times, rtol=rtol, atol=atol, method=method)
    for warning in told:
        typer.secho(f"warning: {warning.message}", fg="yellow", err=True)
    typer.echo(rotors.report(motion))
    if steady:
        typer.echo(rotors.steady_table(rotors.operating_points(given, duration), duration))
    if modes:
        typer.echo(rotors.mode_table(rotors.eigenmodes(given)))
    if plot is not None:
        _view().plot_rotors(motion, plot)
        typer.echo(f"figure written to {plot}")
    if csv is not None:
        typer.echo(f"samples written to {write_csv(rotors.table(motion), csv)}")


@app.command()
def models():
    """List the scenes, servos, linkages and rotor networks that come with gauss."""
    found = gauss.catalog() | servos()
    for command, of_command in (("linkage", linkages()), ("rotors", networks())):
        found |= {f"{command} {name}": text for name, text in of_command.items()}
    width = max(len(name) for name in found)
    for name, description in found.items():
        typer.echo(f"{name:{width}}  {description}")


def _load(scene: str, root: str):
    return gauss.load(scene) if root == "fixed" else gauss.load(scene, root=root)


def _started(scene, start, speed):
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


def _started_servo(servo, start, speed):
    """Servo whose scene has the starts that the command line gives."""
    return replace(servo, system=_started(servo.system.scene, start, speed)) if start or speed else servo


def _run_servo(servo, duration: float, settings: dict, output, plot, check: bool):
    """Simulate under servos; what was reached before a failure is written and drawn, too."""
    failure = None
    try:
        tracking = import_module("gauss.servo").simulate(servo, duration, **settings)
    except SimulationError as error:
        tracking, failure = error.trajectory, error
    if tracking is not None and len(tracking):
        _report_servo(tracking)
        if output is not None:
            typer.echo(f"motion written to {gauss.save(tracking, output)}")
        if plot is not None:
            _figure(tracking, plot)
    if failure is not None:
        raise failure
    if check:
        stride = max(1, len(tracking) // 20)
        states = [tracking.motion.state(i) for i in range(0, len(tracking), stride)]
        _conclude(gauss.crosscheck(servo.system, states))


def _report_servo(tracking):
    stats, found = tracking.motion.stats, import_module("gauss.servo").energy(tracking)
    drift = abs(found.balance).max()
    lines = {
        "held": str(tracking.verdict),
        "steps": f"{stats.steps} accepted, {stats.rejected} rejected, {stats.evaluations} evaluations",
        "time": f"{stats.wall_time:.3g} s for {tracking.t[-1] - tracking.t[0]:.6g} s of motion",
        "relations": f"kept within {abs(tracking.gaps).max(initial=0.0):.1e}",
        "hold": f"{tracking.smallest.min():.3g} at its weakest (smallest singular value; 0 is none)",
        "energy": f"balance within {drift:.2e} J, {drift / max(found.scale, 1e-300):.1e} of its scale",
        "certificate": f"largest estimated relative error of accelerations {stats.worst_error:.1e}",
        "method": stats.method,
    }
    typer.echo(f"{tracking!r}")
    for name, text in lines.items():
        typer.echo(f"  {name:12} {text}")
    for name, u, work in zip(tracking.servo.efforts, tracking.efforts.T, tracking.work.T, strict=True):
        typer.echo(f"  effort {name!r}: {u.min():.6g} … {u.max():.6g}, work {work[-1]:.6g} J")


def _report(trajectory):
    stats, found = trajectory.stats, gauss.energy(trajectory)
    drift = abs(found.balance).max()
    lines = {
        "steps": f"{stats.steps} accepted, {stats.rejected} rejected, {stats.evaluations} evaluations",
        "time": f"{stats.wall_time:.3g} s for {trajectory.t[-1] - trajectory.t[0]:.6g} s of motion",
        "energy": f"balance within {drift:.2e} J, {drift / max(found.scale, 1e-300):.1e} of its scale",
        "certificate": f"largest estimated relative error of accelerations {stats.worst_error:.1e}",
        "method": stats.method,
    }
    if trajectory.events:
        impacts = sum(event.kind == "impact" for event in trajectory.events)
        lines["events"] = f"{impacts} impacts, {len(trajectory.events) - impacts} changes of what is closed"
    typer.echo(f"{trajectory!r}")
    for name, text in lines.items():
        typer.echo(f"  {name:12} {text}")


def _figure(trajectory, path: Path):
    view = _view()
    draw = view.plot_motion if isinstance(trajectory, gauss.Trajectory) else view.plot_tracking
    draw(trajectory, path)
    typer.echo(f"figure written to {path}")


def _view():
    """Figures, whose library is optional and takes long to import."""
    try:
        return import_module("gauss.view")
    except ImportError as error:
        raise FileError("figures need matplotlib: pip install 'gauss[view]'.") from error


def _conclude(comparison):
    typer.echo(str(comparison))
    if not comparison.passed:
        raise typer.Exit(1)


def main():
    """Entry point: errors of gauss are one line, not a traceback."""
    try:
        app()
    except GaussError as error:
        typer.secho(f"error: {error}", fg="red", err=True)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
