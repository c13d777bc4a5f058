"""The matrix of the implicit method: many columns from one pair of evaluations, against one column after the other."""

import numpy as np
import pytest

import gauss
from gauss.io.catalog import network_files
from gauss.rotors import Linear, Network, Viscous, simulate
from gauss.rotors.contract import reduce
from gauss.rotors.jacobian import STEP, Jacobian
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.run import RotorRun
from gauss.rotors.switching import switching
from tests.support.rotor_networks import random_network

SAME = 1e-8  # of the largest entry: rounding of differences
RESOLVED = 1e-3  # of the largest entry: what a step of a tenth may change by the curvature of the slip curves
MOST_EVALUATIONS = 60_000  # twice what the harvester takes for 14 s; with wrong slopes 0.3 s take a hundred times as many


def _started(network: Network) -> RotorRun:
    """A run of one second before its first step."""
    reduced = reduce(network)
    run = RotorRun(NetworkEquations(reduced, False), "radau", 1e-6, (1e-6, 1e-6), np.inf, switching(reduced, 1.0, 1e-6))
    run.start()
    return run


@pytest.mark.parametrize("resting", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_columns_moved_together_are_those_moved_alone(seed, resting):
    run = _started(random_network(seed, resting=resting))
    rng, y, n = np.random.default_rng(seed), run.y.copy(), 2 * run.n_g
    if not resting:
        y[:n] += rng.uniform(-1, 1, n) * np.repeat([0.3, 20.0], run.n_g)
    alone = np.zeros((y.size, y.size))
    for k in range(n):
        step = np.zeros(y.size)
        step[k] = STEP * max(abs(y[k]), 1.0 if k < run.n_g else run.reduced.v_0)
        alone[:, k] = (run.rates(0.1, y + step) - run.rates(0.1, y - step)) / (2 * step[k])
    together = Jacobian(run.phase)(run.rates, 0.1, y).toarray()
    assert np.abs(together - alone).max() <= SAME * np.abs(alone).max()


@pytest.mark.parametrize("speed", [0.0, 0.3, 10.0, 1e4])
def test_slopes_of_slips_near_rest_are_those_of_smaller_steps(speed):
    """Within v_0 of rest a slip goes from one end of its curve to the other: differences must be far smaller."""
    run = _started(_chain(3))
    y, n = run.y.copy(), run.n_g
    y[n : 2 * n] = run.reduced.v_0 * (speed + 0.01 * np.arange(n))
    found = Jacobian(run.phase)(run.rates, 0.1, y).toarray()[n : 2 * n, n : 2 * n]
    for k in range(n):
        step = np.zeros(y.size)
        step[n + k] = 0.1 * STEP * max(abs(y[n + k]), run.reduced.v_0)
        finer = (run.rates(0.1, y + step) - run.rates(0.1, y - step))[n : 2 * n] / (2 * step[n + k])
        assert np.abs(found[:, k] - finer).max() <= RESOLVED * np.abs(found).max()


def _chain(n: int) -> Network:
    network = Network("chain")
    for j in range(n):
        network.shaft(f"s{j}", 0.05)
    for j in range(n - 1):
        network.friction_drive(f"l{j}", f"s{j + 1}", f"s{j}", 1.02, (60.0, 1.2, 0.02))
    network.torque("s0", Linear(0.8, 100.0))
    network.torque(f"s{n - 1}", Viscous(0.02))
    return network


def test_a_chain_of_any_length_takes_few_evaluations_for_its_matrix():
    colours = [len(Jacobian(_started(_chain(n)).phase).colours) for n in (20, 200)]
    assert colours[0] == colours[1] <= 5


@pytest.mark.slow
def test_a_long_chain_starts_from_rest_with_its_energy_balanced():
    energies = simulate(_chain(40), 0.5, times=[0.25, 0.5], rtol=1e-6, atol=1e-6).energy()
    assert np.abs(energies.balance).max() <= 1e-8 * energies.scale


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(network_files()))
def test_shipped_networks_move_in_few_evaluations(name):
    motion = simulate(gauss.load_rotors(name), 14.0)
    assert motion.stats.evaluations <= MOST_EVALUATIONS
    assert np.abs(motion.energy().balance).max() <= 1e-8 * motion.energy().scale
