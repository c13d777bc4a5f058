"""Instruction scheduling: reassociation of sums of products, then depth-first order by latency.

A product in a sum is one fused multiply–add. So a sum of products begins with a term that is not a product, and adds the
others in the order of their availability: its critical path has one addition after the last term. Sums without products keep
their order, also within other sums: nothing is gained, and the error term of a compensated summation is a difference x − y
of nearly equal numbers, which reassociation would destroy. The order is the same for all vector widths, so all round alike.

Operations are emitted depth first from the outputs, the longest latency first: a result is used soon after it is computed,
so that few are spilled (Sethi and Ullman, J. ACM 17, 1970).
"""

from collections import Counter
from typing import NamedTuple

from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.graph import Graph
from gauss.codegen.multiply_add import fused

# latencies, in units of an addition
LATENCY = {"div": 4, "sqrt": 5, "sin": 15, "cos": 15, "exp": 15, "log": 15, "atan2": 30, "call": 100}
CHAIN = frozenset({"add", "sub", "neg"})


class Schedule(NamedTuple):
    """Operations of a function in order, operands first; its inputs and outputs."""

    nodes: list[Expression]
    inputs: list[Expression]
    outputs: list


def schedule(function: Function) -> Schedule:
    """Schedule of a function."""
    rewritten = _Reassociation(function)
    return Schedule(fused(rewritten.depth_first(), rewritten.outputs), rewritten.inputs, rewritten.outputs)


class _Reassociation:
    """A function copied to a graph of its own, with its sums of products reassociated.

    ``when`` is the latency of every node of the new graph, from the inputs on, in additions.
    """

    def __init__(self, function: Function):
        self.graph = Graph()
        self.when: list[int] = []
        self.new: dict[int, Expression] = {}
        self.inputs = [self.graph.symbol(x.value) for x in function.inputs]
        nodes = function.nodes
        self.products = {x.index for x in _used_once(nodes, function.outputs) if x.op == "mul"}
        sums, absorbed = _sums(nodes, function.outputs, self.products)
        for node in nodes:
            if node.index in sums:
                self.new[node.index] = self._sum(sums[node.index])
            elif node.index not in absorbed:
                self.new[node.index] = self.graph.copy(node, [self.new[x.index] for x in node.operands])
        self.outputs = [self.new[x.index] if isinstance(x, Expression) else x for x in function.outputs]

    def depth_first(self) -> list[Expression]:
        """Nodes on which the outputs depend, each right after its operands."""
        found, seen, waiting = [], set(), [(x, False) for x in reversed(self.outputs) if isinstance(x, Expression)]
        when = self._times()
        while waiting:
            node, is_ready = waiting.pop()
            if is_ready:
                found.append(node)
            elif node.index not in seen:
                seen.add(node.index)
                if not node.operands:
                    found.append(node)
                    continue
                waiting.append((node, True))
                waiting += [(x, False) for x in sorted(node.operands, key=lambda x: when[x.index])]
        return found

    def _times(self) -> list[int]:
        """Latency of every node so far."""
        when = self.when
        for made in self.graph.nodes[len(when) :]:
            begin = max([when[x.index] for x in made.operands], default=0)
            when.append(begin + (LATENCY.get(made.op, 1) if made.operands else 0))
        return when

    def _sum(self, terms) -> Expression:
        """Sum of terms (sign, old node): first one that is not a product, then by latency."""
        parts = [(sign, self.new[old.index], old.index in self.products) for sign, old in terms]
        when = self._times()
        parts.sort(key=lambda part: when[part[1].index] - part[2])  # the addition of a product is part of its instruction
        plain = next((part for part in parts if not part[2]), parts[0])
        parts.remove(plain)
        sign, total, _ = plain
        for other, term, _ in parts:
            if sign == other:
                total = self.graph.binary("add", total, term)
            elif sign > 0:
                total = self.graph.binary("sub", total, term)
            else:
                total, sign = self.graph.binary("sub", term, total), 1
        return total if sign > 0 else self.graph.unary("neg", total)


def _used_once(nodes, outputs) -> list[Expression]:
    """Nodes with one use, that are not outputs."""
    uses = Counter(x.index for node in nodes for x in node.operands)
    kept = {x.index for x in outputs if isinstance(x, Expression)}
    return [node for node in nodes if uses[node.index] == 1 and node.index not in kept]


def _sums(nodes, outputs, products) -> tuple[dict, set]:
    """Sums of more than two terms, products among them, as {node: [(sign, term)]}, and the nodes inside them."""
    within = {x.index for x in _used_once(nodes, outputs) if x.op in CHAIN}
    within &= {x.index for node in nodes if node.op in CHAIN for x in node.operands}
    within -= _plain_sums(nodes, products, within)
    sums, absorbed = {}, set()
    for node in nodes:
        if node.op in CHAIN and node.index not in within:
            terms, inside = _terms(node, within)
            if inside and any(term.index in products for _, term in terms):
                sums[node.index] = terms
                absorbed |= inside
    return sums, absorbed


def _plain_sums(nodes, products, within) -> set:
    """Sums of two or more terms without products among them."""
    plain, mixed = set(), set(products)
    for node in nodes:
        if node.op in CHAIN:
            if any(x.index in mixed for x in node.operands if x.index in within or x.index in products):
                mixed.add(node.index)
            elif node.op != "neg":
                plain.add(node.index)
    return plain


def _terms(root: Expression, within) -> tuple[list, set]:
    """Terms (sign, node) of a sum, and the nodes inside it."""
    terms, inside, waiting = [], set(), [(1, root)]
    while waiting:
        sign, node = waiting.pop()
        if node is not root and node.index not in within:
            terms.append((sign, node))
            continue
        inside |= {node.index} - {root.index}
        signs = (-sign,) if node.op == "neg" else (sign, sign if node.op == "add" else -sign)
        waiting += reversed(list(zip(signs, node.operands, strict=True)))
    return terms, inside
