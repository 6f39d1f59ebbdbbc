"""The notebooks of the examples run from top to bottom, and nothing they say is kept in them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[3] / "examples" / "notebooks"
NAMES = sorted(path.name for path in NOTEBOOKS.glob("*.ipynb"))


def test_there_are_some() -> None:
    assert set(NAMES) >= {
        "a-day-of-12000.ipynb",
        "calibrating-juelich.ipynb",
        "first-steps.ipynb",
        "from-frames-to-report.ipynb",
        "juelich-records.ipynb",
    }


# Jupyter's own packages warn of one another.
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", NAMES)
def test_they_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code), "clear its outputs"
    # One that asks with `get` has more to show where there are data, and runs without.
    if any('environ["HELIO_DATA"]' in cell.source for cell in code) and not os.environ.get("HELIO_DATA"):
        pytest.skip("no recorded data: set HELIO_DATA")
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
