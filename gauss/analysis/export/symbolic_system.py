"""Terms of the spanning tree of a system with symbols for masses, moments of inertia, lengths and constants of loads.

Each link keeps the inertia of its own body, m and J about the centre of mass, and the frame in which machine code has most
zeros (:mod:`gauss.dynamics.link_frames`): what is zero stays zero, every other number has the name of its body.
"""

from dataclasses import fields, replace

import numpy as np

from gauss.analysis.export.exported_function import ExportedFunction, without_calls
from gauss.codegen import Graph, write
from gauss.dynamics.given_link_frames import GivenLinkFrames, own_inertia, ungrouped
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.link_frames import Link
from gauss.dynamics.parameters import changed
from gauss.dynamics.rnea import KinematicTree
from gauss.dynamics.state_terms import StateTerms
from gauss.dynamics.traced_system import applied_loads
from gauss.errors import SimulationError
from gauss.rotations import AXIS_NAMES
from gauss.scene import Drive, ElasticLink, JointSpring
from gauss.system import BoundLoad, State, System, whole

ZERO = 1e-12  # numbers below this share of the unit of the scene are round-off of rotated axes
OF_JOINTS = (Drive, ElasticLink, JointSpring)  # loads that act along coordinates, whatever the lengths
TERMS_OF_TREES = ("mass_matrix", "bias_forces", "gravity_forces", "coriolis_matrix", "kinetic_energy", "inverse_dynamics")


class SymbolicTerms(StateTerms):
    """Terms of a system in one state, whose numbers are symbols.

    Parameters
    ----------
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates, symbols.
    """

    def __init__(self, system: System, subsystem: GivenLinkFrames, q, v):
        super().__init__(system, q, v)
        still = KinematicTree(subsystem, q, np.zeros(system.n_v))
        self.__dict__.update(tree=KinematicTree(subsystem, q, v), still=still)


def has_symbols(system: System, name: str) -> bool:
    """Whether a function has symbols for all numbers that it depends on."""
    along = all(isinstance(bound.load, OF_JOINTS) for bound in system.loads)
    return name in TERMS_OF_TREES and (along or name != "inverse_dynamics")


def in_symbols(system: System, name: str) -> tuple[ExportedFunction, dict[str, float]]:
    """Function of a system in symbols, and the values of the symbols; the last inputs of the graph are these symbols.

    The names are "m_rod" [kg], "J_rod_x" [kg m²] about principal axes, "c_rod_x" [m] from the joint to the centre of mass,
    "l_rod_x" [m] from the joint of the inner body to that of the body, in link frames, "g" [m/s²], and those of constants of
    loads as "stiffness_spring".

    SimulationError if the law of a load cannot be traced.
    """
    names, laws = _Symbols(system), Laws(system)
    if laws.reasons:
        raise SimulationError(f"scene {system.scene.name!r} cannot be exported: opaque laws of {', '.join(laws.reasons)}.")
    subsystem = _with_symbols(ungrouped(whole(system)), names)
    loads = [BoundLoad(names.of_load(bound.load), bound.laws) for bound in laws.traced]

    def values(q, v, acceleration, t):
        terms = SymbolicTerms(system, subsystem, q, v)
        if name != "inverse_dynamics":
            return getattr(terms, name)
        return terms.tree.inverse_dynamics(acceleration) - applied_loads(system, loads, State(t[0], q, v))[0]

    n = system.n_v
    inputs = {"q": (system.n_q,), "v": (n,), "acceleration": (n,), "t": ()}
    shapes = {"mass_matrix": (n, n), "coriolis_matrix": (n, n), "kinetic_energy": ()}
    result = "load" if name == "inverse_dynamics" else "result"
    traced = without_calls(write(values, system.n_q, n, n, 1, name=name))
    return ExportedFunction(name, traced, inputs, {result: shapes.get(name, (n,))}), names.values


class _Symbols:
    """Symbols of a system, and their values."""

    def __init__(self, system: System):
        self.graph = Graph(shared=True)
        self.values: dict[str, float] = {}
        self.size = system.scale.length

    def symbol(self, name: str, value: float):
        """Symbol of a number; zero stays zero."""
        if abs(value) <= ZERO * self.size:
            return 0.0
        self.values[name] = float(value)
        return self.graph.symbol(name)

    def vector(self, name: str, values) -> np.ndarray:
        """Symbols of the components of a vector."""
        return np.array(
            [self.symbol(f"{name}_{axis}", value) for axis, value in zip(AXIS_NAMES, values, strict=True)], dtype=object
        )

    def of_load(self, load):
        """Load with symbols for its constants."""
        constants = {f.name: getattr(load, f.name) for f in fields(load) if isinstance(getattr(load, f.name), float)}
        return changed(load, {key: self.symbol(f"{key}_{load.name}", value) for key, value in constants.items() if value})


def _with_symbols(subsystem: GivenLinkFrames, names: _Symbols) -> GivenLinkFrames:
    """Subsystem with symbols for the numbers of its links and gravity."""
    Phi = subsystem.Phi.astype(object)
    links = dict(subsystem.links)
    for body, name in enumerate(subsystem.names):
        moments = names.vector(f"J_{name}", subsystem.Phi[6 * body : 6 * body + 3])
        mass = names.symbol(f"m_{name}", subsystem.Phi[6 * body + 3])
        Phi[6 * body : 6 * body + 6] = [*moments, mass, mass, mass]
        if body in links:
            links[body] = _link(links[body], name, Phi[6 * body : 6 * body + 6], names)
    size = float(np.linalg.norm(subsystem.gravity))
    gravity = subsystem.gravity / size * names.symbol("g", size) if size else subsystem.gravity
    return replace(subsystem, Phi=Phi, links=links, gravity=gravity)


def _link(link: Link, name: str, Phi, names: _Symbols) -> Link:
    """Link with symbols; its axes stay numbers."""
    R_central = _turn(link.R_central)
    centre = names.vector(f"c_{name}", -(R_central.T @ link.p_central))
    placed = link._replace(
        R=_turn(link.R),
        turn=_turn(link.turn),
        p=names.vector(f"l_{name}", link.p),
        R_central=R_central,
        p_central=-(R_central @ centre),
    )
    return own_inertia(placed, Phi)


def _turn(R: np.ndarray) -> np.ndarray:
    """Rotation without round-off of its zeros."""
    return np.where(np.abs(R) <= ZERO, 0.0, R)
