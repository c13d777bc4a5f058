"""Array shapes in signatures: checked in the tests, where jaxtyping is loaded; free of cost elsewhere."""

import sys

import numpy as np

if "jaxtyping" in sys.modules:
    from jaxtyping import Shaped
else:

    class Shaped:
        """Stand-in that keeps the annotation readable and checks nothing."""

        def __class_getitem__(cls, item):
            """Return the plain array type of ``Shaped[np.ndarray, "n 3"]``."""
            return np.ndarray
