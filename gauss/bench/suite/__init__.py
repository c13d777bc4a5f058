"""Quadratic programmes of mechanics by classes, with references of thirty digits, verdicts with proofs, and files."""

from gauss.bench.suite.catalogue import CLASSES, VERSION, instances, made, recipes
from gauss.bench.suite.instance import Instance, Reference

__all__ = ["CLASSES", "Instance", "Reference", "VERSION", "instances", "made", "recipes"]
