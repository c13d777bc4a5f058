"""Body of a C99 function from a traced graph: one statement for each operation, in the order of our own machine code.

Sums of products are reassociated and contracted as by :mod:`gauss.codegen.schedule`, so that a C compiler rounds as our code
does where the machine has fused multiply–adds. Sines and cosines are the polynomials of :mod:`gauss.codegen.sincos`, in C
without a branch before the end: compilers vectorise them over the angles of a mechanism.
"""

from collections.abc import Iterator
from math import isinf, isnan, nan

from gauss.analysis.export.exported_function import ExportedFunction
from gauss.codegen import LOOKUPS, Column, Expression, schedule
from gauss.codegen.graph import COMPARISONS
from gauss.codegen.sincos import COS, LARGEST_REDUCED_ANGLE, P1, P2, P2_TAIL, SIN, TWO_OVER_PI

ROUND = 6755399441055744.0  # 3·2⁵¹: a double of this size has no fractional bits, so adding and subtracting it rounds
OPERATIONS = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "neg": "-{}",
    "sqrt": "sqrt({})",
    "exp": "exp({})",
    "log": "log({})",
    "floor": "floor({})",
    "atan2": "atan2({}, {})",
    "min": "{1} < {0} || {1} != {1} ? {1} : {0}",
    "max": "{0} < {1} || {1} != {1} ? {1} : {0}",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "select": "{} ? {} : {}",
    "fma": "GAUSS_FMA({}, {}, {})",
    "fms": "GAUSS_FMA({}, {}, -{})",
    "fnma": "GAUSS_FMA(-{}, {}, {})",
}
LETTERS = {"sin": "s", "cos": "c"}  # of the arrays of sines and cosines


def c_number(value: float) -> str:
    """Literal of a number, exact; negative ones in parentheses."""
    if isnan(value):
        return "NAN"
    found = "INFINITY" if isinf(value) else repr(abs(float(value)))
    return f"(-{found})" if value < 0.0 else found


def _horner(names: tuple[float, ...]) -> str:
    """Polynomial in z by fused multiply–adds."""
    total = c_number(names[-1])
    for coefficient in names[-2::-1]:
        total = f"GAUSS_FMA({total}, z, {c_number(coefficient)})"
    return total


PRELUDE = f"""#ifdef FP_FAST_FMA
#define GAUSS_FMA(x, y, z) fma(x, y, z)
#else
#define GAUSS_FMA(x, y, z) ((x) * (y) + (z))
#endif

/* numbers of an ascending array that lie below x, by bisection; n + 1 if x is not a number */
static inline int gauss_row(int n, const double *breaks, double x)
{{
    int row = 0;
    if (x != x)
        return n + 1;
    while (n > 0) {{
        const int half = n / 2, below = breaks[row + half] < x;
        row += below ? half + 1 : 0;
        n = below ? n - half - 1 : half;
    }}
    return row;
}}

/* sines and cosines of n angles [rad]: argument reduction of Cody and Waite, polynomials of FDLIBM */
static inline void gauss_sincos(int n, const double *x, double *s, double *c)
{{
    for (int k = 0; k < n; ++k) {{
        const double q = (x[k] * {TWO_OVER_PI!r} + {ROUND!r}) - {ROUND!r};
        const double p = x[k] - q * {P1!r}, w = q * {P2!r}, r = p - w;
        const double lost = q * {P2_TAIL!r} - ((p - r) - w), y = r - lost;
        const double tail = (r - y) - lost, z = y * y, u = z * y;
        const double half = 0.5 * tail - u * ({_horner(SIN[1:])});
        const double sine = y - ((z * half - tail) - u * {c_number(SIN[0])});
        const double h = 0.5 * z, d = 1.0 - h;
        const double cosine = d + (((1.0 - d) - h) + (z * (z * ({_horner(COS)})) - y * tail));
        /* q modulo 4 in doubles: a vector of them needs no conversion */
        const double m = q - 4.0 * (((q * 0.25 - 0.375) + {ROUND!r}) - {ROUND!r});
        const int odd = (m == 1.0) | (m == 3.0);
        const double a = odd ? cosine : sine, b = odd ? sine : cosine;
        s[k] = m >= 2.0 ? -a : a;
        c[k] = (m == 1.0) | (m == 2.0) ? -b : b;
    }}
    for (int k = 0; k < n; ++k)
        if (!(fabs(x[k]) <= {LARGEST_REDUCED_ANGLE!r})) {{
            s[k] = sin(x[k]);
            c[k] = cos(x[k]);
        }}
}}
"""


