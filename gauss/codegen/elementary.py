"""Exponential, logarithm and arc tangent in LLVM IR, for processors without a C library; below 1, 1 and 2 ulp.

Argument reductions and minimax polynomials of the public FDLIBM kernels (Sun Microsystems 1993, e_exp.c, e_log.c, s_atan.c):
eˣ = 2ᵏ eʳ, |r| ≤ ½ ln 2; ln x = k ln 2 + ln(1 + f), ½√2 < 1 + f < √2; the arc tangent of a quotient up to 1 about 0, ½ or 1.
"""

from collections.abc import Callable

from llvmlite import ir

from gauss.codegen.ir_module import DOUBLE, INTEGER, intrinsic

LN2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # ln 2 as the sum of 33 bits and the rest
LOG2_E = 1.44269504088896338700
LARGEST_EXPONENT = 7.09782712893383973096e02  # of a finite eˣ
SMALLEST_EXPONENT = -7.45133219101941108420e02  # of eˣ above 0
EXP = (
    1.66666666666666019037e-01,
    -2.77777777770155933842e-03,
    6.61375632143793436117e-05,
    -1.65339022054652515390e-06,
    4.13813679705723846039e-08,
)
LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
ATAN = (
    3.33333333333329318027e-01,
    -1.99999999998764832476e-01,
    1.42857142725034663711e-01,
    -1.11111104054623557880e-01,
    9.09088713343650656196e-02,
    -7.69187620504482999495e-02,
    6.66107313738753120669e-02,
    -5.83357013379057348645e-02,
    4.97687799461593236017e-02,
    -3.65315727442169155270e-02,
    1.62858201153657823623e-02,
)
ATAN_HALF = 4.63647609000806093515e-01, 2.26987774529616870924e-17  # arc tangent of ½ and its rest
ATAN_ONE = 7.85398163397448278999e-01, 3.06161699786838301793e-17
PI = 3.141592653589793116, 1.2246467991473531772e-16
TWO_54 = 18014398509481984.0  # by which a subnormal number becomes a normal one
MANTISSA, HALF_UP, ONE_BITS = (1 << 52) - 1, 0x95F64 << 32, 0x3FF << 52


def elementary(module: ir.Module, name: str) -> ir.Function:
    """Function "exp" or "log" of one number, or "atan2" of two, written once for each module."""
    known = module.globals.get(f"elementary_{name}")
    return known or _Elementary(module, name).function


