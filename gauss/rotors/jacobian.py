"""Sparse Jacobian of the rates of a phase by coloured central differences (Curtis, Powell and Reid 1974)."""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.sparse import csc_matrix

from gauss.rotors.laws import ROLES
from gauss.rotors.links import GearPair
from gauss.rotors.phase import NetworkPhase

STEP = 1e-6  # relative to an angle, at least 1 rad, and to a speed, at least v_0: near rest a slip changes within it


class Jacobian:
    """Sparse matrix of the derivatives of the rates of (θ, w, works, heats) in one phase.

    Groups that change different rows share a column (J. Inst. Maths Applics 13 (1974) 117). The three works sum over all
    shafts: their rows are assembled torque by torque.
    """

    def __init__(self, phase: NetworkPhase):
        self.phase = phase
        self.n_g, self.n_l = phase.reduced.n_groups, len(phase.reduced.links)
        self.rows = _rows(phase)
        self.colours = _colours(self.rows)

    def __call__(self, rates: Callable, t: float, y: np.ndarray) -> csc_matrix:
        """Matrix by central differences."""
        rows, columns, entries = list(range(self.n_g)), list(range(self.n_g, 2 * self.n_g)), [1.0] * self.n_g
        for offset, unit in ((0, 1.0), (self.n_g, self.phase.reduced.v_0)):
            for groups in self.colours:
                step = np.zeros(y.size)
                moved = np.array(groups) + offset
                step[moved] = STEP * np.maximum(np.abs(y[moved]), unit)
                change = rates(t, y + step) - rates(t, y - step)
                for g in groups:
                    rows += self.rows[g]
                    columns += [g + offset] * len(self.rows[g])
                    entries += (change[self.rows[g]] / (2.0 * step[g + offset])).tolist()
        for row, column, slope in self._works(t, y):
            rows.append(row)
            columns.append(column)
            entries.append(slope)
        return csc_matrix((entries, (rows, columns)), shape=(y.size, y.size))

    def _works(self, t: float, y: np.ndarray) -> Iterator[tuple[int, int, float]]:
        """Row, column and slope of the power of every applied torque over the angle and the speed of its group."""
        reduced, place = self.phase.reduced, {name: j for j, name in enumerate(self.phase.reduced.names)}
        for term, gate in zip(reduced.terms, self.phase.mode.gate, strict=True):
            j = place[term.shaft]
            g, k = int(reduced.group[j]), float(reduced.K[j])
            for column, unit in ((g, 1.0), (self.n_g + g, reduced.v_0)) if gate else ():
                step = STEP * max(abs(y[column]), unit)
                powers = []
                for change in (step, -step):
                    theta, w = y[g] + change * (column == g), y[self.n_g + g] + change * (column != g)
                    powers.append(float(term.law(t, reduced.angle[j] + k * theta, k * w)) * k * w)
                yield 2 * self.n_g + ROLES.index(term.role), column, (powers[0] - powers[1]) / (2.0 * step)
        for j, sense, limit in zip(reduced.dry, self.phase.conditions.dry, self.phase.mode.dry_limit, strict=True):
            yield 2 * self.n_g + ROLES.index("load"), self.n_g + int(reduced.group[j]), -sense * limit * float(reduced.K[j])


def _rows(phase: NetworkPhase) -> list[list[int]]:
    """Rows of the rates, but works, that angle and speed of each group change."""
    reduced, n_g, n_l = phase.reduced, phase.reduced.n_groups, len(phase.reduced.links)
    ends = reduced.group[np.array([reduced.driven, reduced.driver], dtype=int)].T.tolist()  # (n_l, 2)
    changed = [{g} for g in range(n_g)]
    for one, other in ends:
        changed[one].add(other)
        changed[other].add(one)
    if phase.locks:  # torques of what sticks depend on everything
        changed = [set(range(n_g))] * n_g
    heats: list[list[int]] = [[] for _ in range(n_g)]
    first = 2 * n_g + len(ROLES)
    for b, pair in enumerate(ends):
        through = isinstance(reduced.links[b], GearPair) or phase.locks
        for g in set().union(*(changed[g] for g in pair)) if through else set(pair):
            heats[g] += [first + b, first + n_l + b]
    return [[n_g + g for g in sorted(changed[k])] + heats[k] for k in range(n_g)]


def _colours(rows: list[list[int]]) -> list[list[int]]:
    """Sets of groups without common rows, greedily."""
    taken: list[set[int]] = []
    colours: list[list[int]] = []
    for g, own in enumerate(rows):
        for used, groups in zip(taken, colours, strict=True):
            if used.isdisjoint(own):
                used.update(own)
                groups.append(g)
                break
        else:
            taken.append(set(own))
            colours.append([g])
    return colours
