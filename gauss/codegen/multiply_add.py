"""Fused multiply–adds: a product joined to the sum that alone uses it is rounded once, together with that sum.

Which products are joined is decided on the graph, once for every width and for the table of operations. A compiler that
decides by itself does so by the code around, and rounds one state otherwise than a vector of them.
"""

from collections import Counter
from collections.abc import Sequence

from gauss.codegen.expression import Expression

FUSED = {"fma": (1, 1), "fms": (1, -1), "fnma": (-1, 1)}  # ± x y ± z: signs of product and sum


def fused(nodes: Sequence[Expression], outputs) -> list[Expression]:
    """Operations in the same order, with products joined to the sums that alone use them.

    A sum that takes a product in keeps its index: operations that use it find it by that.
    """
    uses = Counter(x.index for node in nodes for x in node.operands)
    uses.update(x.index for x in outputs if isinstance(x, Expression))
    found = {}
    for node in nodes:
        found[node.index] = node
        if node.op in ("add", "sub"):
            x, y = node.operands
            subtracted = "fnma" if node.op == "sub" else "fma"
            taken_from = "fms" if node.op == "sub" else "fma"
            for product, other, kind in ((y, x, subtracted), (x, y, taken_from)):
                if product.op == "mul" and uses[product.index] == 1:
                    operands = (*found.pop(product.index).operands, other)
                    found[node.index] = Expression(node.graph, kind, operands, None, node.index)
                    break
    return list(found.values())
