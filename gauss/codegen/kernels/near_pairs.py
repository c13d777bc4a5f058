"""Near contacts in machine code: poses of shapes, boxes along the axes, distances, and rows of near pairs of features.

The kernels of pairs of shapes are called through their addresses, so that this code holds no shape and is made once on a
machine. A pair whose boxes along the world axes are apart is left out first (Ericson, Real-Time Collision Detection, 2005):
few pairs are listed, many are found by :mod:`gauss.codegen.kernels.broad_phase`, in the same order.
"""

import ctypes

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, machine
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value
from gauss.codegen.kernels.broad_phase import GridWriter

# Own rotation (9), centre (3), sizes (4) of a part in its body, radius of the ball around it, address of its record.
PART = 18
BALL, RECORD = 16, 17  # places of the last two; records are those of :mod:`gauss.codegen.kernels.hull_points`
MOVED = 31  # pose and velocities (24), sizes (4), centre of mass of the body (3)
DISTANCE_INPUTS = 33  # rotation, centre and sizes of two shapes, length of the scene
REACH, RECORDS, PATCH, HULL_INPUTS = 33, 34, 36, 37  # places behind these, of hulls: two records, address of points; the end
FAR_AWAY, UNKNOWN = 1e300, -1e300  # distances: of a point that a patch has not; of a pair that is left to the other kernel
ROW_INPUTS = 2 * MOVED + 4  # columns of two shapes, length of the scene, signs
ROW = 55  # distance, point, rows of both bodies, biases
FEATURE = 1 + 2 * MOVED  # address of its rows, places of the columns of both shapes
KIND = 5  # address of distances, number of features, the first one, whether overlaps may be missed, other distances or 0
BODY = 3  # body of a part, whether it is a plane, its kind
KINDS = 16  # of shapes, at most
NEAR_INTEGERS = "body", "pair", "law", "grid", "kind", "feature", "found", "count"  # arrays by name, in their order
NEAR_NUMBERS = "own", "signs", "deepest", "near_settings", "moved", "rows", "depth"
MOST = 128  # pairs of features of one pair of shapes, and one more
NEAR = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 16)


