from gauss.dynamics.engines.call_graph import call_graph_kernels
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.refined import RefinedEngine
from gauss.dynamics.engines.tree_recursion import tree_recursion_kernels

__all__ = [
    "CertifiedEngine",
    "CompiledEngine",
    "Engine",
    "RefinedEngine",
    "call_graph_kernels",
    "tree_recursion_kernels",
]
