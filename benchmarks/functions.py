"""Functions of a state: one call from Python, a loop of machine code, a batch of 4096, beside Pinocchio and MuJoCo.

Run it with:

    python -m benchmarks.functions [--rounds 15] [--only Panda]

Pinocchio and MuJoCo give these functions to Python one state at a time: their time stands beside each of ours. Where
joints close loops, the functions are those of the spanning tree, for all engines, but for forward dynamics, beside
Pinocchio's constraint dynamics (derivatives with loops: benchmarks.control). The difference is the largest one to
Pinocchio's results, in the rates of gauss, relative to the largest number. CPU time of the process; medians of rounds.
Beside the rows below the goals of 4 × and 20 × stand the operations of the function, the bytes of its result, and the time
to fill the result of the batch with zeros. Writes benchmarks/results/functions.csv and .md.
"""

import ctypes
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("GAUSS_TIER", "optimised")

import warnings  # noqa: E402
from collections.abc import Callable, Iterator  # noqa: E402
from contextlib import suppress  # noqa: E402
from dataclasses import dataclass  # noqa: E402
from statistics import median  # noqa: E402

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

import gauss  # noqa: E402
from benchmarks.command import agreeing, chosen, command, load_at_the_end  # noqa: E402
from benchmarks.latency.scenes import FEET, biped  # noqa: E402
from benchmarks.loop_contacts import LoopContacts  # noqa: E402
from gauss.analysis.crosscheck.pinocchio_ import Configuration, Twin, twin  # noqa: E402
from gauss.bench.contest import OURS, Competitor, difference, duration, interleaved  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import formatted_table, head, in_time  # noqa: E402
from gauss.codegen.machine import load  # noqa: E402
from gauss.dynamics.kinematics import kinematics  # noqa: E402
from gauss.dynamics.state_functions import traced_function  # noqa: E402
from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree  # noqa: E402
from gauss.io.mjcf.write import to_mjcf  # noqa: E402
from gauss.system import State, System, random_state  # noqa: E402

CALLS, BATCH = 256, 4096
PINOCCHIO, MUJOCO, LOOP, MANY, FILL = "Pinocchio", "MuJoCo", "loop", "batch", "fill"
ONCE_GOAL, MANY_GOAL = 4.0, 20.0  # ratios to the best peer of one call, and in batch on trees
TREES = "Panda", "UR5", "Talos"
DGEMM_SIZE = 512
ROUNDING = 1e-9  # of derivatives near singular configurations, relative to the largest entry
COMPETITORS = OURS, LOOP, MANY, PINOCCHIO, MUJOCO
MECHANISMS: dict[str, Callable[[], gauss.Scene]] = {
    "Panda": lambda: gauss.load("robot:panda", mimic=False),
    "UR5": lambda: gauss.load("robot:ur5"),
    "Talos": lambda: gauss.load("robot:talos"),
    "biped": lambda: biped(FEET),
    "Stewart platform": lambda: gauss.load("stewart_platform"),
    "ladder of 10": lambda: gauss.load("n_four_bar", n=10),
}


@dataclass(frozen=True)
class Peers:
    """A mechanism in one state in Pinocchio and in MuJoCo; no MuJoCo where it has no counterpart."""

    pair: Twin  # the mechanism in Pinocchio
    at: Configuration  # the state there
    data: pin.Data  # its workspace
    loops: LoopContacts | None  # its constraint dynamics; None of a tree
    frame: int  # the frame of kinematics
    # model, state: the mechanism in MuJoCo, in this state; None without
    model: Any = None
    state: Any = None
    body: int = 0  # its body


def _momentum(A):
    return np.concatenate([A[3:], A[:3]])


def _mass_matrix(p: Peers):
    return pin.crba(p.pair.model, p.data, p.at.q)


def _full(M, p: Peers):
    M = np.triu(M) + np.triu(M, 1).T
    return p.at.T.T @ M @ p.at.T


