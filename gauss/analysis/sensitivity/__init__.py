"""Derivatives of motions with events: smooth phases, and the jumps of small changes between them."""
