"""Problems of the library: what moves, for how long, what is looked at, what is asked, what others needed."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

import numpy as np

import gauss
from benchmarks.iftomm import exact

TABLES = Path(__file__).parents[2] / "tests" / "reference" / "iftomm.json"
HIGH, THRESHOLD, STEPS = 1e-3, 1e-3, 400
ENERGY = 5e-5  # J
CRANK = 0.007  # m, from O to F
BETA = -0.0617138900142764496358948458001  # rad, of the crank at the start: Hairer, Wanner, Solving ODEs II, VII.7
SINGULAR, FINE = {"rtol": 1e-13, "atol": 1e-13}, {"rtol": 1e-14, "atol": 1e-14}
FINEST = {"integrator": "taylor", "rtol": 1e-15, "atol": 1e-15}
STIFF = {"integrator": "radau5", "rtol": 1e-8, "atol": 1e-8}
NONE = "not found"


@dataclass(frozen=True)
class BenchmarkProblem:
    """A problem of the library."""

    name: str  # its number, what moves, and for how long
    make: Callable  # () → Scene
    duration: float  # of the motion [s]
    seen: Callable  # trajectory → what is looked at (k, m)
    exact: Callable  # () → what that should be at the samples
    # what, against: what is looked at, and where the reference comes from
    what: str
    against: str
    by: str = "–"  # who asks, as in the list of sources
    steps: int = STEPS  # output steps
    energy: float | None = None  # change of energy allowed, where this is what is asked [J]
    submitted: str = NONE  # CPU times that were reported
    settings: dict = field(default_factory=dict)  # further arguments of :func:`gauss.simulate`

    @property
    def times(self) -> np.ndarray:
        """Samples [s]."""
        return np.linspace(0.0, self.duration, self.steps + 1)

    def error(self, motion: gauss.Trajectory) -> float:
        """Worst error of all samples, relative to the reference or to the threshold."""
        wanted = self.exact()
        return float((np.abs(self.seen(motion) - wanted) / np.maximum(np.abs(wanted), THRESHOLD)).max())

    @property
    def asked(self) -> float:
        """Error or energy [J] allowed."""
        return HIGH if self.energy is None else self.energy


def problems() -> list[BenchmarkProblem]:
    """All problems."""
    return [
        _pendulum("A01 pendulum, 2000 s", 2000.0, 1.0, by="[1]", steps=4000, settings=FINEST),
        _pendulum("A01 pendulum, 10 s", 10.0, -1.0, by="[2]", energy=ENERGY, submitted="OpenSim 0.637 s, Exudyn 0.037 s"),
        _ladder(40, 20.0, by="[1]", settings=SINGULAR),
        _ladder(10, 20.0, settings=SINGULAR),
        _ladder(2, 10.0, submitted="OpenSim 0.455 s, Exudyn 0.0776 s"),
        _ladder(1, 20.0),
        *_tabled("A03 Andrews' squeezer", "andrews_squeezer", crank_tip, "x, y of F", {0.05: (0.384, {}), 0.5: (None, {})}),
        *_tabled("A04 Bricard", "bricard", third_point, "x, y, z of P3", {10.0: (0.258, {}), 600.0: (None, FINE)}),
        *_tabled("A05 governor", "flyball_governor", height, "s", {10.0: (0.233, STIFF), 350.0: (None, STIFF)}),
    ]


def _pendulum(name: str, duration: float, side: float, **more) -> BenchmarkProblem:
    """Point mass of 1 kg on a massless bar of 1 m, let go at x = ±1 m."""

    def make():
        scene = gauss.Scene("simple pendulum", gravity=(0, -exact.G, 0))
        scene.body("mass", 1.0, com=(0, -1, 0))
        scene.revolute("A", "ground", "mass")
        scene.start("A", side * np.pi / 2)
        return scene

    times = np.linspace(0.0, duration, more.get("steps", STEPS) + 1)
    seen = lambda motion: motion.body("mass").com[:, :2]  # noqa: E731
    return BenchmarkProblem(
        name, make, duration, seen, partial(exact.swinging, side, times), "x, y of P1", "closed form", **more
    )


def _ladder(n: int, duration: float, **more) -> BenchmarkProblem:
    def seen(motion):
        crank = motion.body("crank0")  # its middle is half way to B0
        (x, y), spin = 2.0 * crank.com[:, :2].T, crank.angular_velocity[:, 2]
        return np.column_stack([x, y, -spin * y, spin * x])

    return BenchmarkProblem(
        f"A02 ladder, N = {n}, {duration:g} s",
        partial(gauss.load, "n_four_bar", n=n),
        duration,
        seen,
        lambda: exact.turning(n, np.linspace(0.0, duration, STEPS + 1)),
        "x, y, ẋ, ẏ of B0",
        "closed form",
        **more,
    )


def crank_tip(motion: gauss.Trajectory) -> np.ndarray:
    """Place (x, y) of F, the tip of the crank of Andrews' squeezer."""
    angle = BETA + motion.coordinate("O")
    return CRANK * np.column_stack([np.cos(angle), np.sin(angle)])


def third_point(motion: gauss.Trajectory) -> np.ndarray:
    """Place (x, y, z) of P3, the lower end of the second rod of Bricard's linkage."""
    rod = motion.body("rod2")
    return rod.position + np.einsum("kij,j->ki", rod.rotation, [0.0, -1.0, 0.0])


def height(motion: gauss.Trajectory) -> np.ndarray:
    """Height s of the slider of the governor above the lower end of the shaft of 1 m."""
    return 1.0 + motion.body("slider").com[:, 2:]


def _tabled(name: str, model: str, seen: Callable, what: str, runs: dict) -> list[BenchmarkProblem]:
    """One model for several durations, with what OpenSim needed [s] and the settings; tables are the references."""
    return [
        BenchmarkProblem(
            f"{name}, {duration:g} s",
            partial(gauss.load, model),
            duration,
            seen,
            lambda title=f"{name}, {duration:g} s": np.array(tables()[title]),
            what,
            "Taylor in 80 bits",
            submitted=NONE if opensim is None else f"OpenSim {opensim} s",
            settings=settings,
        )
        for duration, (opensim, settings) in runs.items()
    ]


@cache
def tables() -> dict:
    """Tables of references by the names of problems."""
    return json.loads(TABLES.read_text(encoding="utf-8"))["tables"]
