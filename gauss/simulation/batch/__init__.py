"""Many motions at once, in machine code."""
