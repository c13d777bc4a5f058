"""Plane vectors as complex numbers z = x + i y: numpy's own for numbers, a pair of expressions for tracing.

The mechanics of linkages is written once over both; it uses +, −, ·, /, ``.real``, ``.imag`` and the functions below.
"""

import numpy as np

from gauss.tracing import Expression


class Traced:
    """Complex number of two expressions."""

    __slots__ = ("real", "imag")
    __array_ufunc__ = None  # numpy numbers leave the operation to this class

    def __init__(self, real, imag):
        self.real, self.imag = real, imag

    def __add__(self, other):
        return Traced(self.real + other.real, self.imag + other.imag)

    __radd__ = __add__

    def __sub__(self, other):
        return Traced(self.real - other.real, self.imag - other.imag)

    def __rsub__(self, other):
        return Traced(other.real - self.real, other.imag - self.imag)

    def __neg__(self):
        return Traced(-self.real, -self.imag)

    def __mul__(self, other):
        if not isinstance(other, Traced | complex):
            return Traced(self.real * other, self.imag * other)
        return Traced(
            self.real * other.real - self.imag * other.imag,
            self.real * other.imag + self.imag * other.real,
        )

    __rmul__ = __mul__

    def __truediv__(self, scalar):
        return Traced(self.real / scalar, self.imag / scalar)


def pair(real, imag):
    """Complex number of two real ones; arrays are broadcast."""
    if isinstance(real, Expression) or isinstance(imag, Expression):
        return Traced(real, imag)
    return real + 1j * imag


def unit(angle):
    """Unit vector u(θ) = e^{iθ}."""
    return pair(np.cos(angle), np.sin(angle))


def conjugate(z):
    """Mirror image in the real axis."""
    return Traced(z.real, -z.imag) if isinstance(z, Traced) else np.conj(z)


def dot(a, b):
    """Scalar product a·b = Re(ā b)."""
    return a.real * b.real + a.imag * b.imag


def cross(a, b):
    """Moment a×b = Im(ā b)."""
    return a.real * b.imag - a.imag * b.real


def left(a):
    """Left normal i a."""
    return Traced(-a.imag, a.real) if isinstance(a, Traced) else 1j * a


def length(a):
    """Length |a|."""
    return (a.real * a.real + a.imag * a.imag) ** 0.5


def angle(a):
    """Angle from +x in (−π, π]."""
    return np.arctan2(a.imag, a.real)
