"""The header that every result carries, as the benchmarks of the package write it."""

from gauss.bench.machine import header

__all__ = ["header"]
