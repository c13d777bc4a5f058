"""Real numbers of twice the precision: unevaluated sums of two doubles, some 32 digits, for arrays.

Sums and products leave their rounding behind without error (Dekker, Numer. Math. 18, 1971, 224; Knuth, TAOCP 2, 4.2.2), so
that the equations of linkages, written once over +, −, ·, / and roots, run on them as they do on doubles.
"""

from fractions import Fraction
from math import factorial

import numpy as np

SPLITTER = 2.0**27 + 1.0  # splits 53 bits into two halves whose products are exact
HALVINGS = 3  # of an angle of at most π/4 before its series is summed: then at most 0.1
TERMS = 13  # of the series of sine and cosine: 0.1²⁶ / 26! is below 1e-52
HALF_PI = "1.5707963267948966192313216916397514420985846996875529104874722961"


class Doubled:
    """Numbers hi + lo with |lo| at most half a unit in the last place of hi.

    Parameters
    ----------
    hi, lo : float or ndarray
        The numbers rounded to doubles, and what is left of them.
    """

    __slots__ = ("hi", "lo")
    __array_ufunc__ = None  # numpy numbers leave the operation to this class

    def __init__(self, hi, lo=0.0):
        self.hi, self.lo = hi, lo

    @property
    def real(self):
        """Real part: itself."""
        return self

    def __add__(self, other):
        if not isinstance(other, REAL):
            return NotImplemented
        hi, lo = _parts(other)
        total, left = _two_sum(self.hi, hi)
        low, lower = _two_sum(self.lo, lo)
        total, left = _fast_sum(total, left + low)
        return Doubled(*_fast_sum(total, left + lower))

    __radd__ = __add__

    def __neg__(self):
        return Doubled(-self.hi, -self.lo)

    def __sub__(self, other):
        return self + -other if isinstance(other, REAL) else NotImplemented

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        if not isinstance(other, REAL):
            return NotImplemented
        hi, lo = _parts(other)
        product, left = _two_product(self.hi, hi)
        return Doubled(*_fast_sum(product, left + (self.hi * lo + self.lo * hi)))

    __rmul__ = __mul__

    def __truediv__(self, other):
        other = other if isinstance(other, Doubled) else Doubled(other)
        quotient = self.hi / other.hi
        rest = self - other * quotient
        second = rest.hi / other.hi
        third = (rest - other * second).hi / other.hi
        return Doubled(*_fast_sum(quotient, second)) + third

    def __rtruediv__(self, other):
        return Doubled(other) / self

    def __pow__(self, exponent):
        if exponent == 2:
            return self * self
        if exponent != 0.5:
            raise ValueError(f"expected the exponent 2 or 0.5, got {exponent!r}.")
        root = np.sqrt(self.hi)
        safe = np.where(root == 0.0, 1.0, root)
        return Doubled(*_fast_sum(root, (self - Doubled(*_two_product(root, root))).hi / (2.0 * safe)))

    def __abs__(self):
        sign = np.where(np.asarray(self.hi) < 0.0, -1.0, 1.0)
        return Doubled(self.hi * sign, self.lo * sign)

    def __ge__(self, other):
        difference = self - other
        return difference.hi >= 0.0

    def rounded(self):
        """The nearest doubles."""
        return self.hi + self.lo


REAL = (Doubled, float, int, np.ndarray, np.floating)  # what these numbers are added to and multiplied with


def cos_sin(angle: Doubled) -> tuple[Doubled, Doubled]:
    """Cosine and sine of angles [rad] up to some thousand turns, to about 31 digits."""
    quarter = np.rint(angle.hi / float(_QUARTER[0]))
    for part in _QUARTER:
        angle = angle - Doubled(*_two_product(quarter, part))
    x = angle * 0.5**HALVINGS
    square = x * x
    less, sine = Doubled(0.0 * x.hi), Doubled(0.0 * x.hi)  # 1 − cos x and sin x, by Horner's rule
    for k in range(TERMS, 0, -1):
        less = (_INVERSE[2 * k] - less) * square
        sine = _INVERSE[2 * k - 1] - sine * square
    sine = sine * x
    for _ in range(HALVINGS):
        less, sine = 2.0 * (sine * sine), 2.0 * (sine * (1.0 - less))
    cosine, turn = 1.0 - less, quarter % 4.0
    odd, down, back = turn % 2.0 == 1.0, turn >= 2.0, (turn == 1.0) | (turn == 2.0)
    return _chosen(odd, sine, cosine, back), _chosen(odd, cosine, sine, down)


def _chosen(where, one: Doubled, other: Doubled, negative) -> Doubled:
    sign = np.where(negative, -1.0, 1.0)
    return Doubled(sign * np.where(where, one.hi, other.hi), sign * np.where(where, one.lo, other.lo))


def _parts(x) -> tuple:
    return (x.hi, x.lo) if isinstance(x, Doubled) else (x, 0.0)


def _two_sum(a, b):
    total = a + b
    shifted = total - a
    return total, (a - (total - shifted)) + (b - shifted)


def _fast_sum(a, b):
    total = a + b
    return total, b - (total - a)


def _two_product(a, b):
    product = a * b
    (a_high, a_low), (b_high, b_low) = _split(a), _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a):
    scaled = SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high


def _expansion(number: Fraction, count: int) -> list[float]:
    """Doubles whose sum is a number to ``count`` times 53 bits."""
    parts = []
    for _ in range(count):
        parts.append(float(number))
        number -= Fraction(parts[-1])
    return parts


_QUARTER = _expansion(Fraction(HALF_PI), 3)
_INVERSE = {n: Doubled(*_expansion(Fraction(1, factorial(n)), 2)) for n in range(1, 2 * TERMS + 1)}
