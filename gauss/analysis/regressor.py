"""Regressor of inverse dynamics: Y(q, v, q̈) π = τ, with the loads of the scene on the left side of τ, by named columns.

Ten standard inertial parameters of each body (:mod:`gauss.dynamics.inertial_regressor`), then friction of joints,
d v + f sign v. With loops, Nᵀ Y with v = N ẏ: the equations of motion of independent coordinates y. Forces of all joints,
loop joints too, enter them as Nᵀ τ; those of the constraints do not (Khalil and Dombre, Modeling, Identification and Control
of Robots, 2002, ch. 12).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.tangents import Tangents
from gauss.arguments import name_list, named_arguments, real_array
from gauss.dynamics.conditions import refuse_motionless
from gauss.dynamics.inertial_regressor import STANDARD
from gauss.dynamics.projection import fixed_columns
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import StateError
from gauss.scene import Body, Scene
from gauss.scene.motions import Prescribed
from gauss.scene.set_valued import JointFriction
from gauss.system import System

FRICTION = "viscous", "coulomb"  # of each joint, in this order


@dataclass(frozen=True)
class Regressor:
    """Regressor of one state, or of a batch.

    Parameters
    ----------
    matrix : ndarray, shape (…, k, p)
        Y, generalised forces of unit parameters.
    names : tuple of str
        Names of the p columns: "mass:arm" [kg], "mx:arm", "my:arm", "mz:arm" (mass × centre of mass [kg m]), "Ixx:arm",
        "Iyy:arm", "Izz:arm", "Ixy:arm", "Ixz:arm", "Iyz:arm" (entries of the inertia matrix about the origin of the body
        frame [kg m²]), "viscous:joint" [N m s, N s/m], "coulomb:joint" [N m, N].
    rows : tuple of str
        Names of the k rates: all, or the independent ones.
    parameters : ndarray, shape (p,)
        Values in the scene; viscous friction is zero there, for dampers are loads.
    """

    matrix: np.ndarray
    names: tuple[str, ...]
    rows: tuple[str, ...]
    parameters: np.ndarray


@named_arguments
def regressor(
    system: System | Scene, q, v, acceleration, *, independent: Sequence[str] | None = None, friction: Sequence[str] = ()
) -> Regressor:
    """Regressor of inverse dynamics, projected on independent coordinates where joints close loops.

    Parameters
    ----------
    system : System or Scene
        The system.
    q, v, acceleration : array_like, shape (…, n_q), (…, n_v), (…, n_v)
        Coordinates that meet the constraints, rates and accelerations, of one state or of a batch (n, …). With loops,
        rates and accelerations of dependent joints are those of the constraints, whatever is given.
    independent : sequence of str, optional
        Joints, or rates such as "U.angle1", as many as degrees of freedom; chosen at the start of the scene when not given.
        Without loops, all.
    friction : sequence of str
        Joints, or single rates, with viscous and Coulomb friction.

    Returns
    -------
    Regressor
        Matrix, names of columns and rows, values of the parameters in the scene.

    Raises
    ------
    StateError
        If an argument does not fit, is not finite, or a name is none of the system.

    Examples
    --------
    >>> import gauss
    >>> found = gauss.regressor(gauss.load("pendulum"), [0.0], [0.0], [1.0], friction=["A"])
    >>> found.names[6], round(float(found.matrix[0, 6]), 12), found.matrix.shape
    ('Izz:rod', 1.0, (1, 12))
    """
    model = RegressorModel(system, independent, friction)
    return Regressor(model.matrix(q, v, acceleration), model.names, model.rows, model.parameters)


class RegressorModel:
    """Regressor of a system, before the states.

    Parameters
    ----------
    system, independent, friction
        As of :func:`regressor`.

    Attributes
    ----------
    names, rows : tuple of str
        Names of the columns and rows.
    independent : tuple of str or None
        Independent coordinates of a system with loops.
    places : list of int
        Places of the rows in v.
    """

    def __init__(self, system: System | Scene, independent: Sequence[str] | None = None, friction: Sequence[str] = ()):
        self.system = system = system_of(system, "regressor")
        refuse_motionless(system, "regressor")
        _refuse_prescribed(system.scene)
        given = None if independent is None else name_list(independent, "independent", "names of joints")
        if given is not None:
            fixed_columns(system, given)  # names that are none are refused without loops, too
        self.independent = _independent(system, given) if system.has_closures else None
        self.places = list(range(system.n_v)) if self.independent is None else fixed_columns(system, self.independent)
        self.friction = tuple(fixed_columns(system, name_list(friction, "friction", "names of joints")))
        if len(set(self.friction)) != len(self.friction):
            raise StateError(f"friction: expected different joints, got {', '.join(friction)}.")
        self.rows = tuple(system.coordinates[k] for k in self.places)
        bodies = [f"{kind}:{body}" for body in system.structure.bodies for kind in STANDARD]
        self.names = (*bodies, *(f"{kind}:{system.coordinates[k]}" for k in self.friction for kind in FRICTION))

    @property
    def parameters(self) -> np.ndarray:
        """Values (p,) in the scene."""
        scene = self.system.scene
        dry = {one.joint: one.limit for one in scene.set_valued.values() if isinstance(one, JointFriction)}
        found = [standard_parameters(scene.bodies[name]) for name in self.system.structure.bodies]
        found += [np.array([0.0, _number(dry.get(self.system.coordinates[k], 0.0))]) for k in self.friction]
        return np.concatenate(found)

    @property
    def units(self) -> np.ndarray:
        """Units (p,) of the parameters in the scale of the scene."""
        scale = self.system.scale
        body = scale.mass * scale.length ** np.array([0.0, *[1.0] * 3, *[2.0] * 6])
        joints = [
            scale.energy / scale.coordinates[k] * np.array([scale.time / scale.coordinates[k], 1.0]) for k in self.friction
        ]
        return np.concatenate([*[body] * self.system.structure.n_bodies, *joints])

    @property
    def row_units(self) -> np.ndarray:
        """Units (k,) of the generalised forces in the scale of the scene."""
        scale = self.system.scale
        return scale.energy / scale.coordinates[self.places]

    def matrix(self, q, v, acceleration) -> np.ndarray:
        """Y (…, k, p)."""
        q, v, acceleration = (real_array(part, "regressor: q, v, acceleration") for part in (q, v, acceleration))
        if self.independent is None:
            Y, N = self.system.function("inertial_regressor")(q, v, acceleration), None
        else:
            v = self.rates(q, v)
            functions = self.system.function("inertial_regressor", "null_space", independent=self.independent)
            Y, N = functions(q, v, acceleration)
        if not self.friction:
            return Y
        return np.concatenate([Y, *(self._along(N, k, part) for k in self.friction for part in (v, np.sign(v)))], axis=-1)

    def rates(self, q, v) -> np.ndarray:
        """Rates (…, n_v) that the constraints allow, with those given of the independent coordinates."""
        if self.independent is None:
            return v
        N = self.system.null_space(q, independent=self.independent)
        return np.einsum("...ij,...j->...i", N, v[..., self.places])

    def projected_forces(self, q, forces) -> np.ndarray:
        """Generalised forces (…, k) of forces (…, n_v) of all joints: Nᵀ τ."""
        if self.independent is None:
            return forces
        return np.einsum("...ij,...i->...j", self.system.null_space(q, independent=self.independent), forces)

    def _along(self, N, k: int, force: np.ndarray) -> np.ndarray:
        """Column (…, k, 1) of one entry of forces (…, n_v) of joints."""
        if N is not None:
            return (N[..., k, :] * force[..., k, None])[..., None]
        found = np.zeros((*force.shape, 1))
        found[..., k, 0] = force[..., k]
        return found


def standard_parameters(body: Body) -> np.ndarray:
    """Mass, first moments, inertia matrix (xx, yy, zz, xy, xz, yz) about the origin of the body frame (10,)."""
    (J, R), c = body.principal(), np.array(body.com)
    matrix = R @ np.diag(J) @ R.T + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([body.mass, *(body.mass * c), *np.diag(matrix), matrix[0, 1], matrix[0, 2], matrix[1, 2]])


def _refuse_prescribed(scene: Scene):
    moved = [name for name, one in scene.relations.items() if isinstance(one, Prescribed)]
    if moved:
        raise StateError(f"regressor: {', '.join(moved)} prescribe motions, whose forces are unknown; leave them out.")


def _independent(system: System, given) -> tuple[str, ...]:
    """Independent coordinates of a system with loops: the given ones, or those of its start."""
    chosen = Tangents(system, system.initial_state()).independent_rates
    if given is not None:
        if len(given) != len(chosen):
            raise StateError(f"independent: expected {len(chosen)} coordinates that determine the others, got {given!r}.")
        return tuple(given)
    if not chosen:
        raise StateError(f"regressor: the loops of scene {system.scene.name!r} leave no degree of freedom.")
    return tuple(system.coordinates[k] for k in chosen)


def _number(limit) -> float:
    """Limit of dry friction; zero for a law, which is no parameter."""
    return 0.0 if callable(limit) else limit
