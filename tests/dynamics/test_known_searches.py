"""Opaque laws are searched for jumps again once they have changed, however they have; unchanged ones are not."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import gauss
from gauss.dynamics.laws import sampled_laws
from gauss.dynamics.laws.known_searches import MOST_PARTS, KnownSearch
from gauss.dynamics.laws.switching_times import Timetable
from tests.support.switching import slider

DURATION, WIDTH, FORCE = 1.0, 0.002, 100.0  # s, s, N: a pulse that steps do not see by themselves
SAME = 1e-9  # relative, of the rate that a pulse gives a kilogram


def pulse(t, begin: float) -> float:
    return FORCE if begin < float(t) < begin + WIDTH else 0.0


WHEN = 0.3  # s, of a pulse of a global
TABLE = np.array([0.3])


class Pulse:
    """A law with attributes, of its own and of its class."""

    force = FORCE

    def __init__(self):
        self.begin = 0.3

    def __call__(self, t):
        return self.share * pulse(t, self.begin)

    @property
    def share(self) -> float:
        return self.force / FORCE

    def move(self, begin: float):
        self.begin = begin


def of_closure():
    begin = 0.3

    def move(to: float):
        nonlocal begin
        begin = to

    return (lambda t: pulse(t, begin)), move


def of_list():
    held = [0.3]
    return (lambda t: pulse(t, held[0])), lambda to: held.__setitem__(0, to)


def of_global():
    return (lambda t: pulse(t, WHEN)), lambda to: globals().update(WHEN=to)


def of_array():
    return (lambda t: pulse(t, TABLE[0])), lambda to: TABLE.__setitem__(0, to)


def of_object():
    law = Pulse()
    return law, law.move


def of_method():
    law = Pulse()
    return law.__call__, law.move


def of_class():
    law = Pulse()

    def move(to: float):
        """Another function of the class."""
        Pulse.share = property(lambda self: 1.0 + 0.0 * to)
        law.begin = to

    return law, move


def of_class_attribute():
    class Own(Pulse):
        later = 0.0

        def __call__(self, t):
            return pulse(t, self.begin + type(self).later)

    def move(to: float):
        Own.later = to - 0.3

    return Own(), move


def of_function():
    holder = Pulse()
    return (lambda t: holder(t)), holder.move


KINDS = {
    made.__name__: made
    for made in (of_closure, of_list, of_global, of_array, of_object, of_method, of_class, of_class_attribute, of_function)
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_pulse_that_moves_or_comes_between_motions_is_met(kind):
    law, move = KINDS[kind]()
    system = gauss.compile_scene(slider(law))
    for begin in (0.3, 0.3, 0.71, 5.0, 0.12):  # at 5 s it is not met
        move(begin)
        motion = gauss.simulate(system, DURATION, progress=False)
        rate, place = (FORCE * WIDTH, FORCE * WIDTH * (DURATION - begin - 0.5 * WIDTH)) if begin < DURATION else (0.0, 0.0)
        assert motion.v[-1, 0] == pytest.approx(rate, rel=SAME, abs=SAME)
        assert motion.q[-1, 0] == pytest.approx(place, rel=SAME, abs=SAME)
    move(0.3)


@pytest.mark.slow
def test_another_interval_and_another_start_are_searched():
    """The pulse of a law of the motion begins at a time that the start tells."""
    scene = slider(lambda t, at: FORCE if 0.3 < float(t) - float(at.state.q[0] > 5.0) < 0.3 + WIDTH else 0.0)
    system = gauss.compile_scene(scene)
    for place, duration, rate in ((0.0, 1.0, 0.2), (9.0, 1.0, 0.0), (9.0, 2.0, 0.2), (0.0, 0.2, 0.0), (0.0, 1.0, 0.2)):
        start = system.state([place], [0.0])
        motion = gauss.simulate(system, duration, state=start, progress=False)
        assert motion.v[-1, 0] == pytest.approx(rate, rel=SAME, abs=SAME)


@pytest.mark.slow
def test_an_unchanged_law_is_searched_once_and_its_motion_is_the_same(monkeypatch):
    searches, located = [], sampled_laws._located
    monkeypatch.setattr(sampled_laws, "_located", lambda *given: searches.append(given) or located(*given))
    spline = CubicSpline([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])  # of another library: its content is unknown
    laws = (lambda t: pulse(t, 0.3), 1), (Pulse(), 1), (Pulse().__call__, 1), (lambda t: float(spline(float(t))), 2)
    for law, repeated in laws:
        searches.clear()
        system = gauss.compile_scene(slider(law))
        first, again = (gauss.simulate(system, DURATION, progress=False) for _ in range(2))
        np.testing.assert_array_equal(first.q, again.q)
        assert len(searches) == repeated


def test_a_law_of_much_content_is_searched_again():
    """To compare it would take longer."""
    state, table = gauss.State(0.0, np.zeros(1), np.zeros(1)), np.zeros((MOST_PARTS + 1, 128))
    assert KnownSearch(False).key(lambda t, motion: table[0, 0] * float(t), state) is None
    numbers = [0.0] * (MOST_PARTS + 1)
    assert KnownSearch(False).key(lambda t, motion: numbers[0] * float(t), state) is None
    few = numbers[:5]
    assert KnownSearch(False).key(lambda t, motion: few[0] * float(t), state) is not None


def test_a_random_law_is_searched_again():
    rng = iter(np.random.default_rng(0).normal(size=1000))
    found = [Timetable(np.array([0.5 * k]), np.zeros(0)) for k in (1, 2)]
    known, left, values = KnownSearch(False), iter(found), lambda times: np.array([[next(rng)] for _ in times])
    assert [known.found("law", values, (0.0, 2.0), lambda: next(left)) for _ in found] == found
