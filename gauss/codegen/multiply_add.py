"""Fused multiply–adds: a product is contracted with the sum that is its only user; both are rounded once.

Contraction is decided on the graph, once for every vector width. A compiler would decide by the
surrounding code, and round scalar and SIMD code differently.
"""

from collections import Counter
from collections.abc import Sequence

from gauss.codegen.expression import Expression, operand_indices

FUSED = {"fma": (1, 1), "fms": (1, -1), "fnma": (-1, 1)}  # ± x y ± z: signs of product and sum
CONTRACTED = {"add": ("fma", "fma"), "sub": ("fms", "fnma")}  # where the first, the second operand is the product


def fused(nodes: Sequence[Expression], outputs) -> list[Expression]:
    """Operations in the same order, products contracted with the sums that are their only users.

    A contracted sum keeps its index, by which its users refer to it.
    """
    uses = Counter(operand_indices(nodes))
    uses.update(x.index for x in outputs if isinstance(x, Expression))
    found = {}
    for node in nodes:
        found[node.index] = node
        if node.op in ("add", "sub"):
            x, y = node.operands
            if y.op == "mul" and uses[y.index] == 1:
                product, other, kind = y, x, CONTRACTED[node.op][1]
            elif x.op == "mul" and uses[x.index] == 1:
                product, other, kind = x, y, CONTRACTED[node.op][0]
            else:
                continue
            operands = (*found.pop(product.index).operands, other)
            found[node.index] = Expression(node.graph, kind, operands, None, node.index)
    return list(found.values())
