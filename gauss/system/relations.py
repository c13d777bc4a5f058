"""Constraints traced once as functions of poses, rates and time, and differentiated: A v + B q̇ = C, A a + B q̈ = D.

The bodies of a relation become independent symbols R, x, W, u, the joints q, q̇. With the rates Ṙ = [W]× R,
ẋ = u, q̇, ṫ = 1 a residual c has the derivative ċ, linear in velocities: A and B are its slopes (∂ċ/∂ω = ∂ċ/∂W R, ω in
principal axes), C = A v + B q̇ − ċ. Where a = 0 and q̈ = 0 also Ẇ = 0 and u̇ = 0, so D = −c̈ with the same rates.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import NamedTuple

import numpy as np

from gauss.codegen import Function, Graph, Kernel, as_number, forward, from_disk, jacobian, substitute
from gauss.codegen.expression import reachable
from gauss.errors import GaussError, SceneError, SimulationError
from gauss.scene.values import is_scalar
from gauss.system.state import View
from gauss.system.symbolic_mechanism import Symbols, symbols_of


class Rows(NamedTuple):
    """Rows of one relation."""

    A: tuple  # (m, 6) block of each body
    B: tuple  # (m, k) block of each joint
    C: np.ndarray  # C, D (m,): right-hand sides
    D: np.ndarray
    gap: np.ndarray  # (m,) position residuals; 0 for velocity rows


@dataclass(frozen=True)
class PlacedRelation:
    """A relation on a system."""

    name: str  # its name
    bodies: tuple[int, ...]  # bodies, joints: those that its rows depend on
    joints: tuple[int, ...]
    size: int  # number of rows
    velocities: int  # number of nonholonomic ones, the last
    moves: bool  # whether C may differ from zero
    is_timed: bool  # whether its residuals depend on time


@dataclass(frozen=True)
class Relations:
    """All relations of a system.

    Parameters
    ----------
    placed : tuple of PlacedRelation
        Their bodies, joints and rows.
    function : Function or None
        All rows as expressions of poses, rates and time; relation by relation the blocks of A, of B, then C, D, gap. None
        without relations.
    bodies, joints : tuple of int
        Bodies and joints whose symbols are the inputs.
    """

    placed: tuple[PlacedRelation, ...]
    function: Function | None
    bodies: tuple[int, ...]
    joints: tuple[int, ...]

    @cached_property
    def kernel(self) -> Kernel:
        """Machine code of all rows."""
        function = self.traced
        return from_disk((Kernel, function), lambda: Kernel(function, batch=False))

    @cached_property
    def asks_time(self) -> bool:
        """Whether any row depends on the time."""
        return self.function is not None and _asks(self.function.outputs, self.function.inputs[-1:])

    @property
    def traced(self) -> Function:
        """The function, of relations that there are."""
        assert self.function is not None
        return self.function

    @property
    def have_power(self) -> bool:
        """Whether constraints prescribe velocities other than zero: their forces have power −λᵀ C."""
        return any(relation.moves for relation in self.placed)

    def values(self, view: View) -> np.ndarray:
        """Outputs of the function, by a view in numbers or expressions."""
        joints = view.system.joints
        parts = [part for b in self.bodies for part in (view.R[b].ravel(), view.x[b], view.W[b], view.u[b])]
        parts += [part for j in self.joints for part in (view.state.q[joints[j].q], view.state.v[joints[j].v])]
        inputs = np.concatenate([*parts, [view.t]])
        return self.traced.inlined(inputs) if inputs.dtype == object else self.kernel(inputs)

    def rows(self, view: View) -> Iterator[Rows]:
        """Rows of each relation, by a view in numbers or expressions.

        Raises
        ------
        SimulationError
            If a law or residual has no finite value there.
        """
        if not self.placed:
            return
        joints, start, values = view.system.joints, 0, self.values(view)
        finite = values.dtype == object or bool(np.isfinite(values).all())
        for relation in self.placed:
            m = relation.size
            shapes = [(m, 6) for _ in relation.bodies] + [(m, joints[j].pair.n_v) for j in relation.joints] + [(m,)] * 3
            blocks = []
            for shape in shapes:
                end = start + prod(shape)
                blocks.append(values[start:end].reshape(shape))
                start = end
            if not finite and not all(np.isfinite(block).all() for block in blocks):
                raise SimulationError(f"constraint {relation.name!r} has no finite value at t = {view.t:.6g} s.")
            n = len(relation.bodies)
            yield Rows(tuple(blocks[:n]), tuple(blocks[n:-3]), *blocks[-3:])


NO_RELATIONS = Relations((), None, (), ())


def place_relations(system, relations) -> Relations:
    """Relations of a scene on its system.

    ``relations``: the relations, of any scene on it.

    SceneError if a residual cannot be traced, or binds nothing.
    """
    graph, placed, outputs = Graph(), list[PlacedRelation](), list[object]()
    bodies: dict[int, tuple] = {}
    joints: dict[int, tuple] = {}
    for relation in relations:
        view = Symbols(system, graph)
        blocks, *about = _traced_rows(relation, view)
        bodies |= view.bodies
        joints |= view.joints
        placed.append(PlacedRelation(relation.name, tuple(view.bodies), tuple(view.joints), *about))
        outputs += [entry for block in blocks for entry in np.ravel(block)]
    return bound_relations(graph, placed, bodies, joints, outputs)


def place_residuals(system, relations) -> Relations:
    """Position residuals of relations, their rates, and velocity residuals, without rows: for monitoring."""
    view = Symbols(system, Graph())
    c = np.array([*(entry for relation in relations for entry in relation.positions(view)), None], dtype=object)[:-1]
    velocities = [entry for relation in relations for entry in relation.velocities(view)]
    moving, rates = view.motion()
    return bound_relations(view.graph, [], view.bodies, view.joints, [*c, *forward(c, moving, rates), *velocities])


def bound_relations(graph: Graph, placed, bodies: dict, joints: dict, outputs) -> Relations:
    """Relations of placed rows over the symbols of bodies and joints of one graph."""
    inputs = symbols_of(bodies, joints, graph.symbol("t"))
    return Relations(tuple(placed), Function("relations", inputs, outputs), tuple(bodies), tuple(joints))


def _traced_rows(relation, view: Symbols):
    """Blocks A of each body, B of each joint, then C, D, gap, as expressions; and the numbers of :class:`PlacedRelation`."""
    c, g = _traced_residuals(relation, view)
    moving, rates = view.motion()
    velocities = view.velocities()
    if _asks(c, velocities):
        raise SceneError(
            f"constraint {relation.name!r}: a residual of positions must not ask for velocities; give it as velocity=."
        )
    rate = np.concatenate([forward(c, moving, rates), g])
    idle = [k for k in range(len(rate)) if not _asks(rate[k : k + 1], velocities)]
    if (idle and not relation.may_be_idle) or not len(rate):
        which = f"row {idle[0] + 1} of {len(rate)}" if idle else "it has no rows and"
        raise SceneError(f"constraint {relation.name!r}: {which} depends on no body and no joint, so nothing can meet it.")
    blocks, C = [], -rate
    for R, _, W, u in view.bodies.values():
        A = np.concatenate([jacobian(rate, W) @ R, jacobian(rate, u)], axis=1)
        blocks.append(A)
        C = C + A @ np.concatenate([R.T @ W, u])
    for _, v in view.joints.values():
        B = jacobian(rate, v)
        blocks.append(B)
        C = C + B @ v
    D = -forward(rate, moving, rates)
    gap = np.concatenate([c, np.zeros(len(g))])
    return [*blocks, C, D, gap], len(rate), len(g), _moves(rate, velocities), _asks([*c, *g], [view.t])


def _moves(rate: np.ndarray, velocities) -> bool:
    """Whether the rates of residuals may differ from zero at rest."""
    try:
        return any(as_number(entry) != 0.0 for entry in substitute(rate, velocities, np.zeros(len(velocities))))
    except TypeError:  # it calls a function
        return True


def _traced_residuals(relation, view: Symbols) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity residuals of a relation as expressions.

    SceneError if its function cannot be traced, or returns something else than numbers.
    """
    try:
        c, g = view.residuals(relation)
    except GaussError as error:
        if repr(relation.name) in str(error):
            raise
        raise SceneError(f"constraint {relation.name!r}: its function raised {type(error).__name__}: {error}") from error
    except Exception as error:
        raise SceneError(
            f"constraint {relation.name!r}: its function cannot be traced ({type(error).__name__}: {error}). Write it with "
            "arithmetic, numpy or gauss.math (no `if` on positions, no math.sin), and return numbers."
        ) from error
    if wrong := [entry for entry in (*c, *g) if not is_scalar(entry)]:
        raise SceneError(f"constraint {relation.name!r}: its function must return numbers, got {wrong[0]!r}.")
    return c, g


def _asks(residuals, symbols) -> bool:
    wanted = {symbol.index for symbol in symbols}
    return any(node.index in wanted for node in reachable(residuals))
