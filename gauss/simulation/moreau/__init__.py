"""Moreau–Jean time stepping: impacts and friction within steps of one length."""
