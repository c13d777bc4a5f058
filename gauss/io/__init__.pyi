from gauss.io.catalog import catalog, linkages, networks, servos
from gauss.io.load import load, save
from gauss.io.results import write_csv

__all__ = ["catalog", "linkages", "load", "networks", "save", "servos", "write_csv"]
