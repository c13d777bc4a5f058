"""LLVM IR → machine code of this CPU, in this process; object code is cached on disk."""

from dataclasses import dataclass
from functools import cache
from itertools import islice

import llvmlite
import llvmlite.binding as llvm

from gauss.codegen import object_cache

OPTIMISED = 1  # level of LLVM's code generator: code of level 2 takes a fifth longer to make and runs no faster
PASSES = "passes where control flows"  # straight-line code of a hash-consed graph gains nothing by passes over the IR


@dataclass(frozen=True)
class MachineCode:
    """Machine code in memory; its lifetime is that of this object.

    Parameters
    ----------
    engine : llvmlite.binding.ExecutionEngine
        Owner of the code.
    key : str
        Name of its object code in :mod:`gauss.codegen.object_cache`.
    """

    engine: llvm.ExecutionEngine
    key: str

    def address(self, name: str) -> int:
        """Address of a function."""
        return self.engine.get_function_address(name)


@cache
def target(level: int) -> llvm.TargetMachine:
    """Code generator of the host CPU for an optimisation level."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=level, reloc="pic", codemodel="jitdefault"
    )


@cache
def width() -> int:
    """Doubles in one vector register of this CPU: 8, 4 or 2."""
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("avx") else 2


def load(ir_text: str, optimise: int = 1) -> MachineCode:
    """Machine code of a module.

    Parameters
    ----------
    ir_text : str
        The module.
    optimise : int
        0: quick compilation, code half as fast; 1: optimised where control flows; 2: optimised as a whole, calls inlined.
    """
    machine = target(OPTIMISED if optimise else 0)
    key = object_cache.key(_about(machine, optimise), ir_text)
    code = load_cached(key)
    if code is None:
        binary = _compile(ir_text, machine, optimise)
        object_cache.write(key, binary)
        code = _linked(key, binary)
    return code


def load_cached(key: str) -> MachineCode | None:
    """Machine code of a module by its :attr:`MachineCode.key`, without its text; None if the cache does not have it."""
    binary = object_cache.read(key)
    return None if binary is None else _linked(key, binary)


def _about(machine: llvm.TargetMachine, optimise: int) -> str:
    """What machine code depends on beside its module."""
    llvm_version = ".".join(map(str, llvm.llvm_version_info))
    about = f"{llvmlite.__version__} {llvm_version} {machine.triple} {llvm.get_host_cpu_name()} {PASSES} O{optimise}"
    return about + f" {llvm.get_host_cpu_features().flatten()}"


def _linked(key: str, binary: bytes) -> MachineCode:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(binary))
    engine.finalize_object()
    return MachineCode(engine, key)


def target_machine() -> llvm.TargetMachine:
    """Target machine for an execution engine, which takes ownership."""
    target(OPTIMISED)
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, codemodel="jitdefault"
    )


def _compile(ir_text: str, machine: llvm.TargetMachine, optimise: int) -> bytes:
    module = llvm.parse_assembly(ir_text)
    module.verify()
    if optimise:
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
        if optimise > 1:
            builder.getModulePassManager().run(module, builder)
            return machine.emit_object(module)
        passes = builder.getFunctionPassManager()
        for function in module.functions:
            if len(list(islice(function.blocks, 2))) > 1:
                passes.run(function, builder)
    return machine.emit_object(module)
