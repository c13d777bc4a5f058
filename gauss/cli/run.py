"""Command ``gauss run``."""

import warnings
from collections import Counter
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import (
    INTERRUPTED,
    Atol,
    Backend,
    Read,
    Root,
    SceneName,
    as_far_as_it_came,
    check_files,
    conclude,
    equally_spaced,
    load,
    started,
    tolerances,
    view,
)
from gauss.errors import BalanceWarning, FileError, SimulationError, did_you_mean
from gauss.simulation import INTEGRATORS

SMOOTH = 501  # samples of a motion that is drawn: steps may be long
FIGURES = ("motion", "coordinates", "speeds", "energy", "reactions", "phase", "stroboscope")


def run(
    scene: SceneName,
    duration: Annotated[float, typer.Option(help="How long to simulate [s].")] = 2.0,
    integrator: Annotated[str, typer.Option(help=f"One of {', '.join(INTEGRATORS)}.")] = "dop853",
    step: Annotated[float | None, typer.Option(help="Step of a fixed-step method, largest step of others [s].")] = None,
    rtol: Annotated[float, typer.Option(help="Relative local error of coordinates and rates.")] = 1e-12,
    atol: Atol = None,
    backend: Backend = "auto",
    stabilisation: Annotated[
        str, typer.Option(help="Stabilisation of the constraints: projection, partitioning, baumgarte, ggl or none.")
    ] = "projection",
    start: Annotated[
        list[str] | None, typer.Option(help="Where a joint starts, NAME=VALUE [rad, m]; may be repeated.")
    ] = None,
    speed: Annotated[list[str] | None, typer.Option(help="How fast it starts, NAME=VALUE [rad/s, m/s].")] = None,
    root: Root = "fixed",
    read: Read = None,
    samples: Annotated[
        int | None,
        typer.Option(help=f"Number of equally spaced samples; if not given, {SMOOTH} for a figure, else every step.", min=2),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Write the motion to this file (.npz, .csv, .json, .nc, .h5, .zarr).")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw a figure to this file (.png, .svg, .pdf).")] = None,
    figure: Annotated[str, typer.Option(help=f"What is drawn: {', '.join(FIGURES)}.")] = "motion",
    check: Annotated[bool, typer.Option("--check", help="Confirm accelerations along the motion by Pinocchio.")] = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Estimate the global error by a second simulation with smaller steps.")
    ] = False,
):
    """Simulate a scene and report; of a scene with servos the figure shows their forces."""
    if figure not in FIGURES:
        raise FileError(f"--figure: no figure {figure!r}. {did_you_mean(figure, FIGURES)}")
    found, allowed = load(scene, root, read), tolerances(atol)
    check_files("trajectory" if isinstance(found, gauss.Scene) else "tracking", output, plot)
    samples = SMOOTH if samples is None and plot is not None else samples
    times = None if samples is None else equally_spaced(duration, samples)
    if not isinstance(found, gauss.Scene):
        settings = {"integrator": integrator, "step": step, "rtol": rtol, "atol": allowed, "times": times}
        _refuse_for_servos(scene, backend, stabilisation, verify, figure)
        _run_servo(_started_servo(found, start, speed), duration, settings, output, plot, check)
        return
    system = gauss.compile_scene(started(found, start, speed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BalanceWarning)  # the report below looks at every sample
        trajectory, interrupted = as_far_as_it_came(
            lambda: gauss.simulate(
                system,
                duration,
                integrator=integrator,
                step=step,
                rtol=rtol,
                atol=allowed,
                backend=backend,
                stabilisation=stabilisation,
                times=times,
                verify=verify,
            )
        )
    _report(trajectory)
    _write(trajectory, output, plot, f"plot_{figure}")
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    if check:
        stride = max(1, len(trajectory) // 20)
        conclude(gauss.crosscheck(system, [trajectory.state(i) for i in range(0, len(trajectory), stride)], backend=backend))


def _refuse_for_servos(scene: str, backend: str, stabilisation: str, verify: bool, figure: str):
    """Refuse options that mean nothing for servos."""
    if backend != "auto":
        raise FileError(f"{scene}: servos are solved by the coupled system; --backend has no meaning here.")
    if stabilisation != "projection":
        raise FileError(f"{scene}: actuators keep the relations of servos; --stabilisation has no meaning here.")
    if verify:
        raise FileError(f"{scene}: --verify is not there for servos; run it twice with two tolerances.")
    if figure != "motion":
        raise FileError(f"{scene}: a motion under servos has one figure of its own; --figure has no meaning here.")


def _started_servo(servo, start, speed):
    """Servo whose scene has the starts that the command line gives."""
    return replace(servo, system=started(servo.system.scene, start, speed)) if start or speed else servo


def _run_servo(servo, duration: float, settings: dict, output, plot, check: bool):
    """Simulate under servos; what was reached before a failure is written and drawn, too."""
    failure, interrupted = None, False
    try:
        tracking, interrupted = as_far_as_it_came(lambda: import_module("gauss.servo").simulate(servo, duration, **settings))
    except SimulationError as error:
        tracking, failure = error.trajectory, error
    if tracking is not None and len(tracking):
        _report_servo(tracking)
        _write(tracking, output, plot, "plot_tracking")
    if failure is not None:
        raise failure
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    if check:
        stride = max(1, len(tracking) // 20)
        states = [tracking.motion.state(i) for i in range(0, len(tracking), stride)]
        conclude(gauss.crosscheck(servo.system, states))


def _report_servo(tracking):
    stats, found = tracking.motion.stats, import_module("gauss.servo").energy(tracking)
    drift = abs(found.balance).max()
    lines = {
        "held": str(tracking.verdict),
        "steps": f"{stats.steps} accepted, {stats.rejected} rejected, {stats.evaluations} evaluations",
        "time": f"{stats.wall_time:.3g} s for {tracking.t[-1] - tracking.t[0]:.6g} s of motion",
        "relations": f"residual within {abs(tracking.residuals).max(initial=0.0):.1e}",
        "hold": f"smallest singular value of the constraint forces {tracking.smallest.min():.3g} (0: rank-deficient)",
        "energy": f"balance within {drift:.2e} J, {drift / max(found.scale, 1e-300):.1e} of its scale",
        "certificate": f"largest estimated relative error of accelerations {stats.worst_error:.1e}",
        "method": stats.method,
    }
    typer.echo(f"{tracking!r}")
    for name, text in lines.items():
        typer.echo(f"  {name:12} {text}")
    servo = tracking.servo
    units = servo.effort_units
    for name, unit, u, work in zip(servo.efforts, units, tracking.efforts.T, tracking.work.T, strict=True):
        typer.echo(f"  effort {name!r}: {u.min():.6g} … {u.max():.6g} {unit}, work {work[-1]:.6g} J")


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
    if stats.global_error is not None:
        coordinates, rates = stats.global_error
        lines["global error"] = f"{coordinates:.1e} of coordinates [rad, m], {rates:.1e} of rates [rad/s, m/s], estimated"
    if trajectory.events:
        counts = Counter(event.kind for event in trajectory.events)
        lines["events"] = ", ".join(f"{number} × {kind}" for kind, number in counts.most_common())
    typer.echo(f"{trajectory!r}")
    for name, text in lines.items():
        typer.echo(f"  {name:12} {text}")
    gauss.analysis.warn_of_balance(trajectory)


def _write(motion, output: Path | None, plot: Path | None, drawn: str):
    """Write what was simulated, and its figure, where asked for."""
    if output is not None:
        typer.echo(f"motion written to {gauss.save(motion, output)}")
    if plot is not None:
        getattr(view(), drawn)(motion, path=plot)
        typer.echo(f"figure written to {plot}")
