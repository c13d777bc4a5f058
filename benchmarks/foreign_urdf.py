"""URDF files of others: the least that they need to open, and accelerations beside those of Pinocchio's articulated bodies.

Both are given the text of the file as gauss hands it to Pinocchio's parser, random states and no loads; mimic joints move by
themselves. Masses, axes and trees come from that parser in both: what differs is the dynamics, and what gauss makes of them.
"""

import numpy as np
import pinocchio as pin

import gauss
from benchmarks.foreign_accelerations import STATES, NotCompared
from gauss.analysis.crosscheck.pinocchio_joints import forward
from gauss.errors import GaussError
from gauss.io.urdf.guard import guarded
from gauss.io.urdf.numbers import for_parser
from gauss.io.urdf.read import base_of
from gauss.system import random_state

# Options, first those that nobody must give: the base floats where nothing else moves, inertias are taken as they stand.
OPTIONS: tuple[dict, ...] = ({}, {"root": "free"}, {"inertia": "as given"}, {"root": "free", "inertia": "as given"})


def opened_urdf(path) -> tuple[gauss.Scene, dict]:
    """Scene of a file, by the first options that open it, and these.

    GaussError of the last options.
    """
    for options in OPTIONS[:-1]:
        try:
            return gauss.load(path, **options), options
        except GaussError:
            continue
    return gauss.load(path, **OPTIONS[-1]), OPTIONS[-1]


def is_refused_by_parser(path) -> bool:
    """Whether Pinocchio's parser has no robot of the file either."""
    try:
        pin.buildModelFromUrdf(str(path))
    except Exception:  # it raises whatever its libraries do
        return True
    return False


def deviation_of_urdf(path, options: dict) -> float:
    """Largest difference of accelerations, relative to the largest acceleration.

    NotCompared if there are none, as where a link that moves has no inertia.
    """
    text, base = for_parser(guarded(path)), base_of(options.get("root", "fixed"))
    model = pin.buildModelFromXML(text, *base)
    data, rng, worst = model.createData(), np.random.default_rng(0), 0.0
    try:
        system = gauss.compile_scene(gauss.load(path, mimic=False, **options))
    except GaussError as error:
        raise NotCompared(str(error)) from error
    if [joint.name for joint in system.joints] != list(model.names)[1:]:
        raise NotCompared("another order of joints")
    for _ in range(STATES):
        state = random_state(system, rng)
        q, T, bias = _as_pinocchio(system, model, state)
        theirs = pin.aba(model, data, q, T @ state.v, np.zeros(model.nv))
        try:
            ours = T @ np.asarray(gauss.solve(gauss.assemble(system, state)).qdd) + bias
        except GaussError as error:
            raise NotCompared(str(error)) from error
        if not (np.isfinite(ours).all() and np.isfinite(theirs).all()):
            raise NotCompared("no accelerations")
        worst = max(worst, float(abs(ours - theirs).max() / max(1.0, abs(theirs).max())))
    return worst


def _as_pinocchio(system, model, state) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Configuration, and T and γ of the rates and accelerations, v = T v_ours and a = T a_ours + γ."""
    q, T, bias = np.zeros(model.nq), np.zeros((model.nv, system.n_v)), np.zeros(model.nv)
    for joint, index in zip(system.joints, range(1, model.njoints), strict=True):
        if joint.pair.kind == "planar":
            raise NotCompared("Pinocchio has other rates of a plane")
        counterpart, here = forward(joint), state.q[joint.q]
        coordinates = counterpart.configuration(here)
        if model.nqs[index] > len(coordinates):  # an angle without limits
            coordinates = np.array([np.cos(coordinates[0]), np.sin(coordinates[0])])
        q[model.idx_qs[index] :][: model.nqs[index]] = coordinates
        rows = slice(model.idx_vs[index], model.idx_vs[index] + model.nvs[index])
        T[rows, joint.v], bias[rows] = counterpart.T(here), counterpart.bias(here, state.v[joint.v])
    return q, T, bias
