"""Base of the torque laws M(t, α, ω) of a shaft, written over numbers or expressions."""

from gauss.codegen import Scalar
from gauss.scene import values

MOTOR, LOAD, LOSS = ROLES = ("motor", "load", "loss")


class Law:
    """Torque law of a shaft, a function of time [s], angle [rad] and speed [rad/s]."""

    @property
    def role(self) -> str:
        """Default of the account that its work belongs to: "motor", "load" or "loss"."""
        return LOAD

    @property
    def no_load(self) -> float | None:
        """No-load speed of a motor [rad/s]."""
        return None

    @property
    def kinks(self) -> tuple[float, ...]:
        """Speeds at which the slope of the law is discontinuous [rad/s]."""
        return ()

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        raise NotImplementedError


class MotorLaw(Law):
    """Torque law of a motor."""

    @property
    def role(self) -> str:
        """Motors are accounted for as input."""
        return MOTOR


ANY: dict[str, bool] = {}
POSITIVE, NOT_NEGATIVE = {"positive": True}, {"non_negative": True}


def check_fields(law: Law, **rules: tuple[str, dict[str, bool]]) -> None:
    """Keep fields of a law as finite floats.

    SceneError if a field is no finite number of this sign.

    Parameters
    ----------
    law : Law
        The law, a frozen dataclass.
    **rules : (str, dict)
        Unit and sign of each field.
    """
    for key, (unit, sign) in rules.items():
        checked = values.number(getattr(law, key), f"law {type(law).__name__.lower()!r}: {key}", unit, **sign)
        values.keep(law, **{key: checked})
