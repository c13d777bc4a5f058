"""Comparison of QP backends and methods on mechanism problems, and where methods fail."""
