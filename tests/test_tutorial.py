"""The tutorial runs from its first cell to its last, and draws what it says it draws."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[1] / "models" / "tutorial.ipynb"
SECTIONS = (
    "A serial arm",
    "A four-bar",
    "A sweep",
    "A Stewart platform",
    "A friction drive",
    "A crane on servos",
    "Backends side by side",
    "Work and precision",
)


@pytest.fixture(scope="module")
def executed():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    folder = {"metadata": {"path": str(NOTEBOOK.parents[1])}}
    return NotebookClient(notebook, timeout=300, kernel_name="python3", resources=folder).execute()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # the kernel's own, about how it is reached
def test_every_cell_runs_and_figures_are_drawn(executed):
    outputs = [output for cell in executed.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "error"]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 7
    text = "".join(output.get("text", "") for output in outputs)
    assert "agreement in 5 random states" in text and "redundant rows" in text


@pytest.mark.slow
def test_it_has_a_section_for_each_part_of_the_library(executed):
    headings = [cell.source.splitlines()[0] for cell in executed.cells if cell.cell_type == "markdown"]
    assert [heading.removeprefix("## ") for heading in headings if heading.startswith("## ")] == list(SECTIONS)


def test_what_is_kept_in_the_file_was_run_without_an_error():
    kept = nbformat.read(NOTEBOOK, as_version=4)
    cells = [cell for cell in kept.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert not [output for cell in cells for output in cell.outputs if output.output_type in ("error", "stream.stderr")]
