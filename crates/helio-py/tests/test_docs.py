"""Every public thing is documented, and its examples run."""

from __future__ import annotations

import doctest
import inspect
import re
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import helio_py as hp
from conftest import ROOT
from helio_py import plot

PAGES = sorted(path.name for path in (ROOT / "docs").glob("python*.md"))
NAMES = [name for name in hp.__all__ if name != "__version__"]


@pytest.mark.parametrize("name", NAMES)
def test_every_public_thing_has_a_docstring(name: str) -> None:
    thing = getattr(hp, name)
    assert inspect.getdoc(thing)
    if inspect.isclass(thing):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or inspect.isgetsetdescriptor(value)):
                assert inspect.getdoc(value), f"{name}.{member}"


@pytest.mark.parametrize("name", [name for name in NAMES if ">>>" in (inspect.getdoc(getattr(hp, name)) or "")])
def test_examples_run(name: str, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    text = inspect.getdoc(getattr(hp, name))
    assert text
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    said: list[str] = []
    with np.printoptions(legacy=False):
        failed, tried = doctest.DocTestRunner().run(example, out=said.append)
    assert tried > 0
    assert not failed, "".join(said)


@pytest.mark.parametrize("page", ["README.md", "crates/helio-py/README.md"])
def test_the_readmes_examples_run(page: str, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    blocks = re.findall(r"```python\n(.*?)```", (root / page).read_text(), re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), {})


def blocks_of(page: str, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def beside_the_examples(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of the test's own in which the examples lie too."""
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page, "python")])
@pytest.mark.usefixtures("beside_the_examples")
def test_the_manual_s_examples_run(page: str) -> None:
    names: dict[str, object] = {}
    for block in blocks_of(page, "python"):
        exec(compile(block, page, "exec"), names)
    plt.close("all")


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page, "pycon")])
@pytest.mark.usefixtures("beside_the_examples")
def test_the_manual_s_messages_are_those_that_come(page: str) -> None:
    for block in blocks_of(page, "pycon"):
        example = doctest.DocTestParser().get_doctest(block, {}, page, None, None)
        said: list[str] = []
        failed, tried = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example, out=said.append)
        assert tried > 5
        assert not failed, "".join(said)


def test_every_public_name_is_in_the_manual() -> None:
    told = "".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in PAGES)
    there = {name.rpartition(".")[2] for name in re.findall(r"^::: (helio_py\.\S+)$", told, re.MULTILINE)}
    assert "_errors" in there  # which has all of them
    errors = {name for name in NAMES if inspect.isclass(getattr(hp, name)) and issubclass(getattr(hp, name), Exception)}
    assert {*NAMES, *plot.__all__} - errors <= there


def test_a_newcomer_gets_the_picture_and_the_words_of_the_manual(root: Path, beside_the_examples: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(root / "examples" / "first_plot.py")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout in blocks_of("python.md", "text")
    picture = plt.imread(beside_the_examples / "first_plot.png")
    assert picture.shape == (480, 1200, 4)
    assert len(np.unique(picture.reshape(-1, 4), axis=0)) > 100  # there is something on it
    # What the manual says to type names what is there.
    (typed,) = blocks_of("python.md", "sh")
    for path in ("crates/helio-py", "examples/first_plot.py"):
        assert path in typed
        assert (root / path).exists()
    subprocess.run(["bash", "-n", str(root / "examples" / "newcomer.sh")], check=True)


def test_a_type_checker_knows_what_is_not_there(tmp_path: Path) -> None:
    user = tmp_path / "user.py"
    user.write_text("import helio_py as hp\n\nhp.Paint\nhp.plot.field_map\nhp.bogus\n")
    cache = ["--cache-dir", str(tmp_path / "cache")]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", *cache, str(user)], capture_output=True, text=True, check=False
    )
    assert 'error: Module has no attribute "bogus"' in done.stdout, done.stdout
    assert "Found 1 error" in done.stdout, done.stdout
