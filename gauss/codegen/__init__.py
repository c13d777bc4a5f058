"""Code generation: expression graph → derivatives → schedule → LLVM IR → machine code of this CPU, cached on disk.

Python source that computes with floats is called once with symbols (:func:`write`) and becomes a :class:`Function`, a
graph of scalar operations. A :class:`Kernel` is its machine code; :mod:`gauss.codegen.kernels` holds loops that call such
functions.
"""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
