"""Quadratic programmes of mechanics by classes, with references of thirty digits, verdicts with proofs, and files."""

from gauss.bench.suite.catalogue import CLASSES, VERSION, instances, made, recipes
from gauss.bench.suite.fclib import read_fclib
from gauss.bench.suite.files import export_suite, fingerprint, read_npz
from gauss.bench.suite.instance import SuiteInstance, SuiteReference
from gauss.bench.suite.optimality import residuals
from gauss.bench.suite.qps import read_qps

__all__ = [
    "CLASSES",
    "VERSION",
    "SuiteInstance",
    "SuiteReference",
    "export_suite",
    "fingerprint",
    "instances",
    "made",
    "read_fclib",
    "read_npz",
    "read_qps",
    "recipes",
    "residuals",
]
