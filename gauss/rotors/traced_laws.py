"""Torque laws and traction characteristics of a network, traced as expressions of (t, θ, w); opaque ones by name."""

from collections.abc import Callable

from gauss.codegen import Expression, Graph, Scalar, reachable
from gauss.rotors.elements import Torque
from gauss.rotors.friction_links import FrictionDrive
from gauss.rotors.laws import DC, Constant, Kloss, Linear, Periodic, Quadratic, Viscous
from gauss.rotors.mechanics import link_kinematics
from gauss.rotors.reduced import ReducedNetwork
from gauss.rotors.traction import Hyperbola, symmetric_slip

SMOOTH = (Constant, Viscous, Quadratic, Linear, Kloss, DC, Periodic)  # laws without conditions


class TracedLaws:
    """Torques and characteristics of a network as expressions of (t, θ, w); opaque ones by name.

    Attributes
    ----------
    t : Expression
        Time.
    theta, w : ndarray of Expression, shape (n_g,)
        Angles since the start [rad] and speeds [rad/s] of the roots.
    outputs : dict of str to Expression
        Torques by name of their element.
    own : set of int
        Indices of expressions of the network itself, whose conditions are located as events.
    opaque : dict of str to Torque or None
        Terms with opaque laws by name; None for a characteristic.
    """

    def __init__(self, reduced: ReducedNetwork):
        graph, n_g = Graph(), reduced.n_groups
        self.t, self.theta, self.w = graph.symbol("t"), graph.symbols("theta", n_g), graph.symbols("w", n_g)
        self.outputs: dict[str, Expression] = {}
        self.opaque: dict[str, Torque | None] = {}
        self.own: set[int] = set()
        self.reduced = reduced
        for term in reduced.terms:
            if not isinstance(term.law, SMOOTH):
                j = reduced.names.index(term.shaft)
                self._keep(term.name, term, lambda term=term, j=j: term.law(self.t, self._angle(j), self._speed(j)))
        for b, link in enumerate(reduced.links):
            if isinstance(link, FrictionDrive) and not isinstance(link.curve, Hyperbola):
                slip = self._slip(b)
                self.own |= {node.index for node in reachable([slip])}
                self._keep(link.name, None, lambda link=link, slip=slip: link.curve(slip, 1.0))

    def _angle(self, j: int) -> Scalar:
        g = self.reduced.group[j]
        return float(self.reduced.angle[j]) + float(self.reduced.K[j]) * self.theta[g]

    def _speed(self, j: int) -> Scalar:
        return float(self.reduced.K[j]) * self.w[self.reduced.group[j]]

    def _slip(self, b: int) -> Scalar:
        shafts = self.reduced.driver[b], self.reduced.driven[b]
        ends = link_kinematics(
            self.reduced, b, self.t, {j: self._angle(j) for j in shafts}, {j: self._speed(j) for j in shafts}
        )
        return symmetric_slip(ends.v_d, ends.v, ends.v_0)

    def _keep(self, name: str, term: Torque | None, evaluate: Callable) -> None:
        try:
            found = evaluate()
        except TypeError:
            self.opaque[name] = term
            return
        if isinstance(found, Expression):
            self.outputs[name] = found
