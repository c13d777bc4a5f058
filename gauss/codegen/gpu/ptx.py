"""LLVM IR → PTX, the assembly language of NVIDIA's GPUs, which their driver compiles for the device.

The NVPTX back end of LLVM keeps sums and products as they are written: a result is that of the CPU, to the last bit but for
angles beyond 1e5 rad (:mod:`gauss.codegen.sincos`) and for exp, log and atan2 (:mod:`gauss.codegen.elementary`).
"""

import re
from functools import cache

import llvmlite.binding as llvm

from gauss.codegen import object_cache
from gauss.codegen.object_code import about
from gauss.errors import DeviceError, MissingPackageError

TRIPLE = "nvptx64-nvidia-cuda"
PTX_VERSION = "+ptx80"  # of CUDA 12.0
LEAST_CAPABILITY = 60  # compute capability 6.0: older devices are left out
MISSING = {"malloc": "memory of unbounded size"}
LEAST_LLVM = 16  # the first with code for Hopper
LIBRARY = re.compile(r"^declare [^@]*@\"?([\w.]+)\"?\(", re.MULTILINE)


@cache
def _machine(capability: int) -> llvm.TargetMachine:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    return llvm.Target.from_triple(TRIPLE).create_target_machine(cpu=f"sm_{capability}", features=PTX_VERSION, opt=2)


def ptx(ir_text: str, capability: int) -> str:
    """PTX of a module with an entry for a GPU, for a compute capability times ten.

    MissingPackageError if llvmlite is too old.
    """
    if llvm.llvm_version_info[0] < LEAST_LLVM:
        raise MissingPackageError("device 'cuda' needs a newer llvmlite: pip install --upgrade llvmlite")
    key = object_cache.key("ptx", about(2), str(capability), ir_text)
    known = object_cache.read(key)
    if known is None:
        machine = _machine(capability)
        module = llvm.parse_assembly(ir_text, context=llvm.create_context())
        module.triple, module.data_layout = TRIPLE, str(machine.target_data)
        module.verify()
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
        builder.getModulePassManager().run(module, builder)
        known = machine.emit_assembly(module).encode()
        object_cache.write(key, known)
    return known.decode()


def refuse_libraries(ir_text: str):
    """Raise a DeviceError, with the functions of libraries that a module calls."""
    called = set(LIBRARY.findall(ir_text))
    missing = sorted({MISSING.get(name, name) for name in called if not name.startswith("llvm.")})
    if missing:
        raise DeviceError(
            f"the code of this scene calls {', '.join(missing)}, which a GPU does not have; leave out device=."
        )
