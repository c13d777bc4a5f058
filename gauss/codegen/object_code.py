"""LLVM IR → object code of this CPU, and object code → machine code in memory.

Two tiers: quick, by LLVM's FastISel (code-generation level 0, no passes over the IR), and optimised. A module is optimised
in units of a few functions each, so that no call into LLVM takes long: the time until a background thread stops, and until
another thread may call LLVM, is that of one unit. Both tiers evaluate the same floating-point operations in the same order,
fused where the IR says so: their results are equal to the last bit.
"""

import re
import struct
from collections.abc import Iterator
from functools import cache
from itertools import islice

import llvmlite
import llvmlite.binding as llvm

OPTIMISED = 1  # level of LLVM's code generator: code of level 2 takes a fifth longer to make and runs no faster
PASSES = "passes where control flows, in units"  # straight-line code of a hash-consed graph gains nothing by passes
RELOCATION = "static"  # LLVM's runtime linker mistakes the offset table of one object for that of another
UNIT_LENGTH = 80_000  # characters of IR compiled at a time, in about 40 ms
FUNCTION = re.compile(r"^define [^\n]*\n\{\n.*?^\}\n", re.MULTILINE | re.DOTALL)
GLOBAL = re.compile(r'^(@"[^"]*") = .*\n', re.MULTILINE)
NAME = re.compile(r'@"[^"]*"')
INTERNAL = re.compile(r"^define internal ")


@cache
def target(level: int) -> llvm.TargetMachine:
    """Code generator of the host CPU for an optimisation level."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=level, reloc=RELOCATION, codemodel="jitdefault"
    )


@cache
def width() -> int:
    """Doubles in one vector register of this CPU: 8, 4 or 2."""
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("avx") else 2


def about(optimise: int) -> str:
    """Compiler, its settings, and processor: what object code depends on beside its module."""
    llvm_version = ".".join(map(str, llvm.llvm_version_info))
    compiler = f"{llvmlite.__version__} {llvm_version} {target(OPTIMISED if optimise else 0).triple} {PASSES} {RELOCATION}"
    return f"{compiler} O{optimise} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def quick_object(ir_text: str) -> bytes:
    """Object code of a module, without optimisation."""
    return target(0).emit_object(llvm.parse_assembly(ir_text, context=llvm.create_context()))


def optimised_objects(ir_text: str, optimise: int) -> Iterator[bytes]:
    """Object code of a module, unit by unit.

    Parameters
    ----------
    ir_text : str
        The module.
    optimise : int
        As of :func:`gauss.codegen.machine.load`, at least 1; modules that are optimised as a whole are one unit.
    """
    machine = target(OPTIMISED)
    for unit in units(ir_text) if optimise == 1 else (ir_text,):
        module = llvm.parse_assembly(unit, context=llvm.create_context())
        module.verify()
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
        if optimise == 1:
            passes = builder.getFunctionPassManager()
            for function in module.functions:
                if len(list(islice(function.blocks, 2))) > 1:
                    passes.run(function, builder)
        else:
            builder.getModulePassManager().run(module, builder)
        yield machine.emit_object(module)


def units(ir_text: str) -> list[str]:
    """Modules of a few functions each, which together are a module.

    Functions are visible to the other units, but not outside the machine code. Constants are repeated in each unit that
    reads them; functions that use a variable stay in one unit.
    """
    functions = [found.group() for found in FUNCTION.finditer(ir_text)]
    if len(functions) < 2 or len(ir_text) <= UNIT_LENGTH:
        return [ir_text]
    head = FUNCTION.sub("", ir_text)
    values = {found.group(1): found.group() for found in GLOBAL.finditer(head)}
    variables = {name for name, line in values.items() if " constant " not in line}
    head = GLOBAL.sub("", head)
    functions = [INTERNAL.sub("define ", function) for function in functions]
    functions.sort(key=lambda function: variables.isdisjoint(NAME.findall(function)))
    together = sum(not variables.isdisjoint(NAME.findall(function)) for function in functions)
    return [head + _unit(functions, part, values) for part in _parts([len(function) for function in functions], together)]


def _unit(functions: list[str], part: range, values: dict[str, str]) -> str:
    """Some functions of a module, with what they refer to: constants, variables, declared functions."""
    text = "".join(functions[part.start : part.stop])
    used = set(NAME.findall(text))
    lines = [line for name, line in values.items() if name in used]
    for k, function in enumerate(functions):
        first = function.partition("\n")[0]
        if k not in part and NAME.search(first)[0] in used:  # type: ignore[index]  # every function has a name
            lines.append(first.replace("define ", "declare ", 1) + "\n")
    return "".join([*lines, text])


def _parts(lengths: list[int], together: int) -> list[range]:
    """Ranges of about ``UNIT_LENGTH`` characters in all; the first ``together`` functions are in the first."""
    bounds, size = [0], 0
    for k, length in enumerate(lengths):
        if k >= together and size and size + length > UNIT_LENGTH:
            bounds.append(k)
            size = 0
        size += length
    return [range(a, b) for a, b in zip(bounds, [*bounds[1:], len(lengths)], strict=True)]


def packed(objects: list[bytes]) -> bytes:
    """Several byte strings as one."""
    return struct.pack(f"<{1 + len(objects)}Q", len(objects), *map(len, objects)) + b"".join(objects)


def unpacked(content: bytes) -> list[bytes]:
    """Byte strings of :func:`packed`."""
    (count,) = struct.unpack_from("<Q", content)
    lengths, at, found = struct.unpack_from(f"<{count}Q", content, 8), 8 * (1 + count), []
    for length in lengths:
        found.append(content[at : at + length])
        at += length
    return found


def linked(objects: list[bytes]) -> llvm.ExecutionEngine:
    """Machine code in memory, owned by the engine."""
    target(OPTIMISED)
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, codemodel="jitdefault"
    )
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    for content in objects:
        engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    return engine
