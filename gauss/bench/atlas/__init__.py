"""The stability atlas: where methods fail, and whether they report it."""

from gauss.bench.atlas.acting import SWITCHED
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.contacts import CONTACTS
from gauss.bench.atlas.instants import INSTANTS
from gauss.bench.atlas.methods import METHODS
from gauss.bench.atlas.motions import MOTIONS

__all__ = ["CASES", "METHODS"]

CASES: dict[str, FailureCase] = {case.name: case for case in (*INSTANTS, *CONTACTS, *MOTIONS, *SWITCHED)}
