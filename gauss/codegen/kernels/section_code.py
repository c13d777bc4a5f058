"""Sections of recorded calls within a function of machine code: their memory, their calls, vectors in the memory.

The memory belongs to one evaluation, so that threads share the code. Results of calls are written before they are read;
parameters and inputs are set at the beginning.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.call_recorder import RecordedCalls, Vector
from gauss.codegen.kernels.row_code import RowCode

BYTE, ENTRY = ir.IntType(8), ir.IntType(32)


class RecordedSections(NamedTuple):
    """Recorded calls, and the vectors in their memory."""

    calls: RecordedCalls
    vectors: dict[str, Vector]


class SectionCode:
    """Emitter of sections within a function, in a memory that is new where none is given."""

    def __init__(self, code: RowCode, sections: RecordedSections, memory=None):
        self.code, self.calls, self.vectors = code, sections.calls, sections.vectors
        self.memory = self._new() if memory is None else memory

    def _new(self):
        """Memory with the parameters set."""
        code, kept = self.code, self.calls.kept
        memory = code.room(self.calls.values.size)
        for k in code.each(kept.size):
            place = code.constant("kept_addresses", kept, k)
            code.put(memory, place, code.constant("kept_values", self.calls.values[kept], k))
        return memory

    def run(self, section: str):
        """Execute all calls of a section."""
        table = self.calls.tables[section]
        if table.size:
            calls = self.code.writer.body(self.calls.calls)
            self.code.b.call(calls, [self.memory, self._table(section, table), ir.Constant(ir.IntType(64), table.size)])

    def _table(self, section: str, table: np.ndarray):
        """Pointer to the constant table of a section, which the module holds as bytes: they are written faster."""
        module, name = self.code.writer.module, f"calls_of_{section}"
        known = module.globals.get(name)
        if known is None:
            content = bytearray(table.astype("<i4").tobytes())
            known = ir.GlobalVariable(module, ir.ArrayType(BYTE, len(content)), name)
            known.initializer = ir.Constant(known.value_type, content)
            known.global_constant, known.linkage, known.align = True, "internal", 4
        return self.code.b.bitcast(known, ENTRY.as_pointer())

    def read(self, name: str):
        """Buffer with the values of a vector."""
        vector, code = self.vectors[name], self.code
        values = code.room(vector.constants.size)
        if vector.is_contiguous:
            code.copy(values, code.at(self.memory, int(vector.addresses[0])), vector.constants.size)
            return values
        addresses, signs = np.zeros(vector.constants.size, dtype=int), np.zeros(vector.constants.size)
        addresses[vector.here], signs[vector.here] = vector.addresses, vector.signs
        for k in code.each(vector.constants.size):
            number = Array(code.b, self.memory)[Value(code.b, code.constant(f"{name}_addresses", addresses, k))]
            sign, own = (
                Value(code.b, code.constant(f"{name}_{what}", given, k))
                for what, given in (("signs", signs), ("constants", vector.constants))
            )
            code.put(values, k, (own + sign * number).value)
        return values

    def write(self, name: str, values):
        """Set the slots of a vector, which are contiguous."""
        vector = self.vectors[name]
        if vector.constants.size:
            self.code.copy(self.code.at(self.memory, int(vector.addresses[0])), values, vector.constants.size)
