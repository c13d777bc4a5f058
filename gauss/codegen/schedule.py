"""Instruction scheduling: reassociation of sums of products, then depth-first order by latency.

A product is contracted with the sum that is its only user: both are rounded once. So a sum of products begins with a term
that is not a product, and adds the others in the order of their availability: its critical path has one addition after the
last term. Sums without products keep their order, also within other sums: nothing is gained, and the error term of a
compensated summation is a difference x − y of nearly equal numbers, which reassociation would destroy. All is decided on the
graph, for every vector width alike: a compiler would decide by the surrounding code, and round scalar and SIMD code
differently.

Operations are emitted depth first from the outputs, the longest latency first: a result is used soon after it is computed,
so that few are spilled (Sethi and Ullman, J. ACM 17, 1970).
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from gauss.codegen.expression import INDEX_OF, Expression, operand_indices
from gauss.codegen.function import Function
from gauss.codegen.graph import BINARY, Graph

# latencies, in units of an addition
LATENCY = {"div": 4, "sqrt": 5, "sin": 15, "cos": 15, "exp": 15, "log": 15, "atan2": 30, "call": 100, "row": 40, "entry": 8}
CHAIN = frozenset({"add", "sub", "neg"})
FUSED = {"fma": (1, 1), "fms": (1, -1), "fnma": (-1, 1)}  # ± x y ± z: signs of product and sum
CONTRACTED = {"add": ("fma", "fma"), "sub": ("fms", "fnma")}  # where the first, the second operand is the product


class Schedule(NamedTuple):
    """Operations of a function in order, operands first; its inputs and outputs."""

    nodes: list[Expression]
    inputs: list[Expression]
    outputs: list


def schedule(function: Function) -> Schedule:
    """Schedule of a function."""
    rewritten = _Reassociation(function)
    found = Schedule(fused(rewritten.depth_first(), rewritten.outputs), rewritten.inputs, rewritten.outputs)
    rewritten.graph.forget()
    return found


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
        once = _used_once(nodes, function.outputs)
        self.products = {x.index for x in once if x.op == "mul"}
        sums, absorbed = _sums(nodes, self.products, {x.index for x in once if x.op in CHAIN})
        self._rewrite(nodes, sums, absorbed)
        self.outputs = [self.new[x.index] if isinstance(x, Expression) else x for x in function.outputs]

    def _rewrite(self, nodes, sums: dict, absorbed: set):
        """Write the nodes into the new graph, the sums by their terms."""
        new, copy, binary = self.new, self.graph.copy, self.graph.binary
        for node in nodes:
            index, operands = node.index, node.operands
            if index in sums:
                new[index] = self._sum(sums[index])
            elif index in absorbed:
                continue
            elif node.op in BINARY:  # most of them, without the overhead of a copy
                x, y = operands
                new[index] = binary(node.op, new[x.index], new[y.index])
            else:
                new[index] = copy(node, [new[x.index] for x in operands])

    def depth_first(self) -> list[Expression]:
        """Nodes on which the outputs depend, each right after its operands."""
        found, waiting = [], [x for x in reversed(self.outputs) if isinstance(x, Expression)]
        when = self._times()
        is_open, is_done = bytearray(len(when)), bytearray(len(when))
        while waiting:
            node = waiting.pop()
            index, operands = node.index, node.operands
            if is_done[index]:
                continue
            if is_open[index] or not operands:
                is_done[index] = 1
                found.append(node)
                continue
            is_open[index] = 1
            waiting.append(node)
            if len(operands) == 2:  # sorted, without its overhead
                x, y = operands
                waiting += (x, y) if when[x.index] <= when[y.index] else (y, x)
            else:
                waiting += sorted(operands, key=lambda x: when[x.index])
        return found

    def _times(self) -> list[int]:
        """Latency of every node so far."""
        when = self.when
        for made in self.graph.nodes[len(when) :]:
            operands = made.operands
            if len(operands) == 2:  # the maximum, without its overhead
                x, y = operands
                begin, other = when[x.index], when[y.index]
                begin = other if other > begin else begin
            else:
                begin = max([when[x.index] for x in operands], default=0)
            when.append(begin + (LATENCY.get(made.op, 1) if operands else 0))
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
    uses = Counter(operand_indices(nodes))
    kept = {x.index for x in outputs if isinstance(x, Expression)}
    return [node for node in nodes if uses[node.index] == 1 and node.index not in kept]


def _sums(nodes, products, once) -> tuple[dict, set]:
    """Sums of more than two terms, products among them, as {node: [(sign, term)]}, and the nodes inside them.

    ``once`` are the sums with one use.
    """
    chains = [node for node in nodes if node.op in CHAIN]
    within = once.intersection(operand_indices(chains))
    within -= _plain_sums(chains, products, within)
    sums, absorbed = {}, set()
    for node in chains:
        if node.index not in within and not within.isdisjoint(map(INDEX_OF, node.operands)):
            terms, inside = _terms(node, within)
            if not products.isdisjoint([term.index for _, term in terms]):
                sums[node.index] = terms
                absorbed |= inside
    return sums, absorbed


def _plain_sums(chains, products, within) -> set:
    """Sums of two or more terms without products among them."""
    plain, mixed = set(), set(products)
    for node in chains:
        if not mixed.isdisjoint(map(INDEX_OF, node.operands)):
            if node.index in within:
                mixed.add(node.index)
        elif node.op != "neg":
            plain.add(node.index)
    return plain


def _terms(root: Expression, within) -> tuple[list, set]:
    """Terms (sign, node) of a sum, and the nodes inside it."""
    terms, inside, waiting = [], set(), [(1, root)]
    while waiting:
        sign, node = waiting.pop()
        if node is not root:
            if node.index not in within:
                terms.append((sign, node))
                continue
            inside.add(node.index)
        if node.op == "neg":
            waiting.append((-sign, node.operands[0]))
        else:
            x, y = node.operands
            waiting += (sign if node.op == "add" else -sign, y), (sign, x)
    return terms, inside


def part(whole: Schedule, outputs: list) -> Schedule:
    """Schedule of some of the outputs: each is computed, and rounded, as in the whole."""
    known, needed = {node.index: node for node in whole.nodes}, set()
    waiting = [x.index for x in outputs if isinstance(x, Expression)]
    while waiting:
        index = waiting.pop()
        if index in known and index not in needed:
            needed.add(index)
            waiting += [x.index for x in known[index].operands]
    return Schedule([node for node in whole.nodes if node.index in needed], whole.inputs, outputs)


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
