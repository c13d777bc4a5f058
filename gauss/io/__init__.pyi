from gauss.io.catalog import catalog, linkages, networks, servos
from gauss.io.fclib import load_fclib, save_fclib
from gauss.io.load import load, save
from gauss.io.results import write_csv

__all__ = ["catalog", "linkages", "load", "load_fclib", "networks", "save", "save_fclib", "servos", "write_csv"]