AXES = pin.LOCAL_WORLD_ALIGNED
# Of each function: Pinocchio's call, and its result in the rates and in the order of gauss; None is not compared.
BY_PINOCCHIO: dict[str, tuple[Callable, Callable | None]] = {
    "mass_matrix": (_mass_matrix, _full),
    "bias_forces": (
        lambda p: pin.nonLinearEffects(p.pair.model, p.data, p.at.q, p.at.v),
        lambda h, p: p.at.T.T @ pin.rnea(p.pair.model, p.data, p.at.q, p.at.v, p.at.bias),
    ),
    "gravity_forces": (
        lambda p: pin.computeGeneralizedGravity(p.pair.model, p.data, p.at.q),
        lambda g, p: p.at.T.T @ g,
    ),
    "coriolis_matrix": (lambda p: pin.computeCoriolisMatrix(p.pair.model, p.data, p.at.q, p.at.v), None),
    "forward_kinematics": (
        lambda p: (pin.framesForwardKinematics(p.pair.model, p.data, p.at.q), p.data.oMf[p.frame])[1],
        lambda M, p: np.append(M.rotation, M.translation),
    ),
    "jacobian": (
        lambda p: pin.computeFrameJacobian(p.pair.model, p.data, p.at.q, p.frame, AXES),
        lambda J, p: _momentum(J @ p.at.T),
    ),
    "jacobian_rate": (
        lambda p: (
            pin.computeJointJacobiansTimeVariation(p.pair.model, p.data, p.at.q, p.at.v),
            pin.getFrameJacobianTimeVariation(p.pair.model, p.data, p.frame, AXES),
        )[1],
        None,
    ),
    "center_of_mass": (lambda p: pin.centerOfMass(p.pair.model, p.data, p.at.q), lambda x, p: x),
    "momentum": (
        lambda p: pin.computeCentroidalMomentum(p.pair.model, p.data, p.at.q, p.at.v),
        lambda h, p: _momentum(h.vector),
    ),
    "momentum_matrix": (
        lambda p: pin.computeCentroidalMap(p.pair.model, p.data, p.at.q),
        lambda A, p: _momentum(A @ p.at.T),
    ),
    "kinetic_energy": (lambda p: pin.computeKineticEnergy(p.pair.model, p.data, p.at.q, p.at.v), lambda T, p: T),
    "potential_energy": (lambda p: pin.computePotentialEnergy(p.pair.model, p.data, p.at.q), lambda V, p: V),
    "inverse_dynamics": (
        lambda p: pin.rnea(p.pair.model, p.data, p.at.q, p.at.v, p.at.bias),
        lambda tau, p: p.at.T.T @ tau,
    ),
}
OF_TREES = {
    "forward_dynamics": (lambda p: pin.aba(p.pair.model, p.data, p.at.q, p.at.v, np.zeros(p.pair.model.nv)), None),
    "acceleration_derivatives": (
        lambda p: pin.computeABADerivatives(p.pair.model, p.data, p.at.q, p.at.v, np.zeros(p.pair.model.nv)),
        None,
    ),
}
OF_LOOPS: dict[str, tuple[Callable, None]] = {"forward_dynamics": (lambda p: p.loops.dynamics(), None)}


def _placed(p: Peers, *more: Callable):
    for step in (mujoco.mj_kinematics, mujoco.mj_comPos, *more):
        step(p.model, p.state)


def _crb(p: Peers):
    _placed(p, mujoco.mj_crb)


def _rne(p: Peers):
    _placed(p, mujoco.mj_comVel)
    mujoco.mj_rne(p.model, p.state, 0, np.empty(p.model.nv))


def _jac(p: Peers):
    _placed(p)
    J = np.empty((6, p.model.nv))
    mujoco.mj_jacBody(p.model, p.state, J[3:], J[:3], p.body)


BY_MUJOCO: dict[str, Callable[[Peers], object]] = {
    "mass_matrix": _crb,
    "bias_forces": _rne,
    "forward_kinematics": lambda p: (mujoco.mj_kinematics(p.model, p.state), p.state.xmat[p.body], p.state.xpos[p.body]),
    "jacobian": _jac,
    "center_of_mass": _placed,
    "potential_energy": lambda p: (mujoco.mj_kinematics(p.model, p.state), mujoco.mj_energyPos(p.model, p.state)),
    "forward_dynamics": lambda p: mujoco.mj_forward(p.model, p.state),
}


def peers(system: System, state: State, body: str) -> Peers:
    """The mechanism in other engines."""
    pair = twin(system)
    placed = system.frame(body)
    side = pair.placements[placed.body]
    frame = pin.Frame("probe", side.joint, 0, side.central * pin.SE3(placed.R, placed.p), pin.FrameType.OP_FRAME)
    index, at = pair.model.addFrame(frame), pair.configuration(state)
    if system.is_tree:
        with suppress(gauss.GaussError):
            model = mujoco.MjModel.from_xml_string(to_mjcf(system.scene))
            data = mujoco.MjData(model)
            limbs = [limb(system, *edge) for edge in spanning_tree(system.scene)[0]]
            data.qpos, data.qvel = mujoco_state(system, limbs, kinematics(system, state))
            return Peers(pair, at, pair.model.createData(), None, index, model, data, data.body(body).id)
    return Peers(pair, at, pair.model.createData(), None if system.is_tree else LoopContacts(pair, at), index)


