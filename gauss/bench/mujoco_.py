"""MuJoCo's contact solvers on cone programmes ½ rᵀ W r + qᵀ r → min, r_n ≥ |r_t| / μ contact by contact.

MuJoCo minimises ½ fᵀ (J M⁻¹ Jᵀ + R) f + fᵀ (J a − a_ref) over elliptic friction cones, with R a positive diagonal (Todorov
2014, *Convex and analytically-invertible dynamics with contacts and constraints*). Any W that is positive definite is of
that form: R = λ/2 of the least eigenvalue λ, J the Cholesky factor of W − R, M = 1, a = 0, a_ref = −q. A model of as many
unit spheres on a plane as there are contacts, each free in three directions, has arrays of these sizes, which are filled;
no law of MuJoCo's contacts is left. Equality rows, and cones that no force of a contact makes, are not of that form. Its
tolerance is that of the decrease of the cost in an iteration, which is of second order in the residual.
"""

from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy import sparse

from gauss.backends.programme import Outcome, Programme
from gauss.bench.ready import Ready
from gauss.bench.structured import StructuredProgramme
from gauss.errors import BackendError

SOLVERS = {"mujoco_cg": "CG", "mujoco_newton": "Newton", "mujoco_pgs": "PGS"}
DEPTH = 1e-3  # [m] by which the spheres of the model enter the plane, so that each has a contact
SPHERE = """<body pos="{x} 0 {z}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/><geom type="sphere" size="1" mass="1"/></body>"""


def installed() -> list[str]:
    """Names of the solvers that are installed."""
    return list(SOLVERS) if find_spec("mujoco") else []


def takes(programme: Programme) -> bool:
    """Whether a programme is that of impulses of contacts: cones of three rows with one entry each, and no other rows."""
    K = sparse.csr_matrix(programme.K)
    cones = programme.structure.cones if isinstance(programme, StructuredProgramme) else ()
    diagonal = K.shape[0] == K.shape[1] == K.nnz and (K.indices == np.arange(K.shape[0])).all()
    return not programme.d.size and set(cones) == {3} and diagonal and not programme.k.any()


def ready(solver: str, programme: StructuredProgramme, settings: dict) -> Ready:
    """A solver with its problem; the call starts at zero forces, and forms J M⁻¹ Jᵀ where the solver needs it."""
    import mujoco

    if not takes(programme):
        raise BackendError("MuJoCo's solvers take impulses of contacts: no equality rows, and no other cones.")
    W, signs = programme.H.toarray(), -programme.K.diagonal()
    softness = 0.5 * np.linalg.eigvalsh(W)[0]
    if softness <= 0.0:
        raise BackendError("MuJoCo's solvers take positive definite matrices.")
    model = _model(len(programme.structure.cones), SOLVERS[solver], settings)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _fill(data, np.linalg.cholesky(W - softness * np.eye(len(W))), softness, programme.c, signs[::3] / signs[1::3])
    dual = SOLVERS[solver] == "PGS"

    def call():
        if dual:
            mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdConstraint(model, data)
        return data.efc_force.copy(), int(np.max(data.solver_niter))

    def read(found) -> Outcome:
        force, iterations = found
        z = (programme.H @ force + programme.c) / signs
        solved = iterations < model.opt.iterations
        words = "solved" if solved else "iteration limit"
        return Outcome(force, np.zeros(0), z, solved, f"{solver}: {words}", iterations)

    return Ready(call, read)


def _model(count: int, solver: str, settings: dict):
    """Model with so many contacts, its solver and the settings of that."""
    import mujoco

    spheres = "".join(SPHERE.format(x=3 * k, z=1.0 - DEPTH) for k in range(count))
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option solver="{solver}" cone="elliptic" jacobian="dense" gravity="0 0 0"/>
        <worldbody><geom type="plane" size="1 1 1"/>{spheres}</worldbody></mujoco>"""
    )
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART) | int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    for name, value in settings.items():
        setattr(model.opt, name, value)
    return model


def _fill(data: Any, J: np.ndarray, softness: float, q: np.ndarray, friction: np.ndarray):
    """Write a problem into the arrays of the constraints."""
    data.efc_J[:] = J.reshape(data.efc_J.shape)
    data.efc_R[:], data.efc_D[:], data.efc_aref[:] = softness, 1.0 / softness, -q
    for contact, coefficient in zip(data.contact, friction, strict=True):
        contact.mu, contact.friction[:2] = coefficient, coefficient
