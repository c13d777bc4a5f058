"""Derivatives of the rates of a phase by differences, many columns at once: a link acts on its own two shafts only."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix

from gauss.rotors.laws import ROLES
from gauss.rotors.links import Gear
from gauss.rotors.phase import Phase

STEP = 1e-6  # of an angle, at least of 1 rad, and of a speed, at least of the slow one of the network


class Jacobian:
    """Sparse matrix of the derivatives of the rates of (θ, w, works, heats) in one phase.

    Groups whose effects do not meet are moved together (Curtis, Powell and Reid, J. Inst. Maths Applics 13 (1974) 117). The
    three works sum over all shafts: their rows are put together torque by torque.

    Parameters
    ----------
    phase : Phase
        The phase.
    """

    def __init__(self, phase: Phase):
        self.phase, reduced = phase, phase.reduced
        self.n_g, self.n_l = reduced.n_groups, len(reduced.links)
        ends = reduced.group[np.array([reduced.driven, reduced.driver], dtype=int)]  # (2, n_l)
        touched = [{g} for g in range(self.n_g)]
        for one, other in ends.T.tolist():
            touched[one].add(other)
            touched[other].add(one)
        if phase.locks:  # what holds passes torques on to everything
            touched = [set(range(self.n_g)) for _ in touched]
        heats = [[] for _ in range(self.n_g)]
        first = 2 * self.n_g + len(ROLES)
        for b, pair in enumerate(ends.T.tolist()):
            near = (
                set().union(*(touched[g] for g in pair)) if isinstance(reduced.links[b], Gear) or phase.locks else set(pair)
            )
            for g in near:
                heats[g] += [first + b, first + self.n_l + b]
        self.rows = [[self.n_g + g for g in sorted(touched[k])] + heats[k] for k in range(self.n_g)]
        self.colours = _colours(self.rows)

    def __call__(self, rates: Callable, t: float, y: np.ndarray) -> csc_matrix:
        """Matrix by central differences."""
        rows, columns, entries = list(range(self.n_g)), list(range(self.n_g, 2 * self.n_g)), [1.0] * self.n_g
        for offset, unit in ((0, 1.0), (self.n_g, self.phase.reduced.slow)):
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

    def _works(self, t: float, y: np.ndarray):
        """Row, column and slope of the power of every applied torque over the angle and the speed of its group."""
        reduced, place = self.phase.reduced, {name: j for j, name in enumerate(self.phase.reduced.names)}
        for term, gate in zip(reduced.terms, self.phase.mode.gate, strict=True):
            j = place[term.shaft]
            g, k = int(reduced.group[j]), float(reduced.K[j])
            for column, unit in ((g, 1.0), (self.n_g + g, reduced.slow)) if gate else ():
                step = STEP * max(abs(y[column]), unit)
                powers = []
                for way in (step, -step):
                    theta, w = y[g] + way * (column == g), y[self.n_g + g] + way * (column != g)
                    powers.append(float(term.law(t, reduced.angle[j] + k * theta, k * w)) * k * w)
                yield 2 * self.n_g + ROLES.index(term.role), column, (powers[0] - powers[1]) / (2.0 * step)
        for j, way, limit in zip(reduced.dry, self.phase.conditions.dry, self.phase.mode.dry_limit, strict=True):
            yield 2 * self.n_g + ROLES.index("load"), self.n_g + int(reduced.group[j]), -way * limit * float(reduced.K[j])


def _colours(rows: list[list[int]]) -> list[list[int]]:
    """Sets of groups whose rows do not meet, found one after the other."""
    taken, colours = [], []
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
