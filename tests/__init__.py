"""Tests of gauss, in the rooms of gauss: ``tests/<package>/test_<module>.py`` tests ``gauss/<package>/<module>.py``.

Beside the rooms stand ``validation`` (closed forms, other engines, reference files and hostile trials, each through many
rooms), ``support`` (mechanisms and helpers that tests import) and ``reference`` (tables that tests compare with); tests of
the library as a whole lie in this folder. ``python -m pytest`` runs all of them. Markers leave some out:
``python -m pytest -m "not slow"`` leaves out what takes seconds and still enters every room; ``-m "not peer"`` leaves
out comparisons with another engine (Pinocchio, MuJoCo, CasADi, SUNDIALS, qpbenchmark).
"""
