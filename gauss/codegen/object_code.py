"""LLVM IR → object code of this CPU.

Two tiers: quick, by LLVM's FastISel (code-generation level 0, no passes over the IR), and optimised. A module is optimised
in units of a few functions each, so that no call into LLVM takes long: the time until a background thread stops, and until
another thread may call LLVM, is that of one unit. Functions are visible to the other units; constants are repeated in each
unit that reads them; functions that use a variable stay in one unit. Both tiers evaluate the same floating-point operations
in the same order, fused where the IR says so: their results are equal to the last bit.
"""

import re
from collections.abc import Callable, Iterator
from functools import cache
from itertools import islice

import llvmlite
import llvmlite.binding as llvm

from gauss.codegen.processor import features, prepare_llvm
from gauss.codegen.terminal_line import units_in_progress

OPTIMISED = 1  # level of LLVM's code generator: code of level 2 takes a fifth longer to make and runs no faster
# Straight-line code of a hash-consed graph gains nothing by passes; steps of a few bodies, by inlining of their functions.
PASSES = "passes where control flows, in units; modules of a length as a whole, inlined"
RELOCATION = "static"  # LLVM's runtime linker mistakes the offset table of one object for that of another
UNIT_LENGTH = 80_000  # characters of IR compiled at a time, in about 40 ms
# Lengths of modules that are optimised as a whole: in shorter ones the first motion waits for it, in longer ones others do.
SHORTEST_WHOLE, LONGEST_WHOLE = 50_000, 250_000
SELECTED_WHOLE = "x86_64"  # processor on which some functions are selected whole
CONTRACTED = " contract "  # flag of instructions that the compiler may fuse, which FastISel never does
FUNCTION = re.compile(r"^define [^\n]*\n\{\n.*?^\}\n", re.MULTILINE | re.DOTALL)
GLOBAL = re.compile(r'^(@"[^"]*") = .*\n', re.MULTILINE)
NAME = re.compile(r'@"[^"]*"')
INTERNAL = re.compile(r"^define internal ")
DEFINITION = "\ndefine internal void "
VOID_CALL = re.compile(r'(?<=call )void (@"[^"]*")\(')
CONVENTION = "swiftcc "
MULTIPLY_ADD = '@"llvm.fmuladd.f64"('
LEAST_MULTIPLY_ADDS = 10  # multiply–adds of a function that is handed over: with fewer, nothing is gained
PASSED_ON = ')* @"', 'ptr @"'  # before the name of a function that is not called there, but passed on


@cache
def target(level: int) -> llvm.TargetMachine:
    """Code generator of the host CPU for an optimisation level."""
    prepare_llvm()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features(), opt=level, reloc=RELOCATION, codemodel="jitdefault"
    )


def about(optimise: int) -> str:
    """Compiler, its settings, and processor: what object code depends on beside its module."""
    llvm_version = ".".join(map(str, llvm.llvm_version_info))
    compiler = f"{llvmlite.__version__} {llvm_version} {target(OPTIMISED if optimise else 0).triple} {PASSES} {RELOCATION}"
    return f"{compiler} O{optimise} {llvm.get_host_cpu_name()} {features()}"


def quick_objects(ir_text: str) -> list[bytes]:
    """Object code of a module, quickly made; functions whose multiply–adds the compiler may choose are optimised."""
    quick, chosen = (
        ModuleUnits(ir_text).apart(lambda function: CONTRACTED in function) if CONTRACTED in ir_text else (ir_text, "")
    )
    units = units_in_progress([unit for unit in (quick, chosen) if unit])
    return [_optimised(unit) if unit is chosen else _quick(unit) for unit in units]


def _quick(unit: str) -> bytes:
    machine = target(0)
    return machine.emit_object(_parsed(selected_whole(unit) if machine.triple.startswith(SELECTED_WHOLE) else unit))


def optimised_objects(ir_text: str, optimise: int) -> Iterator[bytes]:
    """Object code of a module, unit by unit.

    Parameters
    ----------
    optimise : int
        As of :func:`gauss.codegen.machine.load`, at least 1; modules that are optimised as a whole are one unit.
    """
    if optimise > 1 or (SHORTEST_WHOLE <= len(ir_text) <= LONGEST_WHOLE and CONTRACTED not in ir_text):
        yield from map(_inlined, units_in_progress([ir_text]))
    else:
        short = len(ir_text) <= UNIT_LENGTH
        yield from map(_optimised, units_in_progress([ir_text] if short else ModuleUnits(ir_text).short(UNIT_LENGTH)))


def _inlined(unit: str) -> bytes:
    module, builder = _parsed(unit), _builder()
    module.verify()
    builder.getModulePassManager().run(module, builder)
    return target(OPTIMISED).emit_object(module)


