"""The system of a scene: indices, constant frames, pattern of the rows, and the functions of the mechanics on it.

The mechanics itself is in :mod:`gauss.dynamics`, above this room; it is handed in as an object of the form
:class:`Dynamics`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np

from gauss.arguments import name_list, real_numbers
from gauss.backends.structure import Structure
from gauss.codegen import IS_CONTENT, Scalar
from gauss.errors import StateError, require
from gauss.scene import Scene
from gauss.shapes import Shaped
from gauss.system.contact_mode import sides, slips
from gauss.system.dynamics_protocol import Dynamics
from gauss.system.explain import explain
from gauss.system.frozen_functions import refuse_changed
from gauss.system.passes import Stage, reduction
from gauss.system.pickling import rebuilding
from gauss.system.placed_elements import BoundLoad, NamedPlaces, PlacedFrame, PlacedJoint
from gauss.system.relations import NO_RELATIONS, Relations, place_relations
from gauss.system.scale import Scale, scale_of
from gauss.system.state import State
from gauss.system.state_functions import StateFunctions
from gauss.system.subsystem import Subsystem
from gauss.versions import FormerAttribute

UNIT_QUATERNION = 1e-6  # error of the length of a quaternion typed with 7 digits, which is normalised; more is a mistake


@dataclass(frozen=True)
class System(NamedPlaces, StateFunctions):
    """Mechanism with indices. Made by :func:`gauss.compile_scene`.

    Parameters
    ----------
    scene : Scene
        The scene it was made from.
    structure : Structure
        Bodies, coordinates, rows.
    Phi : ndarray, shape (6n,)
        Inertias J1, J2, J3 [kg m²] and masses m, m, m [kg] of the bodies.
    joints : tuple of PlacedJoint
        Joints in the order of the scene.
    frames : dict
        Body frames and named frames by name.
    loads : tuple of BoundLoad
        Loads of the scene.
    relations : Relations
        Constraints beyond joints and couplings.
    set_valued : Relations
        Set-valued elements, one row each.
    written : dict of str to str
        Functions that became rows, as text, see :mod:`gauss.system.frozen_functions`.
    dynamics : Dynamics
        Supplier of accelerations and consistent states; a system without it can still be assembled.
    """

    scene: Scene
    structure: Structure
    Phi: np.ndarray
    joints: tuple[PlacedJoint, ...]
    frames: dict[str, PlacedFrame]
    loads: tuple[BoundLoad, ...]
    relations: Relations = field(repr=False, default=NO_RELATIONS)
    set_valued: Relations = field(repr=False, default=NO_RELATIONS)
    written: dict[str, str] = field(repr=False, default_factory=dict)
    dynamics: Dynamics | None = field(repr=False, default=None, metadata={IS_CONTENT: False})

    def __reduce__(self):
        return rebuilding(self)

    def __copy__(self) -> "System":
        made = object.__new__(System)  # with what was computed so far, but for compiled functions
        made.__dict__.update({name: value for name, value in self.__dict__.items() if name not in vars(StateFunctions)})
        return made

    @property
    def mechanics(self) -> Dynamics:
        """Its supplier of the mechanics.

        Raises
        ------
        StateError
            If it was built without.
        """
        if self.dynamics is None:
            raise StateError(f"the system of scene {self.scene.name!r} was built without dynamics; use gauss.compile_scene.")
        return self.dynamics

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the entries of v."""
        return self.structure.coordinates

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return self.joints[-1].q.stop

    @property
    def n_v(self) -> int:
        """Number of rates, p."""
        return self.joints[-1].v.stop

    @cached_property
    def losses(self) -> tuple[str, ...]:
        """Names of non-ideal links, whose reactions differ in direction from their rows."""
        return tuple(self.scene.losses)

    @cached_property
    def nonsmooth(self) -> tuple[str, ...]:
        """Names of unilateral and set-valued elements, losses and backlash: a motion then has events between phases."""
        return tuple(self.scene.nonsmooth)

    @cached_property
    def is_plain(self) -> bool:
        """Whether nothing in it switches, jumps or may change: joints, couplings, and loads without functions or breaks."""
        given = any(bool(bound.functions) or hasattr(bound.load, "breaks") and bound.load.breaks for bound in self.loads)
        given = given or not all(one.is_plain for one in self.scene.inputs.values())
        return not (given or self.scene.relations or self.nonsmooth)

    @cached_property
    def is_flat(self) -> bool:
        """Whether no coordinate is part of a quaternion: rates are then derivatives of coordinates."""
        return not self.quaternions

    @property
    def quaternions(self) -> dict[str, slice]:
        """Slices of unit quaternions (w, x, y, z) among the coordinates, by joint."""
        turning = [joint for joint in self.joints if joint.pair.quaternion is not None]
        return {joint.name: slice(joint.q.start + joint.pair.quaternion, joint.q.stop) for joint in turning}

    @cached_property
    def contacts(self) -> Relations:
        """Gap functions of unilateral constraints, one row each, traced on first access."""
        return place_relations(self, sides(self.scene)) if self.scene.contacts else NO_RELATIONS

    @cached_property
    def slips(self) -> Relations:
        """Tangential velocities at contacts with friction, two rows each, traced on first access."""
        return place_relations(self, slips(self.scene)) if self.scene.contacts else NO_RELATIONS

    @cached_property
    def scale(self) -> Scale:
        """Units of length, time and mass of the scene, to which tolerances are relative."""
        return scale_of(self)

    @property
    def has_closures(self) -> bool:
        """Whether there are constraints outside the spanning tree: loops, couplings, relations."""
        return bool(self.structure.closures)

    @cached_property
    def reduction(self) -> tuple[Stage, ...]:
        """Stages from the whole system to the subsystems that are integrated."""
        return reduction(self)

    @property
    def subsystems(self) -> tuple[Subsystem, ...]:
        """Reduced subsystems in joint coordinates, which move independently."""
        return self.reduction[-1].subsystems

    @cached_property
    def rigid_joints(self) -> tuple[str, ...]:
        """Joints of loops that cannot move: those whose coordinates belong to no subsystem; without those of couplings."""
        if not self.has_closures:
            return ()
        moving = np.zeros(self.n_v, dtype=bool)
        for one in self.subsystems:
            moving[one.v] = True
        coupled = {name for coupling in self.scene.couplings.values() for name in (coupling.driver, coupling.driven)}
        still = (one for one in self.joints if one.pair.n_v and not moving[one.v].any())
        return tuple(one.name for one in still if one.name not in coupled)

    parts = FormerAttribute("subsystems")
    grips = FormerAttribute("set_valued")

    @property
    def is_tree(self) -> bool:
        """Whether no joint closes a loop; couplings and relations may bind the joints."""
        return len(self.structure.tree) == len(self.joints)

    @cached_property
    def closes(self) -> bool:
        """Whether integration can drift off constraints: some subsystem has loops, couplings or relations."""
        return any(subsystem.loop_joints or subsystem.couplings or subsystem.relations for subsystem in self.subsystems)

    @property
    def reference(self) -> State:
        """State at the reference configuration, at rest."""
        q = np.concatenate([joint.pair.reference for joint in self.joints])
        return State(0.0, q, np.zeros(self.n_v))

    def state(self, q=None, v=None, t: Scalar = 0.0) -> State:
        """State with given coordinates and rates, checked but not changed.

        Parameters
        ----------
        q : array_like, shape (n_q,), optional
            Coordinates; the reference configuration when not given.
        v : array_like, shape (n_v,), optional
            Rates; zero when not given.
        t : float
            Time [s].

        Raises
        ------
        StateError
            If a size does not fit, a number or the time is not finite, or a quaternion is not unit.
        """
        q = self._array(q, self.reference.q, "q", "coordinates")
        v = self._array(v, self.reference.v, "v", "rates")
        for name, place in self.quaternions.items():
            length = np.linalg.norm(q[place])
            if abs(length - 1.0) > UNIT_QUATERNION:
                raise StateError(f"q: the quaternion (w, x, y, z) of joint {name!r} has length {length:.6g}, not 1.")
            q[place] /= length
        try:
            time = float(t)  # type: ignore[arg-type]  # a traced time is refused by float()
        except (TypeError, ValueError, OverflowError) as error:
            raise StateError(f"t: expected a time [s], got {t!r}.") from error
        if not isfinite(time):
            raise StateError(f"t: expected a finite time [s], got {time}.")
        return State(time, q, v)

    def _array(self, given, default, name: str, what: str) -> np.ndarray:
        if given is None:
            return default
        array = real_numbers(given)
        if array is None:
            raise StateError(f"{name}: expected {default.size} numbers ({what}), got {given!r}.")
        if array.shape != default.shape or not np.isfinite(array).all():
            raise StateError(
                f"{name}: expected {default.size} finite numbers ({what} of {', '.join(self.coordinates)}), "
                f"got {array if array.shape == default.shape else f'shape {array.shape}'}."
            )
        return array

    def initial_state(self, q=None, v=None, t: Scalar = 0.0, *, keep=None, least_violation: bool = False) -> State:
        """Consistent state, assembled from a rough guess and moved in the mass metric as little as needed.

        Without arguments it is the start of the scene; joints whose start the scene gives keep it, and the others
        follow, if that is possible. Limits of joints are kept.

        Parameters
        ----------
        q, v : array_like, shape (n_q,), (n_v,), optional
            Guess of the coordinates and rates; the start of the scene when neither is given.
        t : float
            Time [s].
        keep : str or sequence of str, optional
            Joints, or single rates such as "U.angle1", whose coordinates and rates must not change.
        least_violation : bool
            With inconsistent constraints, return the state of least residual instead of an error.

        Raises
        ------
        AssemblyError
            If the constraints cannot be met from there. The message names them and their residuals; the error carries the
            closest state, ``.state``.

        Warns
        -----
        InconsistentConstraintsWarning
            If redundant constraints contradict each other by up to 1e-6 of the size of the mechanism.
        """
        if self.written:
            refuse_changed(self)
        given = q is not None or v is not None
        if not given and t == 0.0 and keep is None and not least_violation:
            return self.mechanics.scene_start(self)
        state = self.state(q, v, t) if given else self.start(t)
        kept = (() if given else tuple(self.scene.starts)) if keep is None else name_list(keep, "initial_state: keep")
        return self.mechanics.consistent(self, state, kept, keep is not None, least_violation, given)

    def projected(self, state: State) -> State:
        """Consistent state nearest to a given one, projected onto the constraints in the mass metric.

        Unlike :meth:`initial_state`, which takes a rough guess, it tries no other poses. A state that meets the constraints
        to round-off stays as it is.

        Parameters
        ----------
        state : State
            Coordinates, rates and time.

        Raises
        ------
        AssemblyError
            If the constraints cannot be met from there.
        StateError
            If the state does not fit the system.
        """
        require(state, (State,), "projected")
        return self.mechanics.projected(self, self.state(state.q, state.v, state.t))

    def start(self, t: Scalar = 0.0) -> State:
        """State of the starts of the scene, consistent or not."""
        q, v = self.reference.q, self.reference.v
        for joint in self.joints:
            start = self.scene.starts.get(joint.name)
            if start is not None:
                q[joint.q] = joint.pair.reference if start.position is None else start.position
                v[joint.v] = start.rate
        return self.state(q, v, t)

    def accelerations(self, state: State, load=None) -> Shaped[np.ndarray, " nv"]:
        """Accelerations (n_v,), the rates of v.

        They come from machine code that is made by the first call and checks itself by inverse dynamics; from the certified
        recursion where that fails, or the system is not compiled (see :func:`gauss.dynamics.conditions.obstacles`).

        Parameters
        ----------
        state : State
            Consistent state.
        load : array_like, shape (n_v,), optional
            Generalised forces added to those of the scene [N m, N].

        Raises
        ------
        StateError
            If state or load do not fit.
        SimulationError
            If no accelerations can be certified.
        """
        require(state, (State,), "accelerations")
        refuse_changed(self)
        return self.mechanics.accelerations(self, state, load)

    @property
    def forward_dynamics(self) -> Callable:
        """Compiled function ``f(q, v, load, out=None, t=0.0)``: accelerations (n_v,), less than a microsecond per call.

        Arguments and result are those of :meth:`accelerations`, checked as there, as arrays: coordinates q (n_q,), rates
        v (n_v,), generalised forces (n_v,) added to those of the scene; the result is a new array, or ``out``. Arrays of
        doubles are taken as they are, anything else is converted. Laws of loads are compiled as they are now.

        Raises
        ------
        SimulationError
            If the system cannot be compiled, with the reasons.
        """
        refuse_changed(self)
        return self.mechanics.forward_dynamics(self)

    @property
    def inverse_dynamics(self) -> Callable:
        """Compiled function ``f(q, v, acceleration, out=None, t=0.0)``: generalised forces (n_v,) [N m, N].

        These are what joint accelerations (n_v,) take besides the loads of the scene, M q̈ + h. Where joints close loops,
        the loops are cut there: forces of the constraints are counted in; ``function("inverse_dynamics", independent=…)``
        gives what independent joints take, without these. :func:`gauss.inverse_dynamics` finds forces of drives in loops.
        Arguments are checked as those of :attr:`forward_dynamics`.

        Raises
        ------
        SimulationError
            If a law of a load cannot be compiled, with the reason.
        """
        return self.function("inverse_dynamics")

    @property
    def loop_constraints(self) -> Callable:
        """Compiled function ``f(q, v, out=None, t=0.0)`` → residual c (r,) [rad, m], Jacobian J (r, n_v), bias γ (r,).

        J q̈ = γ. Rows are those of joints that close loops, of couplings, and of further constraints, redundant ones too; J
        multiplies the rates of the tree, those of joints that close loops follow from them.
        """
        return self.function("loop_constraints")

    def explain(self) -> str:
        """Report of the system: bodies, freedoms, loops, loads, plans and reduction."""
        return explain(self)
