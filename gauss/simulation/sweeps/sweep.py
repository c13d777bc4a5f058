"""Parameter sweep: motions of a scene for many values of its parameters, as one labelled dataset."""

import hashlib
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from gauss.arguments import named_arguments, table
from gauss.codegen.gpu.devices import double_precision
from gauss.dynamics import compile_scene
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import numbers
from gauss.errors import FileError, SceneError, SimulationError, did_you_mean, require
from gauss.interruption import interruption_keeps
from gauss.scene import Scene
from gauss.scene.named_numbers import scene_of
from gauss.simulation import INTEGRATORS, Trajectory
from gauss.simulation.arguments import check_arguments, refuse_without_step
from gauss.simulation.batch.fixed_step_batch import cores
from gauss.simulation.energy_balance import warn_of_many
from gauss.simulation.memory_limit import refuse_beyond_memory
from gauss.simulation.progress import Progress
from gauss.simulation.provenance import made_by, plain, scene_text
from gauss.simulation.sweeps.batch import FAILED, MISSING, SweepTask, run
from gauss.simulation.sweeps.parameters import Members, members
from gauss.simulation.sweeps.storage import InMemory, OnDisk, block, empty, library, pieces
from gauss.simulation.sweeps.workers import results_of
from gauss.simulation.tolerances import shares_of_scale
from gauss.system import System

NETCDF = (".nc", ".h5")  # endings of files, not folders
DEFAULT_ATOL = 1e-9  # relative to the scale of the scene


