"""The stability atlas: where methods fail, and whether they say so."""

from gauss.bench.atlas.cases import CASES
from gauss.bench.atlas.methods import METHODS

__all__ = ["CASES", "METHODS"]
