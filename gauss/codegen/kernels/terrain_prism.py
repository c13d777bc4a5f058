"""Prism under a triangle of terrain as a convex hull in memory (:mod:`gauss.codegen.kernels.hull_points`)."""

import numpy as np

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Array, Routine, Value
from gauss.codegen.kernels.hull_points import CORNER, RECORD, cross, put, vector

# Corners of its faces, counterclockwise from outside, the upper one first.
LOOPS = (0, 1, 2), (5, 4, 3), (3, 4, 1, 0), (4, 5, 2, 1), (5, 3, 0, 2)
FIRST_CORNERS = 0, 3, 6, 10, 14, 18


class Prism:
    """Memory of one prism.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    """

    def __init__(self, r: Routine):
        self.r, self.record = r, r.buffer(RECORD, INTEGER)
        self.numbers, self.vertices, self.normals = r.buffer(2), r.buffer(18), r.buffer(15)
        self.first, self.corners = r.buffer(6, INTEGER), r.buffer(FIRST_CORNERS[-1] * CORNER)
        arrays = self.numbers, self.vertices, self.normals, self.first, self.corners
        addresses = [Value(r.b, r.b.ptrtoint(array.pointer, INTEGER)) for array in arrays]
        put(self.record, [6, len(LOOPS), *addresses])
        put(self.first, FIRST_CORNERS)

    def begin(self, points: np.ndarray, normal: np.ndarray, bottom: Value) -> np.ndarray:
        """Store the vertices and the upper face, and return the middle, around which they lie."""
        r, down = self.r, np.array([[0.0, 0.0, point[2] - bottom] for point in points])
        sums = points[0] + points[1] + points[2]
        middle = np.array([sums[0] / 3.0, sums[1] / 3.0, sums[2] / 6.0 + bottom * 0.5])
        upper = points - middle
        put(self.vertices, [*upper.ravel(), *(upper - down).ravel()])
        square = r.number(0.0)
        for vertex in (*upper, *(upper - down)):
            square = r.maximum(square, vertex @ vertex)
        put(self.numbers, [r.number(0.0), r.square_root(square)])
        put(self.normals, normal)
        self._sides(0, normal)
        return middle

    def complete(self):
        """Store the other faces."""
        for k, loop in enumerate(LOOPS[1:], 1):
            a, b, c = (vector(self.vertices, 3 * i) for i in loop[:3])
            across = cross(b - a, c - b)
            normal = across / self.r.square_root(across @ across)
            put(self.normals, normal, 3 * k)
            self._sides(k, normal)

    def _sides(self, k: int, normal: np.ndarray):
        """Corners of a face and their sides."""
        points = [vector(self.vertices, 3 * i) for i in LOOPS[k]]
        for i, (point, following) in enumerate(zip(points, points[1:] + points[:1], strict=True)):
            inward = cross(normal, following - point)
            inward = inward / self.r.square_root(inward @ inward)
            put(self.corners, [*point, *inward, -(inward @ point)], (FIRST_CORNERS[k] + i) * CORNER)

    def side(self, k: int) -> Array:
        """Inward normal of a side of the upper face, and its distance from the middle."""
        return self.corners.after(k * CORNER + 3)