@named_arguments
@interruption_keeps("dataset")
def sweep(
    scene: Scene | Callable[..., Scene],
    vary: Mapping[str, Sequence[float] | np.ndarray],
    duration: float,
    *,
    together: bool = False,
    samples: int = 101,
    integrator: str = "dop853",
    step: float | None = None,
    rtol: float = 1e-9,
    atol: float | tuple[float, float] | Mapping[str, float] | None = None,
    measure: Mapping[str, Callable[[Trajectory], float]] | None = None,
    workers=None,
    device: str | Sequence[str] | None = None,
    path=None,
    progress: bool = True,
):
    """Simulate a scene with every combination of some parameter values.

    Every member is a scene of its own: checked, assembled from its own start, simulated. Members that differ in numbers only
    are simulated by one ensemble, machine code in which these numbers are inputs.

    Parameters
    ----------
    scene : Scene or callable
        Scene, or a function that makes a scene of parameter values by name, e.g. of lengths.
    vary : mapping
        Values by name: "BODY.mass", "BODY.com.x", "BODY.inertia[2]", "JOINT.at.x", "JOINT.position" and "JOINT.rate" at the
        start, "SPRING.stiffness", "gravity.y", …; of a function that makes scenes, its arguments.
    duration : float
        Simulated time [s].
    together : bool
        Whether the i-th values of all parameters make one member, instead of every combination.
    samples : int
        Number of samples, equally spaced from the start to the end.
    integrator, step, rtol
        See :func:`gauss.simulate`.
    atol : float, pair or mapping, optional
        The same; 1e-9 of the scale of the first member when not given.
    measure : mapping, optional
        Functions of the :class:`gauss.Trajectory` of a member (without work of loads) that return a number, by name.
    workers : int, executor or dask client, optional
        Number of processes of this machine, a client of Dask, or an executor with the interface of
        :mod:`concurrent.futures`; this process by default. The result does not depend on it.
    device : str or sequence of str, optional
        "cuda", "cuda:1", or several: GPUs that move the ensembles, a member in a thread; see :func:`gauss.rollout`. What an
        ensemble does not confirm, and what cannot be one, is simulated on this CPU.
    path : str or Path, optional
        Folder ending in .zarr for the result, which grows with the finished members. An interrupted sweep continues there.
    progress : bool
        Show a progress bar on sweeps of more than a second, in a terminal.

    Returns
    -------
    xarray.Dataset
        ``q`` and ``v`` over the parameters (``member`` if all are varied together), ``time``, and ``coordinate`` or
        ``rate``, NaN where a member failed; ``status`` (1 done, 2 failed) and ``reason`` of a failure; ``energy_error``, the
        residual of the energy balance relative to the largest energy; measured quantities. Attributes: scene, versions,
        settings.

    Warns
    -----
    BalanceWarning
        If the residual of the energy balance of members exceeds a thousandth; it names the worst of them.

    Raises
    ------
    SceneError
        If the scene has nothing of that name.
    SimulationError
        If no member can be simulated, with the reason of the first; or a setting is invalid.
    FileError
        If ``path`` is no sweep of the same parameters.
    DeviceError
        If there is no such device, or it cannot move the ensembles, with the reason.
    MissingPackageError
        If an optional package is not installed, such as cuda-bindings of device "cuda".
    KeyboardInterrupt
        On Ctrl-C; its ``dataset`` holds the members that are done, the others have ``status`` 0; None before the first one.
    """
    measure = table(measure, "sweep: measure", "functions of a trajectory by name")
    if path is not None:
        require(path, (str, PathLike), "sweep: path")
    _check(scene, duration, samples, integrator, step, rtol, atol, measure, workers)
    library("xarray")
    chosen = members(vary, together)
    system = _first(scene, chosen)
    _refuse_beyond_memory(system, samples, chosen, path)
    allowed = shares_of_scale(system, DEFAULT_ATOL) if atol is None else atol
    settings = {"integrator": integrator, "step": step, "rtol": rtol, "atol": allowed}
    task = SweepTask(
        scene=scene,
        members=chosen,
        times=np.linspace(0.0, duration, samples),
        settings=settings,
        measure=measure,
        threads=cores() if workers is None else 1,
        device=None if device is None else double_precision(device),
    )
    blank = empty(task, system, _about(task, system))
    spans = list(pieces(chosen))
    store = InMemory(blank) if path is None else OnDisk(Path(path), blank, block(chosen, *spans[0]))
    missing = store.status == MISSING
    left = [(begin, end) for begin, end in spans if missing[begin:end].any()]
    bar, done = Progress(chosen.size, progress, "members"), chosen.size - sum(end - begin for begin, end in left)
    work = partial(run, task, shape=(system.n_q, system.n_v))
    try:
        for (begin, end), results in results_of(work, left, workers):
            store.write(block(chosen, begin, end), results)
            done += end - begin
            bar.update(done)
    except KeyboardInterrupt as error:
        error.dataset = store.dataset  # type: ignore[attr-defined]  # documented: Ctrl-C keeps the finished members
        raise
    finally:
        bar.close()
    found = store.dataset
    warn_of_many(system, found.energy_error.values.ravel(), lambda k: _name(chosen, k), settings)
    if (store.status == FAILED).all():
        raise SimulationError(f"no member of the sweep could be simulated; the first: {found.reason.values.ravel()[0]}")
    return found


def load_sweep(path):
    """Open the folder or file of a sweep; numbers are read on access.

    Parameters
    ----------
    path : str or Path
        Folder that :func:`gauss.sweep` wrote, or file of :func:`gauss.save` (.nc, .h5). Unfinished members have ``status``
        0.

    Returns
    -------
    xarray.Dataset
        As :func:`gauss.sweep` returns it.

    Raises
    ------
    FileError
        If it holds no sweep.
    """
    require(path, (str, PathLike), "load_sweep")
    if not Path(path).exists():
        raise FileError(f"{path}: there is no such folder or file.")
    engine = "h5netcdf" if Path(path).suffix.lower() in NETCDF else "zarr"
    library(engine)
    try:
        found = library("xarray").open_dataset(path, engine=engine)
    except (OSError, KeyError, ValueError) as error:
        raise FileError(f"{path}: no sweep that gauss wrote: {error}.") from error
    if "sweep_sha256" not in found.attrs:
        raise FileError(f"{path}: labelled arrays, but no sweep that gauss wrote.")
    return found


