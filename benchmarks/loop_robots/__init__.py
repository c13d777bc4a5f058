"""Robots with loops and geared rotors: see ``benchmarks/loop_robots/__main__.py``."""
