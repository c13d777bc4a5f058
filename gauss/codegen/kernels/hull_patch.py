"""Corners of the face of one convex hull over that of another in machine code, by clipping (Sutherland, Hodgman 1974)."""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Value, subroutine
from gauss.codegen.kernels.hull_points import CORNER, MOST_CORNERS, Hull, pose, put, vector

HIGH = 4  # doubles of a corner: its place in the axes of the face's hull, and its height over the face
ROOM = 2 * MOST_CORNERS + 2


class _PatchWriter:
    def __init__(self, module: ir.Module):
        r = self.r = subroutine(module, "patch", [INTEGERS, INTEGER, INTEGERS, POINTER, POINTER, INTEGERS, POINTER])
        (self.face,), (own, far) = r.integers, (Hull(r, record) for record in (r.arrays[0], r.arrays[1]))
        self.own, self.far = own, far
        self.pose, self.seen, self.count, self.lowest = r.arrays[2:]
        self.cut, self.cut_count = r.buffer(HIGH * ROOM), r.variable(0, INTEGER)

    def write(self) -> ir.Function:
        r, (R, x) = self.r, pose(self.pose)
        upward, begin = vector(self.own.normals, self.face * 3), self.own.first_corner[self.face]
        base, down = vector(self.own.corners, begin * CORNER), R.T @ -upward
        first, points, is_closed = self._incident(down)
        self.lowest[0], self.count[0] = np.inf, points
        with r.each(points) as k:
            with r.when(is_closed):
                put(self.seen, vector(self.far.corners, (first + k) * CORNER), k * HIGH)
            with r.when(~is_closed):
                put(self.seen, vector(self.far.vertices, k * 3), k * HIGH)
            place = R @ vector(self.seen, k * HIGH) + x
            height = (place - base) @ upward
            put(self.seen, [*place, height], k * HIGH)
            self.lowest[0] = r.choose(height < self.lowest[0], height, self.lowest[0])
        self.lowest[1] = (R @ vector(self.far.vertices, self.far.farthest(down) * 3) + x - base) @ upward
        with r.each(self.own.first_corner[self.face + 1], begin) as corner:
            self._clip(self.own.corners.after(corner * CORNER + 3), is_closed)
        return r.done()

    def _incident(self, direction: np.ndarray) -> tuple[Value, Value, Value]:
        """First corner and number of corners of the face most nearly across a direction; vertices without faces."""
        r, far = self.r, self.far
        is_closed = far.face_count > 0
        begin, count = r.variable(0, INTEGER), r.variable(0, INTEGER)
        count[0] = far.vertex_count
        with r.when(is_closed):
            face = far.face(direction)[0]
            begin[0] = far.first_corner[face]
            count[0] = far.first_corner[face + 1] - begin[0]
        return begin[0], count[0], is_closed

    def _clip(self, side: Array, is_closed: Value):
        """Keep the part of a polygon or edge on the inner side of a plane."""
        r, total = self.r, self.count[0]
        normal, distance = vector(side), side[3]
        self.cut_count[0] = 0
        with r.each(total) as k:
            follows = r.choose(k + 1 < total, k + 1, Value(r.b, INTEGER(0)))
            one, other = ([self.seen[i * HIGH + s] for s in range(HIGH)] for i in (k, follows))
            depth, next_depth = (normal @ np.array(p[:3]) + distance for p in (one, other))
            is_inside = depth >= 0.0
            with r.when(is_inside):
                self._add(one)
            is_crossed = (is_inside & (next_depth < 0.0)) | ((depth < 0.0) & ~(next_depth < 0.0))
            with r.when(is_crossed & (is_closed | (follows > 0))):
                share = depth / (depth - next_depth)
                self._add([p + share * (q - p) for p, q in zip(one, other, strict=True)])
        r.copy(self.seen, self.cut, self.cut_count[0] * HIGH)
        self.count[0] = self.cut_count[0]

    def _add(self, corner: list[Value]):
        with self.r.when(self.cut_count[0] < ROOM):
            put(self.cut, corner, self.cut_count[0] * HIGH)
            self.cut_count[0] = self.cut_count[0] + 1


def write_patch(module: ir.Module) -> ir.Function:
    """Emit ``patch(i64* own, i64 face, i64* far, double* pose, double* seen, i64* count, double* lowest)``.

    Pose of the far hull in the axes of the own one; ``seen`` are the corners of the far hull's face, edge or point within
    the sides of the own face, :data:`ROOM` of :data:`HIGH` doubles at most; ``lowest`` the least height of all its corners,
    and of all vertices of the far hull.
    """
    return module.globals.get("patch") or _PatchWriter(module).write()
