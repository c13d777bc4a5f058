"""A module of LLVM IR as units: modules of some of its functions each, which together are the module.

Functions are visible to the other units. Constants are repeated in each unit that reads them; functions that use a variable
stay in one unit.
"""

import re
from collections.abc import Callable

FUNCTION = re.compile(r"^define [^\n]*\n\{\n.*?^\}\n", re.MULTILINE | re.DOTALL)
GLOBAL = re.compile(r'^(@"[^"]*") = .*\n', re.MULTILINE)
NAME = re.compile(r'@"[^"]*"')
INTERNAL = re.compile(r"^define internal ")


class ModuleUnits:
    """Text of a module, divided by functions.

    Parameters
    ----------
    ir_text : str
        The module, as llvmlite writes it.
    """

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