def _check(scene, duration, samples, integrator, step, rtol, atol, measure, workers):
    if not callable(scene):
        require(scene, (Scene,), "sweep")
    if not isinstance(integrator, str):
        raise SimulationError(f"integrator: expected a name, got {integrator!r}. {did_you_mean('', INTEGRATORS)}")
    refuse_without_step(check_arguments(duration, integrator, step, rtol, atol), step, "a sweep")
    if not isinstance(samples, int) or not 2 <= samples <= sys.maxsize:
        raise SimulationError(f"samples: expected a whole number of at least 2, got {samples!r:.80}.")
    _check_workers(workers)
    for name, function in measure.items():
        if not callable(function):
            raise SimulationError(f"measure: {name!r}: expected a function of a trajectory, got {function!r}.")


def _check_workers(workers):
    is_number = isinstance(workers, int) and not isinstance(workers, bool) and workers > 0
    if workers is not None and not is_number and not hasattr(workers, "submit"):
        kinds = "a number of processes, an executor of concurrent.futures or a client of Dask"
        raise SimulationError(f"workers: expected {kinds}, got {workers!r}.")


def _first(scene, chosen: Members) -> System:
    """System of the first member that can be built: it gives the shapes of the arrays, and checks the names."""
    failure = None
    for k in range(min(chosen.size, 64)):
        try:
            return compile_scene(scene_of(scene, chosen.of(k, k + 1)[0]))
        except Exception as error:  # functions of the user may fail in any way
            if isinstance(error, SceneError) and str(error).startswith("vary:"):
                raise
            failure = failure or error
    raise SimulationError(f"no member of the sweep could be built; the first: {failure}") from failure


def _name(chosen: Members, k: int) -> str:
    """Name of a member: its parameter values."""
    values = ", ".join(f"{name} = {value:.6g}" for name, value in chosen.of(k, k + 1)[0].items())
    return f"member {k} ({values})"


def _refuse_beyond_memory(system: System, samples: int, chosen: Members, path):
    """Refuse members whose samples, with their times, do not fit into memory together; on disk, each of them."""
    count = chosen.size if path is None else 1
    remedy = "give fewer samples or members, or write them to path= as they are made"
    numbers = samples * count * (2 + system.n_q + system.n_v)
    refuse_beyond_memory(numbers, f"{samples:.3g} samples of {count:.3g} members", remedy)


def _about(task: SweepTask, system: System) -> dict:
    """Attributes: scene, settings, versions, and a hash of the content of the sweep."""
    scene = task.scene if isinstance(task.scene, Scene) else system.scene
    about = {"title": f"sweep of {scene.name}", "scene": scene.name} | scene_text(scene) | made_by()
    about |= {f"setting_{key}": plain(value) for key, value in task.settings.items() if value is not None}
    about["varied"] = ", ".join(task.members.names)
    said = {
        "varied": {name: values.tolist() for name, values in zip(task.members.names, task.members.values, strict=True)},
        "together": task.members.together,
        "kept of each": ["energy_error"],
        "times": task.times.tolist(),
        "settings": task.settings,
        "measured": {name: _code(function) for name, function in task.measure.items()},
        "scene": about["scene_toml"] or scene.name,
        "made by": "" if isinstance(task.scene, Scene) else _code(task.scene),
        "numbers": numbers(system)[0].tolist(),
        "laws": [Laws(system).key, *(_code(law) for bound in system.loads for law in bound.laws)],
    }
    return about | {"sweep_sha256": hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()}


def _code(function) -> str:
    """Content of a function, independent of the process."""
    function = getattr(function, "func", function)  # of a partial one
    code = getattr(function, "__code__", None)
    if code is None:
        return repr(type(function))
    constants = [constant for constant in code.co_consts if not hasattr(constant, "co_code")]
    return f"{function.__qualname__} {code.co_code.hex()} {code.co_names} {constants}"
