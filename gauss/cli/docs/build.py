"""Sources of the documentation in one folder, and HTML of them by Sphinx."""

import os
import shutil
import sys
import warnings
from importlib import import_module
from pathlib import Path

from gauss.cli.docs import generated, reference
from gauss.errors import FileError, extra, writing

HERE = Path(__file__).parent
PACKAGES = ("furo", "joblib", "myst_parser", "sphinx_copybutton", "sphinx_design", "sphinx_gallery", "gymnasium")
OF_EXAMPLES = ("casadi", "xarray")


def build(output: Path, program, gallery: bool = True, strict: bool = False) -> Path:
    """Write the documentation as HTML.

    Parameters
    ----------
    output : Path
        Folder of the pages; sources and the state of Sphinx are kept in ``.build`` below it, so that a second build takes
        a fraction of the time.
    program : click.Group
        The commands of the command line.
    gallery : bool
        Whether the examples are run and drawn.
    strict : bool
        Whether a warning is an error.

    Returns
    -------
    Path
        The start page.

    Raises
    ------
    FileError
        If the folder cannot be written, or Sphinx fails, with what it says above.
    MissingPackageError
        If Sphinx or one of its extensions is not installed.
    """
    with extra("docs"):
        for package in (*PACKAGES, *(OF_EXAMPLES if gallery else ())):
            import_module(package)
        sphinx = import_module("sphinx.cmd.build")
    work = output / ".build"
    with writing(output):
        collect(work / "pages", program)
    command = [] if sys.stdout.isatty() else ["-q"]  # a terminal shows how far Sphinx is
    command += ["-b", "html", "-j", str(min(2, os.cpu_count() or 1)), "-c", str(HERE), "-d", str(work / "doctrees")]
    command += ["-D", f"plot_gallery={int(gallery)}"] + (["-W", "--keep-going"] if strict else [])
    with warnings.catch_warnings():
        for kind in (DeprecationWarning, PendingDeprecationWarning):  # of what extensions call of Sphinx
            warnings.simplefilter("ignore", kind)
        failed = sphinx.main([*command, str(work / "pages"), str(output)])
    if failed:
        raise FileError(f"{output}: the documentation was not built; Sphinx says why above.")
    return output / "index.html"


def collect(folder: Path, program):
    """Copy the pages into a folder, and add those that are made of the package."""
    shutil.copytree(HERE / "pages", folder, dirs_exist_ok=True)
    for name, source in generated.copies().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
    pages, pictures = generated.notebook_pages()
    for name, text in (generated.texts(program) | reference.pages() | pages).items():
        _write(folder / name, text)
    for name, picture in pictures.items():
        (folder / name).write_bytes(picture)


def _write(path: Path, text: str):
    """Write a page unless it stands there already: Sphinx reads again what is newer."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
