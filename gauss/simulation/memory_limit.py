"""Memory of results: what does not fit into the memory of the machine is refused before it is asked for."""

import os

from gauss.errors import SimulationError

NUMBER_BYTES = 8  # of a double
GIB = 2**30
MOST_NUMBERS = 10**100  # numbers: more of them are called as many
ASSUMED = 64 * GIB  # bytes, where the system does not say how much memory it has
SHORTER = "continue a longer motion with state=motion.state(-1)"  # a remedy


def refuse_beyond_memory(numbers: float, what: str, remedy: str):
    """SimulationError if results, a number of doubles, need more memory than the machine has.

    ``what`` says what they are, with the argument that asks for them.
    """
    asked, there = NUMBER_BYTES * min(numbers, MOST_NUMBERS), machine_memory()
    if asked > there:
        raise SimulationError(
            f"{what} need {asked / GIB:.3g} GiB of memory, and this machine has {there / GIB:.3g} GiB; {remedy}."
        )


def machine_memory() -> int:
    """Bytes of memory of the machine."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on Windows
        return ASSUMED
