"""Convex hulls of points in memory, and the points of a difference of two of them, in machine code.

    D = {a − b},  a in the first hull, b in the second;   the farthest point of D in a direction: those of both hulls

A hull has a record of integers: numbers of vertices and faces, then the addresses of its numbers (radius beyond the hull,
radius of the ball around it), vertices, normals, first corners of its faces, and corners with their sides
(:class:`gauss.scene.support_faces.Face`).
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine

RECORD = 7  # integers of a record
CORNER = 7  # point, inward normal of the side that begins there, its distance from the centre
MOST_CORNERS = 40  # of a face, and of the part of one over another one: twice as many
POSE = 12  # rotation by rows and place of the first hull in the axes of the second one


class Hull:
    """View of a hull by its record."""

    def __init__(self, r: Routine, record: Array):
        def pointer(k: int, kind: ir.Type) -> Array:
            return Array(r.b, r.b.inttoptr(record[k].value, kind))

        self.r, self.vertex_count, self.face_count = r, record[0], record[1]
        numbers, self.vertices, self.normals = (pointer(k, POINTER) for k in (2, 3, 4))
        self.first_corner, self.corners = pointer(5, INTEGERS), pointer(6, POINTER)
        self.radius, self.size = numbers[0], numbers[1]

    def farthest(self, direction: np.ndarray) -> Value:
        """Number of the vertex farthest in a direction."""
        return largest(self.r, self.vertices, self.vertex_count, direction)[0]

    def face(self, direction: np.ndarray) -> tuple[Value, Value]:
        """Number of the face most nearly across a direction, and the cosine of the angle of its normal; −1 without faces."""
        number, cosine = largest(self.r, self.normals, self.face_count, direction)
        return number, self.r.maximum(cosine, self.r.number(-1.0))


def largest(r: Routine, vectors: Array, count: Value, direction: np.ndarray) -> tuple[Value, Value]:
    """First of some vectors with the largest component in a direction, and this component."""
    most, place = r.variable(-np.inf), r.variable(0, INTEGER)
    with r.each(count) as k:
        height = vector(vectors, k * 3) @ direction
        is_more = height > most[0]
        place[0], most[0] = r.choose(is_more, k, place[0]), r.choose(is_more, height, most[0])
    return place[0], most[0]


def vector(array: Array, index=0) -> np.ndarray:
    """Three numbers of an array from an index."""
    part = array.after(index)
    return np.array([part[k] for k in range(3)])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product."""
    return np.cross(a, b)


def put(array: Array, values, index=0):
    """Store numbers in an array from an index."""
    part = array.after(index)
    for k, value in enumerate(values):
        part[k] = value


def pose(array: Array) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and place (3,) of a pose."""
    return np.array([vector(array, 3 * k) for k in range(3)]), vector(array, 9)


def write_farthest(module: ir.Module) -> ir.Function:
    """Emit ``farthest(i64* first, i64* second, double* pose, double* direction, double* point, i64* vertices)``.

    The point of D farthest in a direction, and its vertices of both hulls.
    """
    known = module.globals.get("farthest")
    if known:
        return known
    r = subroutine(module, "farthest", [INTEGERS, INTEGERS, POINTER, POINTER, POINTER, INTEGERS])
    first, second = (Hull(r, record) for record in r.arrays[:2])
    placed, given, point, vertices = r.arrays[2:]
    (R, x), direction = pose(placed), vector(given)
    i, k = first.farthest(R.T @ direction), second.farthest(-direction)
    put(point, R @ vector(first.vertices, i * 3) + x - vector(second.vertices, k * 3))
    vertices[0], vertices[1] = i, k
    return r.done()


def write_nearest(module: ir.Module) -> ir.Function:
    """Emit ``nearest(double* a, double* b, double* c, double* shares, double* point)``: of a triangle to the origin.

    The point is the sum of the corners by their shares, some of which are zero; b and c may be one corner, or all three.
    Regions of corners, edges and the inside as of Ericson, Real-Time Collision Detection, 2005, sec. 5.1.5.
    """
    known = module.globals.get("nearest")
    if known:
        return known
    r = subroutine(module, "nearest", [POINTER] * 5)
    a, b, c = (vector(array) for array in r.arrays[:3])
    ab, ac = b - a, c - a
    (d1, d2), (d3, d4), (d5, d6) = ((-(ab @ p), -(ac @ p)) for p in (a, b, c))
    of_a, of_b, of_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    bc = c - b
    is_edge = ~(bc @ bc > 0.0)  # the products above are not zero then: they are rounded once only
    zero, one, total = r.number(0.0), r.number(1.0), of_a + of_b + of_c
    on_ab, on_ac, on_bc = d1 / (d1 - d3), d2 / (d2 - d6), (d4 - d3) / ((d4 - d3) + (d5 - d6))
    regions = [
        ((d1 <= 0.0) & (d2 <= 0.0), (one, zero, zero)),
        ((d3 >= 0.0) & (d4 <= d3), (zero, one, zero)),
        (((of_c <= 0.0) | is_edge) & (d1 >= 0.0) & (d3 <= 0.0), (one - on_ab, on_ab, zero)),
        ((d6 >= 0.0) & (d5 <= d6), (zero, zero, one)),
        ((of_b <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0), (one - on_ac, zero, on_ac)),
        ((of_a <= 0.0) & (d4 >= d3) & (d5 >= d6), (zero, one - on_bc, on_bc)),
    ]
    shares = [of_a / total, of_b / total, of_c / total]
    across = cross(ab, ac)
    point = across * ((across @ a) / (across @ across))  # its direction has all digits where it is nearly zero
    for where, here in reversed(regions):
        shares = [r.choose(where, x, y) for x, y in zip(here, shares, strict=True)]
        at = a * here[0] + b * here[1] + c * here[2]
        point = np.array([r.choose(where, x, y) for x, y in zip(at, point, strict=True)])
    put(r.arrays[3], shares)
    put(r.arrays[4], point)
    return r.done()
