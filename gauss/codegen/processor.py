"""The processor that machine code is made for: this one, with all of its vector registers or narrower ones.

Environment variable: ``GAUSS_VECTORS``, the most doubles in a vector register, 8, 4 or 2. Machine code is then that of a
processor without AVX-512, or without AVX.
"""

import os
from functools import cache

import llvmlite.binding as llvm

from gauss.errors import ArgumentError

VARIABLE = "GAUSS_VECTORS"
# prefixes of the features that registers of more doubles bring
WIDER = {2: ("avx", "evex", "fma", "f16c", "vaes", "vpclmul", "xop"), 4: ("avx512", "avx10", "evex"), 8: ()}


@cache
def width() -> int:
    """Doubles in one vector register: 8, 4 or 2."""
    host = llvm.get_host_cpu_features()
    return min(8 if host.get("avx512f") else 4 if host.get("avx") else 2, _most())


@cache
def features() -> str:
    """Features of the processor, as LLVM lists them; those of wider registers than are asked for are off."""
    host = llvm.get_host_cpu_features()
    for name in host:
        host[name] = host[name] and not name.startswith(WIDER[_most()])
    return host.flatten()


def _most() -> int:
    """Most doubles in a vector register; ArgumentError if the environment names another number."""
    given = os.environ.get(VARIABLE) or "8"
    if given not in map(str, WIDER):
        raise ArgumentError(f"{VARIABLE}: expected 2, 4 or 8 doubles in a vector register, got {given!r}.")
    return int(given)


@cache
def prepare_llvm():
    """Let LLVM make, and link, code of this processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
