"""The notebook and the scripts of the README and of the book run as they stand."""

import json
import os
import pathlib
import re
import shutil

import pytest

PYTHON = pathlib.Path(__file__).resolve().parents[1]


def test_the_notebook_runs():
    """Cell by cell; in a kernel of its own where Jupyter is installed."""
    path = PYTHON / "notebooks" / "which_matcher.ipynb"
    notebook = json.loads(path.read_text())
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    names = {}
    for cell in cells:
        exec(compile(cell, path.name, "exec"), names)
    assert names["scores"]["matcher"] == ["sift", "orb", "gms", "akaze_smnn"]
    assert names["scores"]["auc"].max() > 0
    assert names["picture"].png.startswith(b"\x89PNG") and len(names["picture"].png) > 10_000


def test_the_notebook_runs_in_jupyter():
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    import nbformat

    notebook = nbformat.read(PYTHON / "notebooks" / "which_matcher.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300).execute()
    shown = json.dumps(notebook)
    assert "akaze_smnn" in shown and "<table>" in shown and '"image/png"' in shown


def test_the_scripts_of_the_readme_run(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (PYTHON / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 2 and len([line for line in blocks[0].splitlines() if line]) == 10
    before = os.getcwd()
    os.chdir(tmp_path)
    try:
        for block in blocks:
            exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    finally:
        os.chdir(before)
    assert (tmp_path / "my-run" / "report" / "index.html").is_file()


def test_the_script_of_the_book_runs(dataset, tmp_path, monkeypatch):
    text = (PYTHON.parent / "docs" / "matchers.md").read_text()
    (script,) = [block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "mb.run" in block]
    shutil.copytree(dataset.path, tmp_path / "castle")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "matchers.md", "exec"), {"__name__": "book"})
    assert len(list(tmp_path.glob("runs/python/records/*/orb_mutual+best.jsonl"))) == 1
