"""All cases of the atlas by name."""

from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.instants import INSTANTS
from gauss.bench.atlas.motions import MOTIONS

CASES: dict[str, FailureCase] = {case.name: case for case in (*INSTANTS, *MOTIONS)}
