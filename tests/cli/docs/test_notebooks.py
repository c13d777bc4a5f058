"""Notebooks of the documentation run from their first cell to their last, and are shown as they were run."""

import nbformat
import pytest
from nbclient import NotebookClient

from gauss.cli.docs import generated
from gauss.io.catalog import folder

BOOKS = generated.notebooks()
NAMES = ["control", "export", "identification", "optimisation"]
NEEDED = {"control": "control", "export": "sympy", "optimisation": "casadi", "identification": "clarabel"}
FIGURES = {"control": 3, "export": 1, "identification": 3, "optimisation": 4}


def pictures(cells) -> int:
    outputs = [output for cell in cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "error"]
    return sum("image/png" in output.get("data", {}) for output in outputs)


def test_there_is_one_for_each_part_of_design():
    assert [path.stem for path in BOOKS] == NAMES


@pytest.mark.slow
@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # the kernel's own, about how it is reached
def test_every_cell_runs_and_figures_are_drawn(path):
    pytest.importorskip(NEEDED[path.stem])
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(folder().parent)}}
    executed = NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    assert pictures(executed.cells) == FIGURES[path.stem]


@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_pages_show_what_was_run(path):
    kept = nbformat.read(path, as_version=4)
    cells = [cell for cell in kept.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert pictures(kept.cells) == FIGURES[path.stem]
    pages, files = generated.notebook_pages()
    text = pages[f"notebooks/{path.stem}.md"]
    own = [name for name in files if name.startswith(f"notebooks/{path.stem}_")]
    assert len(own) == FIGURES[path.stem] and all(f"]({name.removeprefix('notebooks/')})" in text for name in own)
    assert all(files[name].startswith(b"\x89PNG") for name in own)
    assert all(line in text for cell in cells for line in cell.source.splitlines() if not line.startswith("%"))
