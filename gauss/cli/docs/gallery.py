"""The gallery: order of its sections, matplotlib figures that an example keeps under a name, films that it writes."""

import shutil
from pathlib import Path

from matplotlib.figure import Figure

DPI = 110
SECTIONS = ("first", "arms", "loops", "linkages", "rotors", "servo", "contact", "control", "analysis", "solvers", "issues")


def of_sections(folder: str) -> int:
    """Place of a folder of examples among the others."""
    name = Path(folder).name
    return SECTIONS.index(name) if name in SECTIONS else len(SECTIONS)


def scraped(block, block_vars: dict, gallery_conf: dict) -> str:
    """Save the figures of an example, and return the lines that show them.

    Parameters
    ----------
    block : tuple
        Code of the example; not used.
    block_vars : dict
        Of sphinx-gallery: ``example_globals`` are the names of the example, ``image_path_iterator`` the files to write.
    gallery_conf : dict
        Of sphinx-gallery.
    """
    from sphinx_gallery.scrapers import figure_rst

    names = block_vars["example_globals"]
    shown = names.setdefault("__shown__", set())
    written = []
    for thing in list(names.values()):
        if isinstance(thing, Figure) and id(thing) not in shown:
            shown.add(id(thing))
            path = next(block_vars["image_path_iterator"])
            thing.savefig(path, dpi=DPI)
            written.append(path)
        elif isinstance(thing, Path) and thing.suffix in (".gif", ".png") and thing.exists() and thing not in shown:
            shown.add(thing)
            path = str(Path(next(block_vars["image_path_iterator"])).with_suffix(thing.suffix))
            shutil.copy(thing, path)
            written.append(path)
    return figure_rst(written, gallery_conf["src_dir"])


def reset(gallery_conf: dict, name):
    """Show warnings of each example anew."""
    import warnings

    warnings.resetwarnings()
    for kind in (DeprecationWarning, PendingDeprecationWarning):  # of what extensions call of Sphinx
        warnings.simplefilter("ignore", kind)
    warnings.simplefilter("default", UserWarning)
