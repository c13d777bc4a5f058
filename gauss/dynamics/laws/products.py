"""Narrow peaks of products f = Π b_i^p_i, where a divisor nearly vanishes or a base of high power is near its top.

On each subinterval of a step, enclosures of bases and of their rates bound ln |f| = Σ p_i ln |b_i| from above. The error
estimate of the step may miss a peak whose bound exceeds the values at both ends of a subinterval, or on which such ends
lie by chance: stages may lie beside it. The rule has no unit and no scale: a product that is small everywhere is no peak.
"""

from collections import Counter
from typing import Any

import numpy as np

from gauss import math
from gauss.codegen import Expression, Scalar, reachable
from gauss.dynamics.laws.intervals import UNBOUNDED, Interval, enclose
from gauss.dynamics.laws.switching_times import jumps

PEAK = 2.5  # rise of ln |f| within a subinterval that stages may not resolve
HIGH = 6.0  # power of a base from which on its product is flat near zeros of the base and narrow at its top
FLAT = -50.0  # exponent of a negligible value
FACTORED = ("mul", "div", "neg", "sqrt")  # operations that multiply powers
LEAST_BASE = 1.0 / UNBOUNDED  # least magnitude of a base

Power = tuple[int, bool, float]  # position of a base, whether it is an exponent, and its power


class Products:
    """Products in outputs that may have narrow peaks.

    ``outputs``: values of laws. ``known``: indices of expressions with features that are known, as those of time alone.

    Attributes: ``bases``: bases of the products, and exponents of exponential functions among these. ``nodes``: the
    products.
    """

    def __init__(self, outputs: list[Expression], known: set[int]):
        found: dict[tuple, Expression] = {}
        for node, powers in _products(outputs, known):
            own = _steep(powers, known)
            if _may_peak(own):
                found.setdefault(tuple(own.items()), node)
        self.nodes = list(found.values())
        self.bases = list(dict.fromkeys(base for powers in found for (base, _), _ in powers))
        place = {base: k for k, base in enumerate(self.bases)}
        self.powers: list[list[Power]] = [[(place[base], grows, p) for (base, grows), p in powers] for powers in found]
        self.smooth = list(map(_is_smooth, self.bases))

    def __bool__(self):
        return bool(self.bases)

    def hidden(self, ends: list[list], values: list[list[Interval]], rates: list[list[Interval]], tau: Scalar) -> Scalar:
        """Share of a step before its first narrow peak that samples may miss, 1 where there is none.

        ``ends``: bases at the ends of the subintervals. ``values``, ``rates``: enclosures of bases and of their rates on the
        subintervals; rates may be empty. ``tau``: length of a subinterval [s].
        """
        hidden: Scalar = 1.0
        bounds = self._all_bounds(ends, values, rates, tau)
        for powers in self.powers:
            at = [_heights(x, powers) for x in ends]
            risen: Scalar = np.inf
            for j, bound in enumerate(bounds):
                middle = (j + 0.5) / len(bounds)
                top = _top(bound, powers)
                regular = _regular(ends[j], ends[j + 1], powers)
                inside = math.where(top > math.maximum(at[j], at[j + 1]) + PEAK, regular, 0.0)
                hidden = math.where(inside > 0.0, math.minimum(hidden, middle), hidden)
                rises = math.where(at[j + 1] > at[j] + PEAK, math.minimum(risen, middle), risen)
                risen = math.where(regular > 0.0, rises, np.inf)
                hidden = math.where(at[j] > at[j + 1] + PEAK, math.minimum(hidden, risen), hidden)
        return hidden

    def is_flat(
        self, rise: float, ends: list[list], values: list[list[Interval]], rates: list[list[Interval]], tau: Scalar
    ) -> Scalar:
        """1 where ln |f| of no product rises by more than ``rise`` in a step, undivided; others as of :meth:`hidden`."""
        (bound,), flat = self._all_bounds(ends, values, rates, tau), 1.0
        for powers in self.powers:
            flat = math.where(_rises(ends[0], ends[1], bound, powers, rise), 0.0, flat)
        return flat

    def _all_bounds(self, ends, values, rates, tau: Scalar) -> list[list[Interval]]:
        """Bounds of all bases on all subintervals."""
        slopes = [one or [None] * len(self.bases) for one in rates]
        around = (zip(ends[j], ends[j + 1], values[j], slopes[j], strict=True) for j in range(len(values)))
        return [[self._bounds(k, *each, tau) for k, each in enumerate(part)] for part in around]

    def _bounds(
        self, k: int, before: Scalar, after: Scalar, value: Interval, rate: Interval | None, tau: Scalar
    ) -> Interval:
        """Bounds of an exponent, or of the magnitude of a base, on a subinterval: of its values and by its rates."""
        exponent = any(place == k and grows for powers in self.powers for place, grows, _ in powers)
        if not exponent:
            least = math.maximum(math.maximum(value.low, -value.high), 0.0)
            value = Interval(least, math.maximum(value.high, -value.low))
            before, after = math.abs(before), math.abs(after)
        if rate is None or not self.smooth[k]:
            return value
        middle, reach = 0.5 * (before + after), 0.5 * tau * math.maximum(rate.high, -rate.low)
        return Interval(math.maximum(value.low, middle - reach), math.minimum(value.high, middle + reach))


