"""Sine and cosine in LLVM IR, one state or a SIMD vector of states, below 1 ulp.

Argument reduction by π/2 in three parts (Cody and Waite 1980) and the minimax polynomials of the public FDLIBM kernels
(Sun Microsystems 1993, k_sin.c, k_cos.c). The products q·P1 and q·P2 are exact for |x| ≤ 1e5 rad; beyond, each lane calls
the C library, whose argument reduction is exact. A GPU has no such library: there x − q·π/2 is formed by fused multiply–adds
in pairs of doubles, up to |x| = 1e9 rad, and the result is NaN beyond.
"""

from llvmlite import ir

from gauss.codegen.ir_module import DOUBLE, LANE, DeviceModule, in_every_lane, intrinsic, lane_by_lane, vector_of
from gauss.codegen.text_builder import TextBuilder

LARGEST_REDUCED_ANGLE = 1e5  # [rad]: above, the products with P1 and P2 are rounded
TWO_OVER_PI = 0.6366197723675814
P1, P2, P2_TAIL = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
LARGEST_PAIRED_ANGLE = 1e9  # [rad]: above, q is no 32-bit integer
HALF_PI = 1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33  # π/2 as the sum of three doubles
SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


class SinCos:
    """Emitter of the function ``sincos`` of a module for one vector width, of doubles or of vectors of them."""

    def __init__(self, module: ir.Module, kind: ir.Type, width: int):
        self.module, self.kind, self.width = module, kind, width
        self.pair = ir.LiteralStructType([kind, kind])
        self.function = self._write()

    def constant(self, value: float) -> ir.Constant:
        """Constant, the same in every lane."""
        return in_every_lane(DOUBLE, self.width, value)

    def _intrinsic(self, name: str, arguments: int = 1) -> ir.Function:
        return intrinsic(self.module, name, self.kind, arguments)

    def _write(self) -> ir.Function:
        function = ir.Function(self.module, ir.FunctionType(self.pair, [self.kind]), name=f"sincos_{self.width}")
        function.linkage = "internal"
        function.attributes.add("noinline")
        b = TextBuilder(function.append_basic_block("reduce"))
        x = function.args[0]
        sine, cosine = self._polynomials(b, x)
        size = b.call(self._intrinsic("llvm.fabs"), [x])
        # unordered: NaN counts as large and goes to the C library
        large = b.fcmp_unordered(">", size, self.constant(LARGEST_REDUCED_ANGLE))
        some = large
        if self.width > 1:
            bits = b.bitcast(large, ir.IntType(self.width))
            some = b.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))
        with b.if_then(some, likely=False):
            known = self._paired(b, x, size) if isinstance(self.module, DeviceModule) else self._library(b, x)
            exact = zip(known, (sine, cosine), strict=True)
            self._return(b, *(b.select(large, *pair) for pair in exact))  # so that lanes are independent
        self._return(b, sine, cosine)
        return function

    def _return(self, b: ir.IRBuilder, sine, cosine):
        both = b.insert_value(ir.Constant(self.pair, ir.Undefined), sine, 0)
        b.ret(b.insert_value(both, cosine, 1))

    def _polynomials(self, b: ir.IRBuilder, x):
        c = self.constant
        q = b.call(self._intrinsic("llvm.rint"), [b.fmul(x, c(TWO_OVER_PI))])
        t = b.fsub(x, b.fmul(q, c(P1)))
        w = b.fmul(q, c(P2))
        r = b.fsub(t, w)
        lost = b.fsub(b.fmul(q, c(P2_TAIL)), b.fsub(b.fsub(t, r), w))
        y = b.fsub(r, lost)
        return self._reduced(b, q, y, b.fsub(b.fsub(r, y), lost))

    def _reduced(self, b: ir.IRBuilder, q, y, tail):
        """Sine and cosine of q·π/2 + y + tail."""
        z = b.fmul(y, y)
        sine, cosine = self._sine(b, y, tail, z), self._cosine(b, y, tail, z)
        return self._quadrant(b, q, sine, cosine)

    def _paired(self, b: ir.IRBuilder, x, size):
        """Sine and cosine of a large angle without a library; NaN above LARGEST_PAIRED_ANGLE.

        x − q·H₁ is a multiple of the last bits of both and below 1: one fused multiply–add forms it exactly.
        """
        c, fma = self.constant, self._intrinsic("llvm.fma", 3)
        first, second, third = map(c, HALF_PI)
        known = b.fcmp_ordered("<=", size, c(LARGEST_PAIRED_ANGLE))
        x = b.select(known, x, c(0.0))
        q = b.call(self._intrinsic("llvm.rint"), [b.fmul(x, c(TWO_OVER_PI))])
        r = b.call(fma, [b.fneg(q), first, x])
        w = b.fmul(q, second)
        lost = b.fadd(b.call(fma, [q, second, b.fneg(w)]), b.fmul(q, third))
        y = b.fsub(r, w)
        back = b.fsub(y, r)
        off = b.fsub(b.fsub(r, b.fsub(y, back)), b.fadd(w, back))  # r − w − y (Knuth's two-sum)
        tail = b.fsub(off, lost)
        return [b.select(known, found, c(float("nan"))) for found in self._reduced(b, q, y, tail)]

    def _horner(self, b: ir.IRBuilder, z, coefficients):
        fma = self._intrinsic("llvm.fma", 3)
        total = self.constant(coefficients[-1])
        for coefficient in coefficients[-2::-1]:
            total = b.call(fma, [total, z, self.constant(coefficient)])
        return total

    def _sine(self, b: ir.IRBuilder, y, tail, z):
        v, rest = b.fmul(z, y), self._horner(b, z, SIN[1:])
        half = b.fsub(b.fmul(self.constant(0.5), tail), b.fmul(v, rest))
        bracket = b.fsub(b.fsub(b.fmul(z, half), tail), b.fmul(v, self.constant(SIN[0])))
        return b.fsub(y, bracket)

    def _cosine(self, b: ir.IRBuilder, y, tail, z):
        rest = b.fmul(z, self._horner(b, z, COS))
        half = b.fmul(self.constant(0.5), z)
        w = b.fsub(self.constant(1.0), half)
        lost = b.fsub(b.fsub(self.constant(1.0), w), half)
        return b.fadd(w, b.fadd(lost, b.fsub(b.fmul(z, rest), b.fmul(y, tail))))

    def _quadrant(self, b: ir.IRBuilder, q, sine, cosine):
        number = lambda n: in_every_lane(LANE, self.width, n)  # noqa: E731
        # the conversion of a huge q is undefined, but such a lane takes the result of the C library
        k = b.fptosi(q, vector_of(LANE, self.width))
        odd = b.icmp_signed("!=", b.and_(k, number(1)), number(0))
        s, c = b.select(odd, cosine, sine), b.select(odd, sine, cosine)
        negative = b.icmp_signed("!=", b.and_(k, number(2)), number(0))
        s = b.select(negative, b.fneg(s), s)
        negative = b.icmp_signed("!=", b.and_(b.add(k, number(1)), number(2)), number(0))
        return s, b.select(negative, b.fneg(c), c)

    def _library(self, b: ir.IRBuilder, x):
        functions = (intrinsic(self.module, name, DOUBLE, 1) for name in ("llvm.sin", "llvm.cos"))
        return [lane_by_lane(b, self.width, lambda one, code=code: b.call(code, [one]), x) for code in functions]
