"""Scenes and motions in files and by name."""

from gauss.io.catalog import catalog
from gauss.io.load import load, save

__all__ = ["catalog", "load", "save"]
