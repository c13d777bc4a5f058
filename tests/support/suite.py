"""Comparison of instances of the suite of quadratic programmes, part by part."""

import numpy as np


def parts(found):
    return found.x, found.y, found.z, found.z_box


def same(one, other, names) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
