"""Functions of a module whose instructions quick compilation selects all at once.

LLVM's FastISel knows no fused multiply–add: it hands each one over to the selector of the optimised tier by itself, which
takes 12 µs. In a block that is handed over as a whole, a multiply–add takes 6 µs and another operation 4 µs, which FastISel
selects in 1.3 µs. FastISel selects a block from its end on, and hands it over where it cannot select the return: it cannot
in functions of Swift's calling convention, which passes pointers and integers as that of C does.
"""

import re

DEFINITION = "\ndefine internal void "
CALL = re.compile(r'(?<=call )void (@"[^"]*")\(')
CONVENTION = "swiftcc "
MULTIPLY_ADD = '@"llvm.fmuladd.f64"('
LEAST_MULTIPLY_ADDS = 10  # multiply–adds of a function that is handed over: with fewer, nothing is gained
POINTERS = ')* @"', 'ptr @"'  # before the name of a function that is not called there, but passed on


def selected_whole(ir_text: str) -> str:
    """The module, its long straight-line functions with the other calling convention; they and all calls of them."""
    head, *functions = ir_text.split(DEFINITION)
    names = {function.partition("(")[0] for function in functions if _gains(function.partition("\n}\n")[0])}
    if any(pointer in ir_text for pointer in POINTERS):  # who calls those does not know their convention
        names = {name for name in names if not any(f"{pointer[:-2]}{name}" in ir_text for pointer in POINTERS)}
    if not names:
        return ir_text

    def call(found: re.Match) -> str:
        return CONVENTION + found.group() if found.group(1) in names else found.group()

    text = [CALL.sub(call, head)]
    for function in functions:
        own = CONVENTION if function.partition("(")[0] in names else ""
        text += [DEFINITION[:-5], own, "void ", CALL.sub(call, function) if "call void" in function else function]
    return "".join(text)


def _gains(function: str) -> bool:
    """Whether a function is one block with multiply–adds enough."""
    return function.count(MULTIPLY_ADD) >= LEAST_MULTIPLY_ADDS and "\n  br " not in function
