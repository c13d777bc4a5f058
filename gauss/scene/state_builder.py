"""Builder method of a scene for states of one's own: ẋ = f(t, motion), integrated with the motion.

A state is the rate of a body with a moment of inertia of 1 kg m² that acts on nothing: the compulsion gains ½ (ẋ − f)², the
least of which is the law. So whatever moves mechanisms moves states.
"""

from gauss.scene import values
from gauss.scene.body import Body
from gauss.scene.builder import SceneBuilder
from gauss.scene.joint import Joint
from gauss.scene.loads import Start, StateLaw
from gauss.scene.names import GROUND


class StateBuilder(SceneBuilder):
    """Builder method for states of one's own."""

    def state(self, name: str, rate, start: float = 0.0, breaks=()) -> StateLaw:
        """Add a state x of your own with the law ẋ = rate: a controller, a current, a muscle, a bristle.

        Laws read it as ``motion.rate(name)``, and its integral over time as ``motion.coordinate(name)``; a trajectory,
        outputs of the kind "rate" and linear models have it under its name. It is integrated with the motion, by every
        method and on every route. An input that acts on it, ``scene.input("u", {name: factor})``, adds factor · u to ẋ.

        Parameters
        ----------
        name : str
            Name of the state; no joint has it.
        rate : float or callable
            Its time derivative: a constant, law(t) or law(t, motion), as of a drive.
        start : float
            Value at the start.
        breaks : sequence of float
            Times at which the law switches [s], for one that cannot be traced.

        Returns
        -------
        StateLaw
            What was added, the law of a joint of this name: gauss integrates x as the rate of a body with a moment of
            inertia of 1 kg m² beside the mechanism, which acts on nothing. Energies leave it out.

        Examples
        --------
        >>> import gauss
        >>> scene = gauss.load("pendulum")
        >>> scene.state("filtered", lambda t, at: (at.rate("A") - at.rate("filtered")) / 0.1).joint
        'filtered'
        """
        law = StateLaw(f"rate of {values.text(name, 'name of a state')}", name, rate, None, breaks)
        self._require_new(name, "state", self.joints | self.couplings | self._constraints)
        self._require_new(law.name, "state", self.loads | self._constraints | self.inputs)
        body = self.add(Body(f"state {name}", 0.0, (1.0, 1.0, 1.0), inertia_as_given=True))
        self.add(Joint(name, "revolute", GROUND, body.name))
        self.add(Start(name, rate=values.number(start, f"state {name!r}: start", "1")))
        return self.add(law)

    @property
    def states(self) -> dict[str, StateLaw]:
        """States of one's own by name, see :meth:`state`."""
        return {load.joint: load for load in self.loads.values() if isinstance(load, StateLaw)}
