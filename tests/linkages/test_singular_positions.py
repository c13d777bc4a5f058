"""Linkages near singular positions, against kinematics and virtual work of our own in 60 digits."""

import warnings

import mpmath
import numpy as np
import pytest

import gauss
from gauss.errors import LinkageError, NearSingularWarning
from gauss.linkages.doubled import Doubled, cos_sin
from gauss.linkages.extended import extended
from tests.support import linkages

DIGITS = 60
DOUBLED = 2e-31  # relative, of one operation in twice the precision; of a cosine and sine absolute
HONEST = 10.0  # times what is claimed an error may be
ROUTES = 1e-9  # between doubles and twice the precision at regular poses, relative to the largest of a kind
SPEED, MOMENT, INERTIA, GRAVITY = 8.0, -40.0, 0.1, 9.81
CHANGE_POINTS = {(0.5, 1.0, 0.5, 1.0): 0.0, (0.4, 0.9, 0.7, 1.2): np.pi, (0.5, 0.8, 0.9, 1.2): np.pi}


def _four_bar(crank, coupler, rocker, ground):
    bar = gauss.Linkage("bar", gravity=(0.0, -GRAVITY))
    bar.link("crank", 1.0, INERTIA)
    bar.link("coupler", 1.0, INERTIA, (coupler / 2, 0.0))
    bar.link("rocker", 1.0, INERTIA)
    bar.revolute("A", "ground", "crank")
    bar.revolute("B", "crank", "coupler", at=(crank, 0.0))
    bar.revolute("C", "rocker", "coupler", at=(rocker, 0.0), child_at=(coupler, 0.0))
    bar.revolute("D", "ground", "rocker", at=(ground, 0.0))
    bar.drive("A", speed=SPEED)
    bar.load("rocker", moment=MOMENT)
    return bar


def _torque(lengths, angle, read):
    """Torque by virtual work, T ω = Σ (m a·v + J α ω) − powers; derivatives by central differences in 60 digits."""
    with mpmath.workdps(DIGITS):
        crank, coupler, rocker, ground = map(read, lengths)

        def pins(theta):
            B = crank * mpmath.expj(theta)
            d = ground - B
            square = abs(d) ** 2
            along = (square + coupler**2 - rocker**2) / (2 * square)
            return B, B + d * mpmath.mpc(along, mpmath.sqrt(coupler**2 / square - along**2))

        angle, h = mpmath.mpf(angle), mpmath.mpf(10) ** -18
        before, here, after = (pins(angle + k * h) for k in (-1, 0, 1))
        middle = [(B + C) / 2 for B, C in (before, here, after)]
        turns = [[mpmath.arg((C - B) / (here[1] - here[0])) for B, C in (before, here, after)]]
        turns.append([mpmath.arg((C - ground) / (here[1] - ground)) for _, C in (before, here, after)])
        slope = lambda x: (x[2] - x[0]) / (2 * h)  # noqa: E731
        bend = lambda x: (x[2] - 2 * x[1] + x[0]) / h**2  # noqa: E731
        inertial = mpmath.re(mpmath.conj(slope(middle)) * bend(middle)) + sum(INERTIA * slope(x) * bend(x) for x in turns)
        return inertial * SPEED**2 + GRAVITY * mpmath.im(slope(middle)) - MOMENT * slope(turns[1])


@pytest.mark.slow
@pytest.mark.parametrize("lengths", CHANGE_POINTS)
def test_change_points_are_right_or_refused(lengths):
    """Whichever way the lengths are read, as doubles or as their decimals, the error is not ten times what is claimed."""
    bar, answered = _four_bar(*lengths), []
    for distance in 10.0 ** -np.arange(2.0, 8.0):
        angle = CHANGE_POINTS[lengths] + distance
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NearSingularWarning)
            try:
                found = bar.cycle([angle])
            except LinkageError as error:
                assert "RRR group (coupler, rocker)" in str(error)
                assert distance < 1e-3
                continue
        answered.append(distance)
        assert found.error[0] <= 1e-6
        for read in (mpmath.mpf, lambda x: mpmath.mpf(repr(x))):
            exact = _torque(lengths, angle, read)
            assert abs(found.torque[0] - exact) <= HONEST * found.error[0] * max(abs(exact), abs(MOMENT))
    assert len(answered) == 6 or lengths == (0.5, 0.8, 0.9, 1.2)  # there the decimals change over, and the doubles do not


