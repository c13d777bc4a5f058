"""The IFToMM library of computational benchmark problems: by how much gauss meets what is asked, and in what time.

Run it with:

    python -m benchmarks.iftomm [--rounds 15]

* A01 simple pendulum, A02 ladder of N four-bars, A03 Andrews' squeezer, A04 Bricard's linkage, A05 stiff flyball governor.
* error: the worst of all samples and quantities, relative to the reference, or to the threshold where the reference is less;
  no mean of relative errors exceeds it. energy: the largest change that work and dampers do not explain [J].
* asked: what is allowed, and by whom.
  [1] specifications of the library, lim.ii.udc.es/mbsbenchmark/dist/A01/A01_specification.xml and A02/A02_specification.xml:
  2000 s from x = 1 m, position of P1, 4000 output steps; N = 40, 20 s, position and velocity of B0, 400 output steps;
  errors of 1e-1 ("low") and 1e-3 ("high precision") with a threshold of 1e-3. The latter is what is compared with.
  [2] Exudyn's example pendulumIftommBenchmark.py, which refers to the library of the technical committee
  (iftomm-multibody.org/benchmark/problem/Planar_simple_pendulum): 10 s, 5e-5 J.
  [–] What the library allows in A03 to A05 was not found: of their specifications only the heads were at hand. 1e-3 with a
  threshold of 1e-3 and 400 output steps, as in A02, are taken over.
* Motions of A03 to A05, their quantities and pictures are those of "Multi-Body Systems Benchmark in OpenSim", whose pages
  (rehabenggroup.github.io/MBSbenchmarksInOpenSim) run them for 0.05, 10 and 10 s, and whose posters (docs/src of the
  repository RehabEngGroup/MBSbenchmarksInOpenSim), with the durations of [1] for A01 and A02, for 0.5, 600 and 350 s.
* submitted: CPU times that authors of other programs report for the same motion, on their machines. OpenSim 3.2: the pages
  above, Intel Core i5-4570, 3.2 GHz. Exudyn: comments in pendulumIftommBenchmark.py (i7, steps of 0.8 ms, energy to 5e-5 J)
  and fourBarMechanismIftomm.py (i9, steps of 10 ms, energy to 0.11 J). "not found": neither there, nor in what was at hand
  of iftomm-multibody.org and of the papers of González et al. (2005, 2006, 2010), of which that was but the beginning.
* Settings are those that a user gets without asking (DOP853, tolerances of 1e-12) but where the table says otherwise. With
  1e-12 the ladders of 10 and 40 reach 1e-7 to 7e-7.
* wall: one call of ``gauss.simulate`` on a compiled system, samples included, median of interleaved rounds. first: how much
  longer the first call takes, which traces and compiles; no machine code is kept from earlier.

Writes benchmarks/results/iftomm.csv and .md. References of A03 to A05 are in tests/reference/iftomm.json, which
``python -m benchmarks.iftomm.references`` writes anew (heyoka; about two minutes).
"""

from benchmarks.iftomm.problems import BenchmarkProblem, problems
from benchmarks.iftomm.report import MARGIN, measure, page

__all__ = ["MARGIN", "BenchmarkProblem", "measure", "page", "problems"]
