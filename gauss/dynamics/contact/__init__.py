"""Unilateral and set-valued elements: at one instant, over one step of Moreau–Jean time stepping, and at impacts."""
