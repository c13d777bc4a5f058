"""Array shapes in signatures, as ``Shaped[np.ndarray, "n 3"]``: checked where jaxtyping is loaded, else free."""

import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from typing import Annotated as Shaped
elif "jaxtyping" in sys.modules:
    from jaxtyping import Shaped
else:

    class Shaped:
        """Stand-in that keeps the annotation readable and checks nothing."""

        def __class_getitem__(cls, item):
            """Return the plain array type of ``Shaped[np.ndarray, "n 3"]``."""
            return np.ndarray
