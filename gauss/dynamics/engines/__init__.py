"""Engines: sources of accelerations along a motion, one a file."""