def _products(outputs: list[Expression], known: set[int]) -> list[tuple[Expression, Counter]]:
    """Products that are no factors of others, each with the powers of (base, whether it is an exponent).

    A square root, and an angle of two sides, turn where what their derivatives are divided by nearly vanishes.
    """
    nodes = reachable(outputs)
    powers = _all_powers(nodes, known)
    ends = {x.index for x in outputs}
    ends |= {x.index for node in nodes if node.op == "exp" or node.index not in powers for x in node.operands}
    roots = [(node, Counter({(_turning(node), False): -0.5})) for node in nodes if node.op in ("sqrt", "atan2")]
    return [*roots, *((node, powers[node.index]) for node in nodes if node.index in powers and node.index in ends)]


def _all_powers(nodes: list[Expression], known: set[int]) -> dict[int, Counter]:
    """Powers of all products, of sums that are written as quotients, and of exponential functions."""
    powers: dict[int, Counter] = {}
    for node in nodes:
        if node.op == "exp":
            powers[node.index] = Counter({(node.operands[0], True): 1.0})
        elif node.op in FACTORED or node.index not in known:
            x = [powers.get(operand.index) or _base(operand, known) for operand in node.operands]
            if node.op in FACTORED:
                powers[node.index] = _combined(node, x)
            elif shared := _over_one_divisor(node, x):
                powers[node.index] = shared
    return powers


def _turning(node: Expression) -> Expression:
    """Square of the divisor in the derivative of a square root or of an angle of two sides."""
    if node.op == "sqrt":
        return node.operands[0]
    y, x = node.operands
    return x * x + y * y


def _steep(powers: Counter, known: set[int]) -> dict[tuple[Expression, bool], float]:
    """Powers that may make a product narrow."""
    free = {key: p for key, p in powers.items() if not key[0].is_constant and key[0].index not in known}
    return {key: p for key, p in free.items() if p < 0.0 or p >= HIGH or key[1]}


def _is_smooth(base: Expression) -> bool:
    """Whether the rate of a base bounds its changes, for it does not jump."""
    return not any(map(jumps, reachable([base])))


def _base(x: Expression, known: set[int]) -> Counter:
    """Powers of a base: a − b and b − a are one, but for the sign."""
    if x.op == "sub" and x.index not in known and x.operands[0].index > x.operands[1].index:
        a, b = x.operands
        return Counter({(b - a, False): 1.0, _minus(x): 1.0})
    return Counter({(x, False): 1.0})


def _minus(x: Expression) -> tuple[Expression, bool]:
    return x.graph.constant(-1.0), False


def _combined(node: Expression, x: list[Counter]) -> Counter:
    """Powers of a product, quotient, negative or square root."""
    found = Counter({key: 0.5 * p for key, p in x[0].items()}) if node.op == "sqrt" else Counter(x[0])
    if node.op == "neg":
        found[_minus(node)] += 1
    for key, p in x[1].items() if len(x) > 1 else ():
        found[key] += p if node.op == "mul" else -p
    return found


