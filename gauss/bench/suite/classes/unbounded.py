"""Loads on what has neither mass nor support: the programme falls for ever along a ray that meets no row."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.suite.doubled import wide, zeros
from gauss.bench.suite.instance import UNBOUNDED, SuiteInstance, SuiteReference, programme, with_reference


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for power in (0, 10, 20):
        yield f"unbounded slider 2^-{power}", partial(_slider, power)
    for n in (4, 16):
        yield f"unbounded rope {n}", partial(_rope, n)
        yield f"unbounded gears {n}", partial(_gears, n)
    yield "unbounded leaving", _leaving


def descending(instance: SuiteInstance, feasible, ray) -> SuiteInstance:
    """The instance with a feasible point, and a ray along which it falls for ever."""
    y, z, z_box = (zeros(size) for size in (instance.b.size, instance.h.size, instance.n))
    proof = SuiteReference(wide(feasible), y, z, z_box, ray=np.asarray(ray, dtype=float), digits=np.inf)
    return with_reference(replace(instance, verdict=UNBOUNDED), proof)


def _slider(power: int) -> SuiteInstance:
    """Two masses and a slider without mass that is pulled, along a guide that holds it across only."""
    push = 2.0**-power
    names = {"variables": ("mass0.ax", "mass1.ax", "slider.ax", "slider.ay"), "units": ("m/s²",) * 4}
    story = f"Slider without mass on a guide, pulled with {push:.3g} N beside masses pulled with 1 N: nothing holds it."
    P = np.diag([1.0, 2.0, 0.0, 0.0])
    rows = np.array([[0.0, 0.0, 0.0, 1.0]])
    found = programme(
        f"unbounded slider 2^-{power}", "unbounded", story, P, [-1.0, -1.0, -push, 0.0], A=rows, b=[0.5], **names
    )
    return descending(found, [0, 0, 0, 0.5], [0, 0, 1, 0])


def _rope(n: int) -> SuiteInstance:
    """Points on a rope that only their distances give energy: pulled as a whole it goes on for ever."""
    K = sparse.diags_array([-np.ones(n - 1), np.r_[1.0, 2.0 * np.ones(n - 2), 1.0], -np.ones(n - 1)], offsets=[-1, 0, 1])
    story = (
        f"{n} points on springs between them, without support, in the field of a steady force; stops on the other side only."
    )
    names = {"variables": tuple(f"point{i}.x" for i in range(n)), "units": ("m",) * n}
    found = programme(f"unbounded rope {n}", "unbounded", story, K, -np.full(n, 0.25), lb=-np.ones(n), **names)
    return descending(found, np.zeros(n), np.ones(n))


def _gears(n: int) -> SuiteInstance:
    """Wheels without inertia, geared 1 : 2 in a row, with a torque on the last."""
    A = sparse.diags_array([np.full(n - 1, -0.5), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    story = (
        f"{n} wheels without inertia geared in a row, a torque on the last: rows hold them together, none holds them back."
    )
    names = {"variables": tuple(f"wheel{i}.acceleration" for i in range(n)), "units": ("rad/s²",) * n}
    q = np.zeros(n)
    q[-1] = -1.0
    found = programme(f"unbounded gears {n}", "unbounded", story, np.zeros((n, n)), q, A=A, b=np.zeros(n - 1), **names)
    return descending(found, np.zeros(n), 2.0 ** -np.arange(n))


def _leaving() -> SuiteInstance:
    """A foot without mass that is pulled off the floor: the only row lets it go."""
    story = (
        "Foot without mass below a body of 4 kg, pulled off the floor with 2 N: contact lets it go, nothing else holds it."
    )
    names = {"variables": ("body.az", "foot.az"), "units": ("m/s²",) * 2}
    rows = np.array([[0.0, -1.0], [1.0, -1.0]])  # above the floor, and the body not above the foot
    found = programme(
        "unbounded leaving", "unbounded", story, np.diag([4.0, 0.0]), [40.0, -2.0], G=rows, h=[0.0, 0.0], **names
    )
    return descending(found, [0.0, 0.0], [0.0, 1.0])
