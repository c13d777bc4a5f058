"""Functions of a state, on a system: mass matrix, forces, frames, Jacobians, momentum, energies; one state or a batch.

Each is called with arrays of coordinates q (…, n_q) and rates v (…, n_v): numpy's, of any strides, or those of other
libraries on the CPU, whose memory is shared (DLPack). Results are new arrays, or ``out``. Machine code is made by the first
call. A function that is kept, ``f = system.mass_matrix``, is called by Python without an intermediate.

| | gauss | Pinocchio | MuJoCo |
|---|---|---|---|
| order of spatial vectors | angular, linear | linear, angular | angular, linear |
| ``"local_world_aligned"`` (default) | world axes, at the origin of the frame | ``LOCAL_WORLD_ALIGNED`` | ``mj_jac`` |
| ``"world"`` | world axes, at the origin of the world | ``WORLD`` | – |
| ``"local"`` | axes and origin of the frame | ``LOCAL`` | – |
| quaternions | (w, x, y, z) | (x, y, z, w) | (w, x, y, z) |
| rates of a free joint | linear: axes of the parent; angular: of the child | both: of the child | as gauss |
| mass matrix | ``mass_matrix(q)`` | ``crba`` | ``mj_fullM`` |
| bias forces, C v + g | ``bias_forces(q, v)`` | ``nonLinearEffects`` | ``qfrc_bias`` |
| gravity | ``gravity_forces(q)`` | ``computeGeneralizedGravity`` | ``qfrc_bias`` at rest |
| Coriolis matrix, Ṁ = C + Cᵀ | ``coriolis_matrix(q, v)`` | ``computeCoriolisMatrix`` | – |
| frame | ``forward_kinematics(q, frame)`` | ``framesForwardKinematics`` | ``xmat``, ``xpos`` |
| its Jacobian | ``jacobian(q, frame)`` | ``computeFrameJacobian`` | ``mj_jac`` |
| and the rate of this | ``jacobian_rate(q, v, frame)`` | ``getFrameJacobianTimeVariation`` | ``mj_jacDot`` |
| momentum about the centre of mass | ``momentum(q, v)`` | ``computeCentroidalMomentum`` | ``subtree_angmom`` |
| accelerations | ``forward_dynamics(q, v, load)`` | ``aba`` | ``mj_forward`` |
| efforts | ``inverse_dynamics(q, v, acceleration)`` | ``rnea`` | ``mj_inverse`` |
| ∂q̈/∂(q, v, τ) | ``acceleration_derivatives(q, v, load)`` | ``computeABADerivatives`` | – |
| ∂q̈/∂p | ``parameter_derivatives("mass:arm")(q, v, load)`` | – | – |
| ∂τ/∂p | ``function("inverse_dynamics_by:mass:arm")(q, v, acceleration)`` | ``computeJointTorqueRegressor`` | – |
| ∂τ/∂(q, v) | ``inverse_dynamics_derivatives(q, v, acceleration)`` | ``computeRNEADerivatives`` | – |

Where joints close loops, coordinates and rates of all joints are arguments, terms are those of the spanning tree, and
columns of joints outside the tree are zero. ``independent=`` names as many joints, or rates such as "U.angle1", as there are
degrees of freedom: v = N ẏ for their rates ẏ, and terms are projected on the constraints: Nᵀ M N, J N.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

from gauss.arguments import name_list
from gauss.errors import ArgumentError

LOCAL_WORLD_ALIGNED = "local_world_aligned"


class CompiledFunction(cached_property):
    """Attribute of a system: a compiled function, made when it is first asked for and kept with the system.

    Parameters
    ----------
    doc : str
        Its description.
    of_frame : bool
        Whether it is a function of a frame.
    """

    def __init__(self, doc: str, of_frame: bool = False):
        super().__init__(self._made)
        self.__doc__, self.of_frame = doc, of_frame

    def _made(self, system) -> Callable:
        """The function of a system."""
        name = str(self.attrname)
        if self.of_frame:
            return FrameFunction(system, name)
        return ConstrainedFunction(system, name) if system.has_closures else system.function(name)


class ConstrainedFunction:
    """Function of a state of a system with loops: ``f(*vectors, independent=None, out=None, t=0.0)``.

    Parameters
    ----------
    system : System
        The system.
    name : str
        Name of the function.
    """

    def __init__(self, system, name: str):
        self.system, self.name = system, name
        self.of_trees = None if name == "null_space" else system.function(name)

    def __call__(self, *vectors, independent=None, **options):
        """Its results, for independent coordinates if these are given."""
        if independent is None and self.of_trees is not None:
            return self.of_trees(*vectors, **options)
        return self.system.function(self.name, independent=independent)(*vectors, **options)


class FrameFunction:
    """Function of a state and a frame: ``f(*vectors, frame, reference=…, independent=None, out=None, t=0.0)``.

    Parameters
    ----------
    system : System
        The system.
    name : str
        Name of the function.
    """

    def __init__(self, system, name: str):
        self.system, self.name = system, name
        self.found: dict[tuple, Callable] = {}  # by frame and axes

    def __call__(self, *arguments, frame=None, reference=LOCAL_WORLD_ALIGNED, independent=None, **options):
        """Its results; the frame is the last of the arguments, or given by name."""
        if frame is None:
            if not arguments or not isinstance(arguments[-1], str):
                names = ", ".join(map(repr, self.system.frames))
                raise ArgumentError(f"{self.name}: expected the name of a frame after the vectors, one of {names}.")
            arguments, frame = arguments[:-1], arguments[-1]
        if independent is not None:
            return self.system.function(f"{self.name}:{frame}", reference=reference, independent=independent)(
                *arguments, **options
            )
        found = self.found.get((frame, reference))
        if found is None:
            found = self.found[frame, reference] = self.system.function(f"{self.name}:{frame}", reference=reference)
        return found(*arguments, **options)


class StateFunctions:
    """Functions of a state of a system; see the table of :mod:`gauss.system.state_functions`."""

    mass_matrix = CompiledFunction(
        "``f(q, independent=None, out=None, t=0.0)``: joint-space inertia M (…, n_v, n_v) [kg m², kg m, kg]."
    )
    bias_forces = CompiledFunction(
        "``f(q, v, independent=None, out=None, t=0.0)``: Coriolis, centrifugal and gravity forces C v + g (…, n_v) [N m, N]."
    )
    gravity_forces = CompiledFunction(
        "``f(q, independent=None, out=None, t=0.0)``: generalised forces g (…, n_v) that hold the bodies at rest [N m, N]."
    )
    coriolis_matrix = CompiledFunction(
        "``f(q, v, independent=None, out=None, t=0.0)``: C (…, n_v, n_v) with C v the velocity forces and Ṁ = C + Cᵀ."
    )
    forward_kinematics = CompiledFunction(
        "``f(q, frame, out=None, t=0.0)``: rotation (…, 3, 3) from a body frame or named frame to world, and its origin "
        "(…, 3) [m].",
        of_frame=True,
    )
    jacobian = CompiledFunction(
        '``f(q, frame, reference="local_world_aligned", independent=None, out=None, t=0.0)``: J (…, 6, n_v); J v is the '
        "angular velocity [rad/s] and the velocity [m/s] of a frame, in the axes and at the point of the reference.",
        of_frame=True,
    )
    jacobian_rate = CompiledFunction(
        '``f(q, v, frame, reference="local_world_aligned", independent=None, out=None, t=0.0)``: time derivative '
        "(…, 6, n_v) of the Jacobian.",
        of_frame=True,
    )
    center_of_mass = CompiledFunction("``f(q, out=None, t=0.0)``: centre of mass of all bodies (…, 3) in world [m].")
    momentum = CompiledFunction(
        "``f(q, v, out=None, t=0.0)``: moment of momentum about the centre of mass [N m s] and momentum [N s] (…, 6), in "
        "world axes."
    )
    momentum_matrix = CompiledFunction(
        "``f(q, independent=None, out=None, t=0.0)``: centroidal momentum matrix A (…, 6, n_v), A v is the momentum."
    )
    kinetic_energy = CompiledFunction("``f(q, v, out=None, t=0.0)``: kinetic energy (…) [J].")
    potential_energy = CompiledFunction("``f(q, out=None, t=0.0)``: potential energy (…) of gravity and springs [J].")
    null_space = CompiledFunction(
        "``f(q, independent=…, out=None, t=0.0)``: N (…, n_v, k), v = N ẏ for the rates ẏ of k independent coordinates."
    )

    @property
    def acceleration_derivatives(self) -> Callable:
        """Compiled function ``f(q, v, load, out=None, t=0.0)``: derivatives of the accelerations, three (…, n_v, n_v).

        By displacements along the rates, by rates and by generalised forces, under the loads of the scene as they are now;
        with loops along the constraints. Where bodies of one loop that are unlike by a thousand or more cost digits, they
        are those of :func:`gauss.derivatives`, in milliseconds.
        """
        return self.function("acceleration_derivatives")

    @property
    def inverse_dynamics_derivatives(self) -> Callable:
        """Compiled function ``f(q, v, acceleration, out=None, t=0.0)``: derivatives of inverse dynamics, two (…, n_v, n_v).

        By displacements along the rates and by rates; that by accelerations is the mass matrix.
        """
        return self.function("inverse_dynamics_derivatives")

    def parameter_derivatives(self, *parameters: str, independent=None) -> Callable:
        """Compiled function ``f(q, v, load, out=None, t=0.0)``: derivatives of the accelerations by parameters.

        Parameters
        ----------
        *parameters : str
            "mass:body" (1), "com:body" (3) in the body frame, "inertia:body" (6: xx, yy, zz, xy, xz, yz) about the centre of
            mass in the axes of the body frame, "gravity" (3); any number of a load, as "stiffness:spring" (1); lengths:
            "parent_at:joint" and "child_at:joint" (3), the joint point in the frame of either body.
        independent : str or sequence of str, optional
            Independent coordinates: the derivatives of their accelerations, at fixed independent coordinates and rates.

        Returns
        -------
        callable
            An array (…, n_v, k) for each parameter of k values, at fixed coordinates and rates; with loops along the
            constraints. A length that changes opens its loops: where coordinates and rates follow, ∂q̈/∂q dq + ∂q̈/∂v dv of
            :attr:`acceleration_derivatives` is to be added; ``independent`` does so. Those of inverse dynamics, the
            regressor, are ``function("inverse_dynamics_by:mass:body", …)``.

        Raises
        ------
        ArgumentError, StateError
            If there is no such parameter, or no derivative.
        """
        return self.function(*(f"accelerations_by:{parameter}" for parameter in parameters), independent=independent)

    def function(
        self, *names: str, reference: str = LOCAL_WORLD_ALIGNED, independent=None, device: str | Sequence[str] | None = None
    ) -> Callable:
        """Compiled function of a state; several names give one function of all, which computes common operations once.

        Parameters
        ----------
        *names : str
            Names of these functions, "inverse_dynamics", "inertial_regressor" or "loop_constraints"; those of frames with
            the frame, as in "jacobian:hand". "forward_dynamics" alone.
        reference : str
            Axes and point of Jacobians: "local_world_aligned", "world" or "local".
        independent : sequence of str, optional
            Joints, or rates such as "U.angle1", as many as degrees of freedom: terms projected on the constraints.
            Derivatives are those of the independent accelerations, or of the efforts that cause them, by displacements
            along the constraints, independent rates and efforts. Given accelerations are all n_v; these are read of them.
        device : str or sequence of str, optional
            "cuda" or "cuda:1": a GPU, a state in a thread; several share a batch, ["cuda:0", "cuda:1"]; "lanes": the same
            code on this CPU. The function ``f(*vectors, t=0.0, stream=None)`` takes batches of this process, and returns
            such; of arrays on the GPU (torch, CuPy, JAX) it reads and returns others, without a copy. "cuda float32"
            computes in single precision: ``f.error`` is the largest difference from double precision, relative to the
            largest result, over some rows of the last call; rows with a larger error than 1 % are repeated on this CPU.

        Returns
        -------
        callable
            ``f(q, out=None, t=0.0)``, with v and acceleration after q where a name needs them; vectors, or batches (n, …) of
            them. It returns the results, in the order of the names.

        Raises
        ------
        ArgumentError
            If there is no such function or reference.
        StateError
            If there is no such frame or joint, or the coordinates cannot be independent.
        DeviceError, MissingPackageError
            If there is no such device, no driver or no cuda-bindings, or a function has no code for a GPU.
        """
        names = name_list(names, "function: names", "names of functions")
        return self.mechanics.function(self, names, reference, independent, device)  # type: ignore[attr-defined]  # of System

    def evaluate(
        self,
        names,
        q,
        v=None,
        acceleration=None,
        load=None,
        *,
        t=0.0,
        reference: str = LOCAL_WORLD_ALIGNED,
        independent=None,
    ) -> dict:
        """Results of several functions of one state, or of a batch, by their names; see :meth:`function`.

        Parameters
        ----------
        names : sequence of str
            Names of functions.
        q, v, acceleration, load : array_like, shape (…, n_q), (…, n_v), (…, n_v), (…, n_v)
            Coordinates, rates, accelerations, generalised forces; those that the functions need.
        t : float or array_like
            Time [s].
        reference, independent
            As of :meth:`function`.
        """
        given = {"q": q, "v": v, "acceleration": acceleration, "load": load}
        names = name_list(names, "evaluate: names", "names of functions")
        return self.mechanics.evaluate(self, names, given, t, reference, independent)  # type: ignore[attr-defined]