def rows(name: str, system: System, rounds: int) -> Iterator[dict]:
    """Times of all functions of a mechanism [s]."""
    rng = np.random.default_rng(0)
    if system.has_closures:
        q = system.initial_state().q
        state = system.projected(State(0.0, q, rng.standard_normal(system.n_v)))
    else:
        state = random_state(system, rng)
    body = system.structure.bodies[-1]
    others, given = peers(system, state, body), {"q": state.q, "v": state.v}
    given |= {"acceleration": np.zeros(system.n_v), "load": np.zeros(system.n_v)}
    for function, (theirs, result) in (BY_PINOCCHIO | (OF_LOOPS if system.has_closures else OF_TREES)).items():
        full = f"{function}:{body}" if function in ("forward_kinematics", "jacobian", "jacobian_rate") else function
        ours: Any = system.forward_dynamics if function == "forward_dynamics" else system.function(full)
        wrapper = ours.__self__.fallback
        arguments = [given[one].copy() for one in wrapper.interface.vectors]
        batches = [np.tile(one, (BATCH, 1)) for one in arguments]
        out = ours(*batches)
        parts = out if isinstance(out, tuple) else (out,)
        loop = _loop(wrapper, arguments)
        tasks = {
            OURS: Competitor(lambda f=ours, x=arguments: _repeat(f, x), CALLS),
            LOOP: Competitor(loop, CALLS),
            MANY: Competitor(lambda f=ours, x=batches, out=out: f(*x, out), BATCH),
            FILL: Competitor(lambda parts=parts: [part.fill(0.0) for part in parts], BATCH),
            PINOCCHIO: Competitor(lambda f=theirs: _repeat(f, (others,)), CALLS),
        }
        if others.model is not None and function in BY_MUJOCO:
            tasks[MUJOCO] = Competitor(lambda f=BY_MUJOCO[function]: _repeat(f, (others,)), CALLS)
        _, seconds = interleaved(tasks, 3), interleaved(tasks, rounds)
        found = ours(*arguments)
        found = np.concatenate([np.ravel(part) for part in (found if isinstance(found, tuple) else (found,))])
        expected = None if result is None else np.ravel(result(theirs(others), others))
        line: dict[str, str | float] = {"mechanism": name, "function": function}
        line |= {task: median(seconds[task]) if task in seconds else np.nan for task in (*COMPETITORS, FILL)}
        line |= {"bytes": sum(part.nbytes for part in parts) / BATCH, "operations": _operations(system, full)}
        what = f"{name}, {function}"
        yield line | {"agreement": np.nan if expected is None else agreeing(difference(found, expected), ROUNDING, what)}


def _operations(system: System, function: str) -> float:
    """Operations of a function, a multiplication and an addition each; NaN of forward dynamics, a program of functions."""
    if function == "forward_dynamics":
        return np.nan
    return float(sum(traced_function(system, (function,))[0].operations().values()))


def _dgemm() -> float:
    """Operations of a product of matrices a second."""
    A = np.random.default_rng(0).standard_normal((DGEMM_SIZE, DGEMM_SIZE))
    return 2.0 * DGEMM_SIZE**3 / min(duration(lambda: A @ A) for _ in range(9))


def _repeat(function: Callable, arguments):
    for _ in range(CALLS):
        function(*arguments)


LOOP_TEXT = """
define void @"loop"(i64 %count, void (double*, double*)* %f, double* %in, i64 %n_in, double* %out, i64 %n_out) {
entry:
  br label %body
body:
  %k = phi i64 [0, %entry], [%next, %body]
  %place_in = mul i64 %k, %n_in
  %place_out = mul i64 %k, %n_out
  %given = getelementptr double, double* %in, i64 %place_in
  %found = getelementptr double, double* %out, i64 %place_out
  call void %f(double* %given, double* %found)
  %next = add i64 %k, 1
  %done = icmp eq i64 %next, %count
  br i1 %done, label %end, label %body
end:
  ret void
}
"""


def _loop(wrapper, arguments) -> Callable:
    """Run one state after the other in machine code."""
    inputs = np.tile(np.concatenate([*arguments, [0.0]]), (CALLS, 1))
    outputs = np.empty((CALLS, wrapper.compute.outputs))
    integer, pointer = ctypes.c_int64, ctypes.c_void_p
    loop = load(LOOP_TEXT).entry("loop", ctypes.CFUNCTYPE(None, integer, pointer, pointer, integer, pointer, integer))
    address = ctypes.cast(wrapper.compute.run.call, pointer)
    given = CALLS, address, inputs.ctypes.data, inputs.shape[1], outputs.ctypes.data, outputs.shape[1]
    return lambda kept=(inputs, outputs): loop.call(*given)


