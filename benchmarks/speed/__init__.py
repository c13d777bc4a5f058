"""Speed of gauss beside Pinocchio, MuJoCo and SciPy, in one run.

Run it with:

    python -m benchmarks.speed [--rounds 15]

Every row is a contest: the same work done by gauss and by peers, in interleaved rounds in one process on one core. Times
are CPU times of the process, so that other work on the machine counts little; medians are quoted, ratios are medians of the
ratios of single rounds, with their quartiles. What was measured is written whatever it is, beside what it should be, to
benchmarks/results: speed.csv (every round), speed.md, speed.png and speed.svg. With ``GAUSS_VECTORS=4`` machine code and the
matrix product are those of a processor without AVX-512, and the files are named speed_avx2.

The Panda has its fingers fixed, in all engines; Talos stands on a fixed base.

Settings of the peers:

* Pinocchio: wheel of PyPI; ``pin.aba`` from Python with its data made once, in the WORLD convention, the
  faster; its C++ by ``pin.abaInParallel`` over all states on one thread, arrays in Fortran order; fixed joints locked by
  ``buildReducedModel``.
* MuJoCo: wheel of PyPI; the scene as gauss exports it, fixed bodies fused, everything that the scene does not need
  disabled (contacts, constraints, limits, actuators, sensors, checks of controls); RK4 with the loop in C.
* Loops: ``pin.constraintDynamics`` and ``pin.lcaba`` from Python (a call costs about 0.35 µs there), joints added
  depth-first, a contact of a point at each cut, accuracy 1e-12, μ = 1e-6, at most 5 iterations; ``mj_forward`` from Python,
  everything but gravity and equalities disabled, its equalities as hard as the export writes them.
* Long scenes with loops: beside one of a tenth of their bodies; their first accelerations are traced and compiled anew.
* SciPy: ``solve_ivp`` with DOP853 and ``pin.aba``, the last time only; the loosest tolerance that meets the drift.
"""
