"""Equations of motion as code of other languages: what :mod:`gauss.export` hands out, one language a file."""