class _Elementary:
    """Emitter of one function."""

    def __init__(self, module: ir.Module, name: str):
        writers: dict[str, Callable] = {"exp": self._exp, "log": self._log, "atan2": self._atan2}
        kind = ir.FunctionType(DOUBLE, [DOUBLE] * (2 if name == "atan2" else 1))
        self.module, self.function = module, ir.Function(module, kind, f"elementary_{name}")
        self.function.linkage = "internal"
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.b.ret(writers[name](*self.function.args))

    def _call(self, name: str, *given):
        return self.b.call(intrinsic(self.module, name, DOUBLE, len(given)), given)

    def _horner(self, x, coefficients):
        total = DOUBLE(coefficients[-1])
        for coefficient in coefficients[-2::-1]:
            total = self._call("llvm.fma", total, x, DOUBLE(coefficient))
        return total

    def _power_of_two(self, exponent):
        """2 to a whole number from -1022 to 1023."""
        b = self.b
        return b.bitcast(b.shl(b.add(exponent, INTEGER(1023)), INTEGER(52)), DOUBLE)

    def _exp(self, x):
        b = self.b
        not_above, not_below = (
            b.fcmp_ordered(relation, x, DOUBLE(bound))
            for relation, bound in (("<=", LARGEST_EXPONENT), (">=", SMALLEST_EXPONENT))
        )
        inside = b.and_(not_above, not_below)
        near = b.select(inside, x, DOUBLE(0.0))
        k = self._call("llvm.rint", b.fmul(near, DOUBLE(LOG2_E)))
        high, low = b.fsub(near, b.fmul(k, DOUBLE(LN2[0]))), b.fmul(k, DOUBLE(LN2[1]))
        r = b.fsub(high, low)
        t = b.fmul(r, r)
        c = b.fsub(r, b.fmul(t, self._horner(t, EXP)))
        y = b.fsub(DOUBLE(1.0), b.fsub(b.fsub(low, b.fdiv(b.fmul(r, c), b.fsub(DOUBLE(2.0), c))), high))
        whole = b.fptosi(k, INTEGER)
        half = b.ashr(whole, INTEGER(1))  # in two steps: 2ᵏ alone may be too large, or subnormal
        found = b.fmul(b.fmul(y, self._power_of_two(half)), self._power_of_two(b.sub(whole, half)))
        beyond = b.select(b.fcmp_ordered(">", x, DOUBLE(0.0)), DOUBLE(float("inf")), DOUBLE(0.0))
        beyond = b.select(b.fcmp_unordered("uno", x, x), x, beyond)
        return b.select(inside, found, beyond)

    def _log(self, x):
        b = self.b
        tiny = b.fcmp_ordered("<", x, DOUBLE(2.2250738585072014e-308))
        scaled = b.select(tiny, b.fmul(x, DOUBLE(TWO_54)), x)
        bits = b.bitcast(scaled, INTEGER)
        mantissa = b.and_(bits, INTEGER(MANTISSA))
        up = b.and_(b.add(mantissa, INTEGER(HALF_UP)), INTEGER(1 << 52))  # above √2 the exponent is one more
        normal = b.bitcast(b.or_(mantissa, b.xor(up, INTEGER(ONE_BITS))), DOUBLE)
        exponent = b.sub(b.add(b.ashr(bits, INTEGER(52)), b.lshr(up, INTEGER(52))), INTEGER(1023))
        k = b.fsub(b.sitofp(exponent, DOUBLE), b.select(tiny, DOUBLE(54.0), DOUBLE(0.0)))
        f = b.fsub(normal, DOUBLE(1.0))
        s = b.fdiv(f, b.fadd(DOUBLE(2.0), f))
        z = b.fmul(s, s)
        R = b.fmul(z, self._horner(z, LOG))
        square = b.fmul(b.fmul(DOUBLE(0.5), f), f)
        rest = b.fadd(b.fmul(s, b.fadd(square, R)), b.fmul(k, DOUBLE(LN2[1])))
        found = b.fsub(b.fmul(k, DOUBLE(LN2[0])), b.fsub(b.fsub(square, rest), f))
        regular = b.and_(b.fcmp_ordered(">", x, DOUBLE(0.0)), b.fcmp_ordered("<", x, DOUBLE(float("inf"))))
        other = b.select(b.fcmp_ordered("<", x, DOUBLE(0.0)), DOUBLE(float("nan")), x)  # infinity and NaN stay
        other = b.select(b.fcmp_ordered("==", x, DOUBLE(0.0)), DOUBLE(float("-inf")), other)
        return b.select(regular, found, other)

    def _atan2(self, y, x):
        b = self.b
        width, height = self._call("llvm.fabs", x), self._call("llvm.fabs", y)
        steep = b.fcmp_ordered(">", height, width)
        small, large = b.select(steep, width, height), b.select(steep, height, width)
        ratio = b.fdiv(small, large)
        ratio = b.select(b.fcmp_ordered("==", large, DOUBLE(0.0)), DOUBLE(0.0), ratio)
        ratio = b.select(b.fcmp_ordered("==", small, DOUBLE(float("inf"))), DOUBLE(1.0), ratio)
        angle = self._atan(ratio)
        angle = b.select(steep, b.fsub(DOUBLE(PI[0] / 2), b.fsub(angle, DOUBLE(PI[1] / 2))), angle)
        negative = b.icmp_signed("<", b.bitcast(x, INTEGER), INTEGER(0))  # minus zero, too
        angle = b.select(negative, b.fsub(DOUBLE(PI[0]), b.fsub(angle, DOUBLE(PI[1]))), angle)
        found = self._call("llvm.copysign", angle, y)
        return b.select(b.fcmp_unordered("uno", x, y), b.fadd(x, y), found)

    def _atan(self, q):
        """Arc tangent of a number from 0 to 1."""
        b = self.b
        near = b.fcmp_ordered("<", q, DOUBLE(7.0 / 16.0))
        middle = b.fcmp_ordered("<", q, DOUBLE(11.0 / 16.0))
        about_half = b.fdiv(b.fsub(b.fmul(DOUBLE(2.0), q), DOUBLE(1.0)), b.fadd(DOUBLE(2.0), q))
        about_one = b.fdiv(b.fsub(q, DOUBLE(1.0)), b.fadd(q, DOUBLE(1.0)))
        r = b.select(near, q, b.select(middle, about_half, about_one))
        z = b.fmul(r, r)
        lost = b.fmul(r, b.fmul(z, self._horner(z, ATAN)))
        high, low = (b.select(middle, DOUBLE(half), DOUBLE(one)) for half, one in zip(ATAN_HALF, ATAN_ONE, strict=True))
        return b.select(near, b.fsub(r, lost), b.fsub(high, b.fsub(b.fsub(lost, low), r)))
