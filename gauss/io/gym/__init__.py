"""Environments of Gymnasium for scenes with inputs: what :mod:`gauss.gym` hands out."""
