"""Rotor networks for tests: those of the reference files, and random ones."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from gauss.rotors import Characteristic, Constant, Dry, Kloss, Linear, Network, Periodic, Quadratic, Viscous
from gauss.rotors.friction_links import FrictionDrive
from gauss.rotors.laws import LAWS
from gauss.rotors.traction import Hyperbola

REFERENCE = Path(__file__).parents[1] / "reference"


def reference(name: str) -> tuple[Network, dict]:
    """Network of a reference file, shafts s0, s1, … and links l0, l1, …, and the whole file."""
    data = json.loads((REFERENCE / f"rotor-{name}.json").read_text())
    given, network = data["network"], Network(name)
    count = len(given["inertia"])
    for j, inertia in enumerate(given["inertia"]):
        driver = given.get("omega_r0") if j == count - 1 else None
        network.shaft(f"s{j}", inertia, given["omega_0"][j] if "omega_0" in given else driver)
    for b, link in enumerate(given["links"]):
        options = dict(link)
        shafts = f"s{options.pop('driven')}", f"s{options.pop('driver')}"
        add = network.friction_drive if "curve" in options else network.gear
        add(f"l{b}", *shafts, **options)
    for j, terms in enumerate(given["torque"]):
        for term in terms:
            values = dict(term)
            law, begin, until = LAWS[values.pop("law")], values.pop("from", None), values.pop("until", None)
            network.torque(f"s{j}", law(**values), begin=begin, until=until)
    return network, data


def random_network(seed: int, *, ideal: bool = False, gears_only: bool = False, resting: bool = False, loops: bool = True):
    """Connected network of 2 to 9 shafts with random links in random directions, and loads of all kinds."""
    rng = np.random.default_rng(seed)
    network, n = Network(f"random {seed}"), int(rng.integers(2, 10))
    for j in range(n):
        network.shaft(f"s{j}", rng.uniform(0.05, 5.0), angle=rng.uniform(-3, 3))
    for j in range(1, n):
        pair = [f"s{j}", f"s{rng.integers(j)}"]
        # a gear that drives upward and another that drives downward meet in random trees; both are fine
        driven, driver = pair if rng.random() < 0.75 else pair[::-1]
        _link(network, rng, f"l{j}", driven, driver, ideal, "gear" if gears_only else None)
    if loops and n > 2 and rng.random() < 0.5:
        first, second = rng.choice(n, 2, replace=False)
        _link(network, rng, "loop", f"s{first}", f"s{second}", ideal, rng.choice(["friction", "spring"]))
    for j in range(n):
        for law in rng.choice(_laws(rng), rng.integers(0, 3), replace=False):
            network.torque(f"s{j}", law)
        if resting and rng.random() < 0.3:
            network.torque(f"s{j}", Dry(rng.uniform(0.0, 20.0)))
    return network


# What numbers of links and laws are multiplied with: powers of (time, energy).
POWERS = {"damping": (1, 1), "torque": (0, 1), "value": (0, 1), "M_k": (0, 1), "omega_0": (-1, 0)}
OWN = {"Viscous": {"value": (1, 1)}, "Quadratic": {"value": (2, 1)}, "Linear": {"stiffness": (1, 1)}}


def scaled_network(network: Network, time: float, energy: float) -> Network:
    """The same network with times and energies, and what is made of them, multiplied."""
    unit = lambda powers: time ** powers[0] * energy ** powers[1]  # noqa: E731

    def changed(element, own):
        known = {field.name: getattr(element, field.name) for field in fields(element)}
        powers = {key: power for key, power in (POWERS | {"stiffness": (0, 1)} | own).items() if known.get(key) is not None}
        return replace(element, **{key: (np.asarray(known[key]) * unit(power)).tolist() for key, power in powers.items()})

    made = Network(network.name)
    for shaft in network.shafts.values():
        speed = None if shaft.speed is None else shaft.speed / time
        made.add(replace(shaft, inertia=shaft.inertia * unit((2, 1)), speed=speed))
    for link in network.links.values():
        made_of = changed(link, {})
        if isinstance(link, FrictionDrive):
            assert isinstance(link.curve, Hyperbola)
            made_of = replace(made_of, curve=Hyperbola(link.curve.A * energy, link.curve.C, link.curve.B * energy))
        made.add(made_of)
    for torque in network.torques.values():
        begin, until = (None if at is None else at * time for at in (torque.begin, torque.until))
        law = changed(torque.law, OWN.get(type(torque.law).__name__, {}))
        made.add(replace(torque, law=law, begin=begin, until=until))
    return made


def _link(network: Network, rng, name: str, driven: str, driver: str, ideal: bool, kind: str | None):
    kind = kind or rng.choice(["gear", "gear", "friction", "spring"])
    ratio = rng.uniform(0.4, 3.0) * rng.choice([-1.0, 1.0])
    losses = {} if ideal else {"efficiency": rng.uniform(0.5, 1.0), "back_efficiency": rng.uniform(0.1, 0.9)}
    if kind == "gear":
        slip = {} if ideal else {"slip": rng.choice([0.0, 0.05])}
        network.gear(name, driven, driver, ratio, **losses, **slip)
    elif kind == "friction":
        A, C = rng.uniform(10, 100), rng.uniform(0.01, 0.05)
        network.friction_drive(name, driven, driver, ratio, (A, A * C, C), **losses)
    else:
        network.spring(name, driven, driver, ratio, stiffness=rng.uniform(10, 500), damping=rng.uniform(0, 5))


def _laws(rng) -> list:
    return [
        Constant(rng.uniform(-50, 50)),
        Viscous(rng.uniform(0, 2)),
        Quadratic(rng.uniform(0, 0.1)),
        Linear(rng.uniform(0.1, 3), rng.uniform(50, 150)),
        Kloss(rng.uniform(50, 200), rng.uniform(0.05, 0.3), rng.choice([-1, 1]) * rng.uniform(100, 160)),
        Periodic(tuple(rng.uniform(-10, 10, 5))),
    ]


def two_shafts(ratio=1.5, speeds=(None, None), curve=None, **options):
    """Two shafts with a gear, or with a friction drive if there is a curve."""
    network = Network("two shafts")
    network.shaft("out", 0.8, speeds[0])
    network.shaft("in", 0.4, speeds[1])
    if curve is None:
        network.gear("link", "out", "in", ratio, **options)
    else:
        network.friction_drive("link", "out", "in", ratio, curve, **options)
    return network


FALLING = Characteristic(lambda x: 2 * 40.0 * 0.1 * x / (x * x + 0.01))  # largest torque, 40 N m, at a slip of 0.1
