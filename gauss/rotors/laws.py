"""All torque laws by their names in files, and laws that are Python functions of the user.

A law is evaluated on numbers or traced on expressions, so that a network with traceable laws is compiled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gauss.codegen import Expression, Scalar, branches
from gauss.errors import GaussError
from gauss.rotors.law import LOAD, LOSS, MOTOR, ROLES, Law  # noqa: F401
from gauss.rotors.load_laws import Constant, Dry, Periodic, Quadratic, TorqueTable, Viscous
from gauss.rotors.motor_laws import DC, Diesel, Kloss, Linear
from gauss.scene.stateful_laws import preserved

PROBES = (0.0, 0.7, 0.7, 13.0)  # arguments at which a constant has one value, and in every call


@dataclass(frozen=True)
class TorqueFunction(Law):
    """Python function of (t, angle, speed) that returns a torque [N m].

    Written with the functions of :mod:`gauss.math`, and with ``if``, it is traced and compiled with the network, and its
    switching functions are located. Otherwise it is opaque: its switching times are given as ``breaks=`` of the torque.

    Parameters
    ----------
    function : callable
        f(t, angle, speed) → torque, of [s], [rad], [rad/s] and [N m].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> ramp = rotors.TorqueFunction(lambda t, speed, angle: 4.0 * t)
    >>> fan.torque(motor, ramp).name
    'torque on motor'
    """

    function: Callable

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return called(self.function, t, angle, speed)


def called(function: Callable[..., Any], *arguments: Scalar) -> Any:
    """Value of a function of the user; on expressions, all its branches are traced.

    Raises
    ------
    TypeError
        If it is given expressions and cannot be traced: it fails, keeps something from one call for the next, or returns
        numbers that are not the same in every call.
    """
    if not any(isinstance(argument, Expression) for argument in arguments):
        return function(*arguments)
    try:
        with preserved(function) as kept:
            found = branches(lambda: function(*arguments))
            same = _is_repeated(function, found, arguments)
    except GaussError:
        raise
    except Exception as error:  # a law may fail in any way when it is given symbols
        raise TypeError(f"{type(error).__name__}: {error}") from error
    if kept.changed or not same:
        raise TypeError("it keeps something from one call for the next, or is random")
    return found


def _is_repeated(function: Callable, found: Any, arguments: tuple) -> bool:
    """Whether a function returns a result on expressions again; of a number, whether it is the value at all probes."""
    if isinstance(found, Expression):  # one graph holds each expression once
        return branches(lambda: function(*arguments)) is found
    return all(function(*[probe] * len(arguments)) == found for probe in PROBES)


LAWS: dict[str, type[Law]] = {
    "constant": Constant,
    "viscous": Viscous,
    "quadratic": Quadratic,
    "dry": Dry,
    "linear": Linear,
    "kloss": Kloss,
    "dc": DC,
    "diesel": Diesel,
    "table": TorqueTable,
    "periodic": Periodic,
}
