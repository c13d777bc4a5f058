"""Record of the energy balance in compiled loops, updated at each check of the accelerations.

An energy sample is (kinetic energy T, potential energy V, total, magnitude): the total is T + V − work of drives and loads +
dissipation, the magnitude is the scale of the rounding error of V. The balance is the total less its initial value; it is
zero for an exact motion.
"""

import numpy as np

from gauss.codegen import Function, write

ENERGY_SAMPLE = 4  # length of an energy sample
ENERGY_RECORD = ("kinetic", "lowest", "highest", "magnitude", "initial", "balance", "off", "jump", "when")


def initial_energy_record(sample) -> list:
    """Record after the initial energy sample, its entries named by :data:`ENERGY_RECORD`.

    Largest kinetic energy; least and largest potential energy; largest magnitude; initial total; latest balance, and the
    largest one; its largest change between two samples [J], and the time at the end of that change [s].
    """
    kinetic, potential, total, magnitude = sample
    return [kinetic, potential, potential, magnitude, total, 0.0, 0.0, 0.0, 0.0]


def updated_energy_record(record, t, sample, where=np.where) -> list:
    """Record after another energy sample at time t; for numbers, arrays, or expressions with their selection ``where``."""
    kinetic, lowest, highest, magnitude, initial, balance, off, jump, when = record
    now = sample[2] - initial
    change, size = np.abs(now - balance), np.abs(now)
    return [
        where(sample[0] <= kinetic, kinetic, sample[0]),
        where(lowest <= sample[1], lowest, sample[1]),
        where(sample[1] <= highest, highest, sample[1]),
        where(sample[3] <= magnitude, magnitude, sample[3]),
        initial,
        now,
        where(size <= off, off, size),  # NaN propagates
        where(change <= jump, jump, change),
        where(change <= jump, when, t),
    ]


def recorded_energies(times: np.ndarray, samples: np.ndarray) -> list:
    """Record after energy samples (k, 4) at times (k,) [s]: of finite ones as by :func:`updated_energy_record`, in one pass.

    NaN propagates to every entry that it reaches; there the samples are taken one by one.
    """
    record = initial_energy_record(samples[0])
    with np.errstate(over="ignore", invalid="ignore"):
        balance = np.concatenate([[0.0], samples[1:, 2] - samples[0, 2]])
        changes = np.abs(np.diff(balance, prepend=0.0))
    if not (np.isfinite(samples).all() and np.isfinite(changes).all()):
        for t, sample in zip(times[1:], samples[1:], strict=True):
            record = updated_energy_record(record, t, sample)
        return record
    last = int(np.argmax(changes))
    kinetic, potential, _, magnitude = samples.T
    when = times[last] if changes[last] > 0.0 else 0.0
    peaks = np.abs(balance).max(), changes[last]
    return [kinetic.max(), potential.min(), potential.max(), magnitude.max(), record[4], balance[-1], *peaks, when]


def update() -> Function:
    """Traced function (record, t, sample) → record."""

    def after(record, t, sample):
        return updated_energy_record(record, t[0], sample, t[0].graph.select)

    return write(after, len(ENERGY_RECORD), 1, ENERGY_SAMPLE, name="update_energies")