class _NearPairsWriter:
    def __init__(self, place: Function, module: ir.Module):
        self.place = place
        kinds = [INTEGER] * 4 + [INTEGERS] * 8 + [POINTER] * 8
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "near"))
        self.parts, self.pairs, self.capacity, self.bodies = r.integers
        self.body, self.pair, self.law, self.grid, self.kind, self.feature, self.found, self.count = r.arrays[:8]
        self.pose, self.own, self.signs, self.deepest, self.settings, self.moved, self.rows, self.depth = r.arrays[8:]
        self.given, self.gaps = r.buffer(ROW_INPUTS), r.buffer(MOST)
        self.extents = self.moved.after(self.parts * MOVED)
        arguments = [INTEGER, POINTER, INTEGER, POINTER, INTEGER]
        self.kernel = ir.FunctionType(ir.VoidType(), arguments).as_pointer()

    def write(self) -> ir.Function:
        r = self.r
        self.count[0], self.count[1], self.count[2] = 0, 0, 0
        with r.each(self.parts) as k:
            self._move(k)
        grid, listed = self._grid(), self.pairs > 0
        begins = r.variable(self.pairs, INTEGER)  # numbers of pairs, or of their first parts
        with r.when(~listed):
            grid.fill()
            begins[0] = self.parts
        with r.each(begins[0]) as k:
            first, second = r.variable(k, INTEGER), r.variable(0, INTEGER)
            with r.when(listed):
                first[0], second[0], grid.count[0] = self.pair[k * 2], self.pair[k * 2 + 1], 0
                with r.when(self._is_near(first[0], second[0])):
                    grid.count[0] = 1
            with r.when(~listed):
                grid.collect(k)
            with r.each(grid.count[0]) as x:
                with r.when(~listed):
                    second[0] = grid.near[x]
                self._examine(first[0], second[0])
        return r.done()

    def _grid(self) -> GridWriter:
        def centre(part: Value, axis: int) -> Value:
            return self.moved[part * MOVED + 9 + axis]

        def extent(part: Value, axis: int) -> Value:
            return self.extents[part * 3 + axis]

        def is_plane(part: Value) -> Value:
            return self.body[part * BODY + 1] > 0

        def is_near(first: Value, second: Value) -> Value:
            """Boxes first, as most are apart: the table of laws is large."""
            near, found = self._is_near(first, second), self.r.variable(0, INTEGER)
            with self.r.when(near):
                found[0] = self.law[first * self.parts + second]
            return found[0] > 0

        return GridWriter(self.r, self.parts, self.grid, centre, extent, is_plane, is_near)

    def _move(self, k: Value):
        """Pose and velocities of a part, and the half edges of its box along the axes."""
        r, body, own, moved = self.r, self.body[k * BODY], self.own.after(k * PART), self.moved.after(k * MOVED)
        given = [self.pose[self.bodies * i + body] for i in range(24)] + [own[i] for i in range(12)]
        for i, value in enumerate(r.inline(self.place, *given)):
            moved[i] = value
        for i in range(4):
            moved[24 + i] = own[12 + i]
        for i in range(3):
            moved[28 + i] = self.pose[self.bodies * (9 + i) + body]
            size = own[15] + self.settings[0] * 0.5
            for j in range(3):
                size = size + r.absolute(moved[3 * i + j]) * own[12 + j]
            self.extents[k * 3 + i] = size

    def _is_near(self, first: Value, second: Value) -> Value:
        """Whether the boxes of two parts overlap, or the plane of the second reaches into that of the first."""
        r, one, other = self.r, self.moved.after(first * MOVED), self.moved.after(second * MOVED)
        height, width, apart = r.number(0.0), r.number(0.0), r.number(-1.0)
        for i in range(3):
            between, extent = one[9 + i] - other[9 + i], self.extents[first * 3 + i]
            normal = other[3 * i + 2]
            height, width = height + normal * between, width + r.absolute(normal) * extent
            apart = r.maximum(apart, r.absolute(between) - extent - self.extents[second * 3 + i])
        is_plane = self.body[second * BODY + 1] > 0
        return r.choose(is_plane, height - width, apart) <= 0.0

    def _examine(self, first: Value, second: Value):
        """Contacts of a pair whose boxes are near, if the balls around them are, too."""
        one, other = (self.moved.after(part * MOVED) for part in (first, second))
        between = [one[9 + i] - other[9 + i] for i in range(3)]
        reach = self.own[first * PART + BALL] + self.own[second * PART + BALL] + self.settings[0]
        square = between[0] * between[0] + between[1] * between[1] + between[2] * between[2]
        with self.r.when(square <= reach * reach):
            self._examine_near(first, second)

    def _examine_near(self, first: Value, second: Value):
        """Contacts of a pair, if its kernels are made."""
        number = self.body[first * BODY + 2] * KINDS + self.body[second * BODY + 2]
        kind = self.kind.after(number * KIND)
        is_made = kind[0] > 0
        with self.r.when(is_made):
            self._measure(first * self.parts + second, first, second, kind)
        with self.r.when(~is_made):
            self.count[2] = number + 1

    def _measure(self, p: Value, first: Value, second: Value, kind: Array):
        """Distances of all features of a pair, and rows of the near ones."""
        r, given = self.r, self.given
        for side, part in enumerate((first, second)):
            column = self.moved.after(part * MOVED)
            for i in range(12):
                given[16 * side + i] = column[i]
            for i in range(4):
                given[16 * side + 12 + i] = column[24 + i]
            given[RECORDS + side] = self.own[part * PART + RECORD]
        given[32], given[REACH], given[PATCH], self.count[3] = self.settings[1], self.settings[0], self.settings[3], p
        self._call(kind[0], given, self.gaps)
        with r.when((kind[4] > 0) & (self.gaps[0] <= UNKNOWN)):
            self._call(kind[4], given, self.gaps)
        least, features = r.variable(np.inf), kind[1]
        with r.each(features) as f:
            gap = self.gaps[f]
            least[0] = r.choose(gap < least[0], gap, least[0])
            with r.when(gap <= self.settings[0]):
                with r.when(self.count[0] < self.capacity):
                    self._add(p, first, second, kind[2] + f, f)
                self.count[0] = self.count[0] + 1
        with r.when(kind[3] > 0):
            apart = self.gaps[features]
            least_edge = -r.maximum(-self.deepest[first], -self.deepest[second])
            missed = (apart <= -least_edge) & (least[0] > -self.settings[2])
            with r.when(missed):
                self.count[1] = p + 1
                self.depth[0] = -apart

    def _add(self, p: Value, first: Value, second: Value, feature: Value, f: Value):
        """Rows of a pair of features."""
        own, given, at = self.feature.after(feature * FEATURE), self.given, self.count[0]
        sides = self.moved.after(first * MOVED), self.moved.after(second * MOVED)
        for side, column in enumerate(sides):
            for i in range(MOVED):
                given[side * MOVED + i] = column[own[1 + side * MOVED + i]]
        given[2 * MOVED] = self.settings[1]
        for i in range(3):
            given[2 * MOVED + 1 + i] = self.signs[feature * 3 + i]
        self._call(own[0], given, self.rows.after(at * ROW))
        self.found[at * 2], self.found[at * 2 + 1] = p, f

    def _call(self, address: Value, given: Array, found: Array):
        """Call a kernel of one state by its address."""
        b, one = self.r.b, INTEGER(1)
        b.call(b.inttoptr(address.value, self.kernel), [one, given.pointer, one, found.pointer, one])


def parts_of(pair: Value, parts: Value) -> tuple[Value, Value]:
    """Both parts of a pair by its number."""
    first = pair // parts
    return first, pair - first * parts


def write_near(place: Function, module: ir.Module) -> ir.Function:
    """Emit ``near``; see :class:`NearPairs`."""
    return _NearPairsWriter(place, module).write()


def near_code(place: Function) -> machine.MachineCode:
    """Machine code of ``near`` alone.

    Parameters
    ----------
    place : Function
        (pose, velocities and biases of a body, rotation and centre of a shape in it) → pose and velocities of the shape.
    """
    module = ir.Module(name="gauss")
    write_near(place, module)
    return machine.load(str(module))


class NearPairs(machine.CodeCaller):
    """Python interface.

    Parameters
    ----------
    code : MachineCode
        Code of a module that holds ``near``: that of :func:`near_code`, or of a step.
    """

    def __init__(self, code: machine.MachineCode):
        self.code = code
        self._bind()

    def _bind(self):
        self._near = self.code.entry("near", NEAR)

    def __call__(self, counts: tuple[int, int, int, int], addresses: list[int]):
        """Find the near contacts; arrays are given by their addresses."""
        self._near.call(*counts, *addresses)