def measure(rounds: int, only: str) -> tuple[list[dict], list[str]]:
    """Rows of the table, and the conditions."""
    conditions, found = header("numpy", "pin", "mujoco"), []
    warnings.simplefilter("ignore")  # of robots whose files hold more than is read
    for name in chosen(only, MECHANISMS):
        for line in rows(name, gauss.compile_scene(MECHANISMS[name]()), rounds):
            print(name, line["function"], flush=True)
            found.append(line)
    conditions.append(f"a product of matrices of {DGEMM_SIZE}: {_dgemm() / 1e9:.0f} operations/ns")
    return found, [*conditions, load_at_the_end()]


def page(lines: list[dict], conditions: list[str]) -> list[str]:
    """The page of the table."""
    made = []
    for line in lines:
        times = {key: float(line[key]) for key in COMPETITORS}
        best = np.nanmin([times[PINOCCHIO], times[MUJOCO]])
        agreement = float(line["agreement"])
        made.append(
            {key: in_time(value) for key, value in times.items()}
            | {"mechanism": line["mechanism"], "function": line["function"]}
            | {"once": best / times[OURS], "looped": best / times[LOOP], "many": best / times[MANY]}
            | {"agreement": f"{agreement:.0e}" if np.isfinite(agreement) else "–"}
        )
    titles = {
        "mechanism": "{mechanism}",
        "function": "`{function}`",
        "one call": f"{{{OURS}}}",
        "in a loop of machine code": f"{{{LOOP}}}",
        f"in a batch of {BATCH}": f"{{{MANY}}}",
        "Pinocchio, one call": f"{{{PINOCCHIO}}}",
        "MuJoCo, one call": f"{{{MUJOCO}}}",
        "best peer / one call": "{once:.1f}",
        "/ loop": "{looped:.1f}",
        "/ batch": "{many:.0f}",
        "difference": "{agreement}",
    }
    profiled = below(lines) if FILL in lines[0] else []  # tables of before do not hold it
    return [*head("Functions of a state", conditions), *formatted_table(titles, made), "", *profiled, ""]


WHY = f"""\
A goal leaves a function the time of the best peer, divided by {ONCE_GOAL:g} or {MANY_GOAL:g}. Two figures say what stands
against it. *needed*: operations a nanosecond with which all operations of the function would fit into that time; the head of
this page says how many a product of matrices reaches, which loads and stores next to nothing, in vectors of all lanes (one
call has the lanes only where parts of a mechanism are alike). *filled*: the share of that time that it takes to write zeros
to the result and nothing else; from 100 % on no function of this result can meet the goal. The results of a batch are dense
arrays (n, …) in C order, structural zeros included, and larger than the caches; the peers leave theirs, of one state, in the
nearest cache. One call of a Jacobian of 1.5 kB costs about half in the making and freeing of its array by numpy, which keeps
freed memory for new arrays only below 1 kB; with `out=` it costs half as much."""


def below(lines: list[dict]) -> list[str]:
    """Section of the rows that do not meet the goals, and what stands against it."""
    rows = []
    for line in lines:
        best = np.nanmin([float(line[PINOCCHIO]), float(line[MUJOCO])])
        many = [(MANY, MANY_GOAL)] if line["mechanism"] in TREES else []
        for case, goal in [(OURS, ONCE_GOAL), *many]:
            if best < goal * float(line[case]):
                rows.append(_below(line, case, best, goal))
    titles = {
        "mechanism": "{mechanism}",
        "function": "`{function}`",
        "": "{case}",
        "best peer / gauss": "{ratio:.1f}",
        "operations": "{operations}",
        "operations/ns": "{rate}",
        "needed": "{needed}",
        "bytes of the result": "{bytes:.0f}",
        "filled": "{filled}",
    }
    return ["## Below the goals", "", *WHY.split("\n"), "", *formatted_table(titles, rows)]


def _below(line: dict, case: str, best: float, goal: float) -> dict:
    """Row of the section of a function that does not meet a goal."""
    seconds, left = float(line[case]), best / goal
    operations, filled = float(line["operations"]), float(line[FILL]) / left
    known = np.isfinite(operations)
    return {
        "mechanism": line["mechanism"],
        "function": line["function"],
        "case": "one call" if case == OURS else "batch",
        "ratio": best / seconds,
        "operations": f"{operations:.0f}" if known else "–",
        "rate": f"{1e-9 * operations / seconds:.1f}" if known else "–",
        "needed": f"{1e-9 * operations / left:.1f}" if known else "–",
        "bytes": float(line["bytes"]),
        "filled": f"{100.0 * filled:.0f} %" if case == MANY else "–",
    }


if __name__ == "__main__":
    command("functions", __doc__, measure, page, {"rounds": (15, "interleaved repetitions"), "only": ("", "a mechanism")})