def test_a_torque_next_to_a_change_point_tends_to_a_limit():
    bar = _four_bar(0.5, 1.0, 0.5, 1.0)
    with pytest.warns(NearSingularWarning, match="determine 12 digits"):
        near = bar.cycle([1e-6]).torque[0]
    assert near == pytest.approx(float(_torque((0.5, 1.0, 0.5, 1.0), 1e-6, mpmath.mpf)), rel=1e-12)
    turn = bar.cycle(np.linspace(0.5, 1.5, 7)).error  # away from it, nothing is lost
    assert turn.max() < 1e-12


def test_one_delicate_angle_leaves_the_others_as_they_are():
    bar, regular = _four_bar(0.5, 1.0, 0.5, 1.0), np.array([0.5, 1.0, 2.0])
    with pytest.warns(NearSingularWarning):
        mixed = bar.cycle([0.5, 1e-5, 1.0, 2.0])
    plain = bar.cycle(regular)
    keep = [0, 2, 3]
    assert (mixed.torque[keep] == plain.torque).all()
    assert all((mixed.reaction(name).force[keep] == plain.reaction(name).force).all() for name in "ABCD")
    assert (mixed.link("rocker").alpha[keep] == plain.link("rocker").alpha).all()


def test_numbers_that_were_computed_are_taken_as_rounded():
    """A length of seventeen digits may be off by half a unit: a change point made of such is refused where 0.5 is not."""
    bar = _four_bar(0.5, 1.0, 0.5, 1.0 + 2.0**-52)
    with pytest.raises(LinkageError, match="too near a singular position"):
        bar.cycle([1e-5])


@pytest.mark.slow
@pytest.mark.parametrize("kind", linkages.KINDS)
def test_twice_the_precision_is_the_same_mechanics(kind):
    """Groups of every kind with loads of every kind, at regular poses: both arithmetics agree to the digits of doubles."""
    rng = np.random.default_rng(7)
    for kinds in ([kind], ["RRR", kind], [kind, "RRP"]):
        linkage, found = linkages.random_linkage(rng, kinds, 1.0 - 9.0j, False)
        chain, driver = linkage.chain, linkage.chain.driver
        poses = {t.ternary.name: np.array(t.pose)[:, None] for t in chain.triads}
        better = extended(chain, found.crank_angle, np.array([driver.speed]), np.array([driver.acceleration]), poses)
        scale = max(np.abs(value).max() for value in found.reactions.values())
        assert all(np.abs(better.reactions[name] - value).max() <= ROUTES * scale for name, value in found.reactions.items())
        assert abs(better.torque[0] - found.torque[0]) <= ROUTES * (scale + abs(found.torque[0]))
        assert better.error[0] <= HONEST * found.error[0]


def _exact(number: Doubled):
    return [mpmath.mpf(float(hi)) + mpmath.mpf(float(lo)) for hi, lo in zip(number.hi, number.lo, strict=True)]


def test_arithmetic_of_twice_the_precision():
    rng = np.random.default_rng(3)
    x = Doubled(rng.uniform(-10, 10, 50), 1e-17 * rng.uniform(-1, 1, 50))
    y = Doubled(rng.uniform(0.1, 10, 50), 1e-18 * rng.uniform(-1, 1, 50))
    with mpmath.workdps(DIGITS):
        a, b = _exact(x), _exact(y)
        pairs = [
            (x + y, [p + q for p, q in zip(a, b, strict=True)]),
            (x - y, [p - q for p, q in zip(a, b, strict=True)]),
            (x * y, [p * q for p, q in zip(a, b, strict=True)]),
            (x / y, [p / q for p, q in zip(a, b, strict=True)]),
            (1.0 / y, [1 / q for q in b]),
            (y**0.5, [mpmath.sqrt(q) for q in b]),
            (abs(x), [abs(p) for p in a]),
        ]
        for found, exact in pairs:
            assert max(abs(p - q) / abs(q) for p, q in zip(_exact(found), exact, strict=True)) <= DOUBLED
        for found, function in zip(cos_sin(x), (mpmath.cos, mpmath.sin), strict=True):
            assert max(abs(p - function(q)) for p, q in zip(_exact(found), a, strict=True)) <= DOUBLED
