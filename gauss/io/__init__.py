"""Scenes and motions in files and by name."""

from gauss.io.catalog import catalog
from gauss.io.linkage import load_linkage
from gauss.io.load import load, save

__all__ = ["catalog", "load", "load_linkage", "save"]
