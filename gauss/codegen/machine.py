"""LLVM IR → machine code of this CPU, in this process; object code is cached on disk.

Long modules are compiled quickly first, and optimised in the background (:mod:`gauss.codegen.tiers`). Until then the cache
holds the quick object code with its module, so that the next process begins with both.
"""

import os
import zlib

from gauss.codegen import object_cache, tiers
from gauss.codegen.linking import linked
from gauss.codegen.object_cache import packed, unpacked
from gauss.codegen.object_code import SHORTEST_WHOLE, about, optimised_objects, quick_objects
from gauss.codegen.optimiser import OPTIMISER
from gauss.codegen.terminal_line import compile_notice
from gauss.codegen.tiers import AUTO, OPTIMISED, QUICK, EntryPoint, MachineCode

__all__ = ["CodeCaller", "MachineCode", "load", "load_cached"]

COMPRESSION = 1  # level of zlib: 4 ms for a megabyte


class CodeCaller:
    """Base of objects that call machine code; a copy of one, in another process or from disk, looks its functions up anew.

    Attributes
    ----------
    code : MachineCode
        The code.
    """

    code: MachineCode

    def _bind(self):
        """Look up the functions that are called."""
        raise NotImplementedError

    def __getstate__(self) -> dict:
        return {name: value for name, value in vars(self).items() if not isinstance(value, EntryPoint)}

    def __setstate__(self, state: dict):
        vars(self).update(state)
        self._bind()


def load(ir_text: str, optimise: int = 1) -> MachineCode:
    """Machine code of a module.

    Parameters
    ----------
    ir_text : str
        The module.
    optimise : int
        0: quick compilation, code half as fast; 1: optimised where control flows, short modules as by 2; 2: optimised as a
        whole, calls inlined. Above 0, in which tier depends on :func:`gauss.codegen.tiers.wanted`.
    """
    key = object_cache.key(about(optimise), ir_text)
    code = load_cached(key)
    if code is None:
        OPTIMISER.rest()
        with compile_notice():
            code = _made(key, ir_text, optimise)
    return code


def _made(key: str, ir_text: str, optimise: int) -> MachineCode:
    tier = tiers.wanted()
    if not optimise or tier == OPTIMISED or (tier == AUTO and len(ir_text) < SHORTEST_WHOLE):  # in less than 30 ms
        return _optimised(key, ir_text, optimise)
    quick, source = quick_objects(ir_text), zlib.compress(ir_text.encode(), COMPRESSION)
    object_cache.write(key + object_cache.QUICK_SUFFIX, packed([*quick, source, str(optimise).encode()]))
    return _quick(key, quick, source, optimise)


def load_cached(key: str) -> MachineCode | None:
    """Machine code of a module by its :attr:`MachineCode.key`, without its text; None if the cache does not have it."""
    tier = tiers.wanted()
    content = object_cache.read(key) if tier != QUICK else None
    if content is not None:
        return MachineCode(key, linked(unpacked(content)), OPTIMISED)
    content = object_cache.read(key + object_cache.QUICK_SUFFIX)
    if content is None:
        return None
    *quick, source, optimise = unpacked(content)
    if tier == OPTIMISED:
        return _optimised(key, zlib.decompress(source).decode(), int(optimise))
    return _quick(key, quick, source, int(optimise))


def _optimised(key: str, ir_text: str, optimise: int) -> MachineCode:
    objects = list(optimised_objects(ir_text, optimise)) if optimise else quick_objects(ir_text)
    object_cache.write(key, packed(objects))
    return MachineCode(key, linked(objects), OPTIMISED)


def _quick(key: str, quick: list[bytes], source: bytes, optimise: int) -> MachineCode:
    code = MachineCode(key, linked(quick), QUICK, (source, optimise))
    if os.environ.get(tiers.VARIABLE) != QUICK:
        OPTIMISER.add(code)
    return code