class CBody:
    """Statements of one function."""

    def __init__(self, exported: ExportedFunction):
        self.schedule = schedule(exported.function)
        self.names: dict[int, str] = {}
        places = _places(exported.inputs)
        for symbol, place in zip(self.schedule.inputs, places, strict=True):
            self.names[symbol.index] = place
        self.angles: dict[int, str] = {}  # places of their sines and cosines
        self.columns: set[Column] = set()  # whose arrays are written
        self.stores: dict[int, list[str]] = {}
        self.constant_stores: list[str] = []
        for place, output in zip(_places(exported.outputs), self.schedule.outputs, strict=True):
            if isinstance(output, Expression) and not (output.is_constant or output.index in self.names):
                self.stores.setdefault(output.index, []).append(place)
            else:
                self.constant_stores.append(f"{place} = {self._value(output)};")

    def statements(self) -> Iterator[str]:
        """Statements in order."""
        turned = {x.operands[0].index: x.operands[0] for x in self.schedule.nodes if x.op in LETTERS}
        yield from self._sines([angle for angle in turned.values() if angle.op == "symbol"])
        for node in self.schedule.nodes:
            if node.op not in ("symbol", "constant"):
                yield from self._operation(node)
            yield from (f"{place} = {self._value(node)};" for place in self.stores.get(node.index, ()))
        yield from self.constant_stores

    def _operation(self, node: Expression) -> Iterator[str]:
        """Statements of one operation."""
        if node.op in LETTERS:
            (angle,) = node.operands
            if angle.index not in self.angles:
                yield from self._sines([angle])
            self.names[node.index] = f"{LETTERS[node.op]}{self.angles[angle.index]}"
            return
        if node.op in LOOKUPS:
            yield from self._lookup(node)
            return
        kind = "int" if node.op in COMPARISONS else "double"
        self.names[node.index] = f"x{node.index}"
        yield f"const {kind} x{node.index} = {OPERATIONS[node.op].format(*map(self._value, node.operands))};"

    def _lookup(self, node: Expression) -> Iterator[str]:
        """Statements that look up a row or an entry in a table."""
        column, x = node.value, self._value(node.operands[0])
        name, size = column.name, column.numbers.size
        if column not in self.columns:
            self.columns.add(column)
            yield f"static const double {name}[{size + 1}] = {{{', '.join(map(c_number, [*column.numbers, nan]))}}};"
        found = f"gauss_row({size}, {name}, {x})" if node.op == "row" else f"{name}[{x}]"
        self.names[node.index] = f"x{node.index}"
        yield f"const {'int' if node.op == 'row' else 'double'} x{node.index} = {found};"

    def _sines(self, angles: list[Expression]) -> Iterator[str]:
        """Sines and cosines of several angles in one call."""
        if not angles:
            return
        name, n = f"{angles[0].index}", len(angles)
        self.angles.update({x.index: f"{name}[{k}]" for k, x in enumerate(angles)})
        yield f"const double a{name}[{n}] = {{{', '.join(map(self._value, angles))}}};"
        yield f"double s{name}[{n}], c{name}[{n}];"
        yield f"gauss_sincos({n}, a{name}, s{name}, c{name});"

    def _value(self, node) -> str:
        if not isinstance(node, Expression):
            return c_number(float(node))
        return c_number(node.value) if node.is_constant else self.names[node.index]


def _places(shapes: dict[str, tuple[int, ...]]) -> Iterator[str]:
    """Names of the entries of arguments or results in C, in order."""
    for name, shape in shapes.items():
        if not shape:
            yield name
            continue
        size = 1
        for length in shape:
            size *= length
        yield from (f"{name}[{k}]" for k in range(size))
