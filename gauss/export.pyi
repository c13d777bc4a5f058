from gauss.analysis.export.c_files import CCode, to_c
from gauss.analysis.export.casadi_function import to_casadi
from gauss.analysis.export.exported_function import DEFAULTS, ExportedFunction, exported_functions
from gauss.analysis.export.fmu.unit import to_fmu
from gauss.analysis.export.formulas import Formulas, latex_document, to_sympy
from gauss.analysis.export.jax_module import jax_source, to_jax
from gauss.analysis.export.save import save_as

__all__ = [
    "CCode",
    "DEFAULTS",
    "ExportedFunction",
    "Formulas",
    "exported_functions",
    "jax_source",
    "latex_document",
    "save_as",
    "to_c",
    "to_casadi",
    "to_fmu",
    "to_jax",
    "to_sympy",
]
