"""Mechanisms by Gauss's principle of least constraint."""