def _over_one_divisor(node: Expression, x: list[Counter]) -> Counter | None:
    """Powers of the sum a/x + b as (a + b x)/x, which is small, and has no peak, where x nearly vanishes in a divisor."""
    divisors = {key for powers in x for key, p in powers.items() if p < 0.0 and not key[0].is_constant}
    if node.op not in ("add", "sub") or len(divisors) != 1:
        return None
    (key,) = divisors
    power = max(-powers[key] for powers in x)
    one, other = (_written({**powers, key: powers[key] + power}) for powers in x)
    if one is None or other is None:
        return None
    return Counter({(one + other if node.op == "add" else one - other, False): 1.0, key: -power})


def _written(powers: dict[tuple[Expression, bool], float]) -> Expression | None:
    """Product of its powers; None unless these are small whole numbers, so that it may not be narrow itself."""
    found: Any = 1.0
    for (base, grows), p in powers.items():
        if grows or p != round(p) or p >= HIGH or (p < 0.0 and not base.is_constant):
            return None
        for _ in range(abs(int(p))):
            found = found * base if p > 0.0 else found / base
    return found


def _may_peak(powers: dict) -> bool:
    """Whether a product may rise by more than a subinterval resolves, at any state; peaks of exponents alone are known."""
    if all(grows and abs(p) == 1.0 for (_, grows), p in powers.items()):
        return False
    inner = reachable([base for base, _ in powers])
    given = {node.index: Interval(-UNBOUNDED, UNBOUNDED) for node in inner if node.op == "symbol"}
    given |= {node.index: Interval(0.0, UNBOUNDED) for node in inner if node.op == "max" and _is_magnitude(node)}
    with np.errstate(all="ignore"):
        ranges = enclose([base for base, _ in powers], given)
        rise = sum(
            _rise(float(x.low), float(x.high), grows) * abs(p)
            for x, ((_, grows), p) in zip(ranges, powers.items(), strict=True)
        )
    return not rise < PEAK


def _rise(low: float, high: float, grows: bool) -> float:
    """Most that an exponent, or the logarithm of the magnitude of a base, varies between two bounds."""
    if grows:
        return high - low
    return np.log(high / low) if low * high > 0.0 and low > 0.0 else np.log(low / high) if high < 0.0 else np.inf


def _is_magnitude(node: Expression) -> bool:
    x, y = node.operands
    return (y.op == "neg" and y.operands[0] is x) or (x.op == "neg" and x.operands[0] is y)


def _heights(bases: list, powers: list[Power]) -> Scalar:
    """Logarithm of |f| of a product."""
    return sum((_height(bases[k], grows, p) for k, grows, p in powers), 0.0)


def _rises(before: list, after: list, bounds: list[Interval], powers: list[Power], rise: float):
    """Whether the upper bound of a product exceeds its value at an end by the factor e^rise."""
    (k, grows, p), *others = powers
    if grows or others:
        return _top(bounds, powers) > math.minimum(_heights(before, powers), _heights(after, powers)) + rise
    one, other = (math.maximum(math.abs(x[k]), LEAST_BASE) for x in (before, after))  # one power needs no logarithm
    factor = float(np.exp(rise / p))
    if p < 0.0:
        return math.maximum(bounds[k].low, LEAST_BASE) < factor * math.maximum(one, other)
    return bounds[k].high > factor * math.minimum(one, other)


def _top(bounds: list[Interval], powers: list[Power]) -> Scalar:
    """Upper bound of ln |f|."""
    return sum((_height(bounds[k].low if p < 0.0 else bounds[k].high, grows, p) for k, grows, p in powers), 0.0)


def _height(x: Scalar, grows: bool, power: float) -> Scalar:
    """Summand of ln |f|."""
    return math.maximum(power * x, FLAT) if grows else power * np.log(math.maximum(math.abs(x), LEAST_BASE))


def _regular(before: list, after: list, powers: list[Power]) -> Scalar:
    """1 where no divisor changes its sign between the ends of a subinterval: a pole, and no peak, is between them."""
    found: Scalar = 1.0
    for k, grows, p in powers:
        if p < 0.0 and not grows:
            found = math.where(
                before[k] < 0.0, math.where(after[k] < 0.0, found, 0.0), math.where(after[k] < 0.0, 0.0, found)
            )
    return found
