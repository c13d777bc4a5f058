"""Machine code of a large scene with loops: a call graph of kernels, with proximal iterations for the multipliers."""

from functools import cached_property

import numpy as np

from gauss.codegen import Kernel
from gauss.codegen.kernels import CallRecorder, RecordedSections, SingleRowFunction, Vector
from gauss.dynamics.call_graph import DAMPED, CallGraph
from gauss.dynamics.call_graph_code import CallGraphCode
from gauss.dynamics.constrained_aba import MU
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.kernel_program import added_forces
from gauss.dynamics.mechanism import loop_constraint_scales
from gauss.dynamics.store import cached, cached_on_disk
from gauss.system import System

Gains = tuple[float, float] | None


class CallGraphKernels:
    """Forward dynamics, their check and projection, called as :class:`gauss.dynamics.traced_system.Kernels` are.

    ``system``: one with loops or couplings, without relations and gear trains. ``gains``: gains α and β [1/s] of the
    Baumgarte feedback −2α φ̇ − β² φ.
    """

    def __init__(self, system: System, gains: Gains = None):
        self.system, self.gains = system, gains

    @cached_property
    def forward(self) -> Kernel:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        return self._kernel("forward")

    @cached_property
    def check(self) -> Kernel:
        """(point, generalised forces) → error of the accelerations of the point."""
        return self._kernel("check")

    @cached_property
    def project(self) -> Kernel:
        """(t, q, v) → (q and v on the constraints, position residual)."""
        return self._kernel("project")

    def _kernel(self, name: str) -> Kernel:
        make = lambda: Kernel(getattr(call_graph_code(self.system, self.gains), name), batch=False)  # noqa: E731
        return cached_on_disk(self.system, (CallGraphKernels, name, self.gains), make)


def call_graph_kernels(system: System, gains: Gains = None) -> CallGraphKernels:
    """Machine code of a large scene with loops, made on first request; gains as of :class:`CallGraphKernels`."""
    return cached(system, (CallGraphKernels, gains), lambda: CallGraphKernels(system, gains))


def refined_call_graph(system: System, loads) -> SingleRowFunction:
    """(q, v, τ, t) → as :func:`gauss.dynamics.traced_refinement.refined_once`, under loads."""
    return call_graph_code(system).refined(added_forces(system, loads))


def call_graph_code(system: System, gains: Gains = None) -> CallGraphCode:
    """Functions of a large scene with loops, recorded on first request."""
    sections = cached(system, (_recorded,), lambda: _recorded(system))
    floor = acceleration_scale(system)
    return cached(
        system, (CallGraphCode, gains), lambda: CallGraphCode(system, sections, loop_constraint_scales(system), floor, gains)
    )


def _recorded(system: System) -> RecordedSections:
    """Recursions of all subsystems, section by section."""
    recorder = CallRecorder()
    sizes = {"q": system.n_q, "v": system.n_v, "effort": system.n_v, "rates": system.n_v}
    given = {name: recorder.keep(np.zeros(size)) for name, size in sizes.items()}
    graphs = [CallGraph(one, recorder, given["q"][one.q], given["v"][one.v]) for one in system.subsystems]
    scales = _joined([graph.scales for graph in graphs])
    given |= {name: recorder.keep(np.zeros(scales.size)) for name in ("multipliers", "gap")}
    ends = np.cumsum([graph.scales.size for graph in graphs], dtype=int)
    rows = [slice(end - graph.scales.size, end) for graph, end in zip(graphs, ends, strict=True)]
    here = [graph.subsystem.v for graph in graphs]
    vectors = {name: Vector(places) for name, places in given.items()} | {"scales": Vector(scales)}

    def write_section(section: str, ask):
        """Record a section; its results along rates (n_v,), and by row."""
        recorder.section(section)
        found = [ask(graph, v, own) for graph, v, own in zip(graphs, here, rows, strict=True)]
        whole = np.zeros(system.n_v).astype(object)
        for v, (along, _) in zip(here, found, strict=True):
            whole[v] = along
        vectors[f"{section} rates"] = Vector(whole)
        vectors[f"{section} rows"] = Vector(_joined([across for _, across in found]))

    tau, multipliers, rates = given["effort"], given["multipliers"], given["rates"]
    write_section("motion", lambda graph, v, own: graph.motion(tau[v], multipliers[own], still=False))
    write_section("response", lambda graph, v, own: graph.motion(tau[v], multipliers[own], still=True))
    write_section("residual", lambda graph, v, own: graph.residual(rates[v], multipliers[own], tau[v]))
    write_section("slip", lambda graph, v, own: graph.velocity_residual())
    write_section("closure", lambda graph, v, own: graph.loop_residual()[::-1])
    recorder.section("factor damped")
    for graph in graphs:
        graph.factor_damped()
    for section, mu in (("multipliers", MU), ("damped", DAMPED)):
        recorder.section(section)
        found = [graph.multipliers(given["gap"][own], mu) for graph, own in zip(graphs, rows, strict=True)]
        vectors[f"solved {section}"] = Vector(_joined(found))
    return RecordedSections(recorder.compiled(), vectors)


def _joined(parts) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=object), *parts])
