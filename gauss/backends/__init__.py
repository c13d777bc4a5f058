"""Gauss's problem and the methods that solve it.

    ½ (a − a_free)ᵀ Φ (a − a_free) − Pᵀ q̈ → min,   A a + B q̈ = D,   G (a, q̈) ≤ h

* the problem: :class:`~gauss.backends.compulsion.Compulsion` (A, B, C, D, Φ, a_free, P, G, h) with its ``structure``; the
  forms F2 and F2s of it that methods prefer (``forms``; F1 and F3 as matrices for QP solvers in ``programme``);
* the result: :class:`~gauss.backends.solution.Solution`, accelerations and multipliers with their certificate;
* the methods: one a file, their table in ``backend``, the rule of choice in ``registry``, the order of rescue in ``solve``;
* the path: ``solve`` → ``registry`` (backend) → ``answering`` (its answer) → ``certificate`` (the solution).
"""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