def _optimised(unit: str) -> bytes:
    module, (passes, builder) = _parsed(unit), _passes()
    module.verify()
    for function in module.functions:
        if len(list(islice(function.blocks, 2))) > 1:
            passes.run(function, builder)
    return target(OPTIMISED).emit_object(module)


def _parsed(ir_text: str) -> llvm.ModuleRef:
    return llvm.parse_assembly(ir_text, context=llvm.create_context())  # which is freed with the module


def _builder() -> llvm.PassBuilder:
    return llvm.create_pass_builder(target(OPTIMISED), llvm.create_pipeline_tuning_options(speed_level=1))


@cache
def _passes() -> tuple[llvm.FunctionPassManager, llvm.PassBuilder]:
    """Passes over functions, made once: llvmlite never frees them."""
    builder = _builder()
    return builder.getFunctionPassManager(), builder


class ModuleUnits:
    """Text of a module, as llvmlite writes it, divided by functions."""

    def __init__(self, ir_text: str):
        head = FUNCTION.sub("", ir_text)
        self._values = {found.group(1): found.group() for found in GLOBAL.finditer(head)}
        self._head = GLOBAL.sub("", head) + "\n"
        self.functions = [INTERNAL.sub("define ", found.group()) for found in FUNCTION.finditer(ir_text)]
        self._used = [set(NAME.findall(function)) for function in self.functions]
        variables = {name for name, line in self._values.items() if " constant " not in line}
        self._together = [k for k, used in enumerate(self._used) if used & variables]

    def short(self, length: int) -> list[str]:
        """Units of about a length, in characters."""
        groups, size = [list(self._together)], sum(len(self.functions[k]) for k in self._together)
        for k, function in enumerate(self.functions):
            if k in self._together:
                continue
            if size and size + len(function) > length:
                groups.append([])
                size = 0
            groups[-1].append(k)
            size += len(function)
        return [self._unit(group) for group in groups]

    def apart(self, is_apart: Callable[[str], bool]) -> tuple[str, str]:
        """Two units: functions without and with a property; those that use variables are taken as one."""
        chosen = {k for k, function in enumerate(self.functions) if is_apart(function)}
        chosen |= set(self._together) if chosen.intersection(self._together) else set()
        return self._unit([k for k in range(len(self.functions)) if k not in chosen]), self._unit(sorted(chosen))

    def _unit(self, mine: list[int]) -> str:
        """Functions of these numbers, and what they refer to: constants, variables, declared functions; may be empty."""
        if not mine:
            return ""
        used, inside = set().union(*(self._used[k] for k in mine)), set(mine)
        lines = [line for name, line in self._values.items() if name in used]
        for k, function in enumerate(self.functions):
            first = function.partition("\n")[0]
            if k not in inside and NAME.findall(first)[0] in used:
                lines.append(first.replace("define ", "declare ", 1) + "\n")
        return "".join([self._head, *lines, *(self.functions[k] for k in mine)])


def selected_whole(ir_text: str) -> str:
    """The module, with instructions of long straight-line functions selected all at once by quick compilation.

    LLVM's FastISel knows no fused multiply–add: it hands each one over to the selector of the optimised tier by itself,
    which takes 12 µs. In a block that is handed over as a whole, a multiply–add takes 6 µs and another operation 4 µs, which
    FastISel selects in 1.3 µs. FastISel selects a block from its end on, and hands it over where it cannot select the
    return: it cannot in functions of Swift's calling convention, which passes pointers and integers as that of C does. The
    functions and all calls of them get that convention.
    """
    head, *functions = ir_text.split(DEFINITION)
    names = {function.partition("(")[0] for function in functions if _gains(function.partition("\n}\n")[0])}
    if any(pointer in ir_text for pointer in PASSED_ON):  # who calls those does not know their convention
        names = {name for name in names if not any(f"{pointer[:-2]}{name}" in ir_text for pointer in PASSED_ON)}
    if not names:
        return ir_text

    def call(found: re.Match) -> str:
        return CONVENTION + found.group() if found.group(1) in names else found.group()

    text = [VOID_CALL.sub(call, head)]
    for function in functions:
        own = CONVENTION if function.partition("(")[0] in names else ""
        text += [DEFINITION[:-5], own, "void ", VOID_CALL.sub(call, function) if "call void" in function else function]
    return "".join(text)


def _gains(function: str) -> bool:
    """Whether a function is one block with multiply–adds enough."""
    return function.count(MULTIPLY_ADD) >= LEAST_MULTIPLY_ADDS and "\n  br " not in function
