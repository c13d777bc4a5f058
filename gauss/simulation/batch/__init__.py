"""Batches (ensembles) of motions, in the lanes of vector registers and in threads."""
