"""Plane vectors as complex numbers z = x + i y: numpy's own for doubles, a pair of expressions or of doubled numbers else.

The mechanics of linkages is written once over all of them; it uses +, −, ·, /, ``.real``, ``.imag``, ``.conjugate()``,
``abs`` and the functions below.
"""

import numpy as np

from gauss.codegen import Expression
from gauss.linkages.doubled import Doubled, cos_sin


class Cartesian:
    """Complex number of two expressions, or of two numbers in twice the precision."""

    __slots__ = ("real", "imag")
    __array_ufunc__ = None  # numpy numbers leave the operation to this class

    def __init__(self, real, imag):
        self.real, self.imag = real, imag

    def __add__(self, other):
        return Cartesian(self.real + other.real, self.imag + other.imag)

    __radd__ = __add__

    def __sub__(self, other):
        return Cartesian(self.real - other.real, self.imag - other.imag)

    def __rsub__(self, other):
        return Cartesian(other.real - self.real, other.imag - self.imag)

    def __neg__(self):
        return Cartesian(-self.real, -self.imag)

    def __mul__(self, other):
        if not _is_complex(other):
            return Cartesian(self.real * other, self.imag * other)
        return Cartesian(
            self.real * other.real - self.imag * other.imag,
            self.real * other.imag + self.imag * other.real,
        )

    __rmul__ = __mul__

    def __truediv__(self, scalar):
        return Cartesian(self.real / scalar, self.imag / scalar)

    def __abs__(self):
        return length(self)

    def conjugate(self):
        """Mirror image in the real axis."""
        return Cartesian(self.real, -self.imag)


def pair(real, imag):
    """Complex number of two real ones; arrays are broadcast."""
    if isinstance(real, Expression | Doubled) or isinstance(imag, Expression | Doubled):
        return Cartesian(real, imag)
    return real + 1j * imag


def unit(angle):
    """Unit vector u(θ) = e^{iθ}."""
    return Cartesian(*cos_sin(angle)) if isinstance(angle, Doubled) else pair(np.cos(angle), np.sin(angle))


def conjugate(z):
    """Mirror image in the real axis."""
    return z.conjugate() if isinstance(z, Cartesian) else np.conj(z)


def dot(a, b):
    """Scalar product a·b = Re(ā b)."""
    return a.real * b.real + a.imag * b.imag


def cross(a, b):
    """Moment a×b = Im(ā b)."""
    return a.real * b.imag - a.imag * b.real


def left(a):
    """Left normal i a."""
    return Cartesian(-a.imag, a.real) if isinstance(a, Cartesian) else 1j * a


def length(a):
    """Length |a|."""
    return (a.real * a.real + a.imag * a.imag) ** 0.5


def angle(a):
    """Angle from +x in (−π, π]."""
    return np.arctan2(a.imag, a.real)


def rounded(z):
    """The nearest doubles of a real or complex number in twice the precision; anything else as it is."""
    if isinstance(z, Cartesian) and not isinstance(z.real, Expression) and not isinstance(z.imag, Expression):
        return rounded(z.real) + 1j * rounded(z.imag)
    return z.rounded() if isinstance(z, Doubled) else z


def _is_complex(z) -> bool:
    return isinstance(z, Cartesian | complex) or (isinstance(z, np.ndarray) and z.dtype.kind == "c")
