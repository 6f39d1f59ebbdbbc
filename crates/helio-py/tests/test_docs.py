"""Every public thing is documented, and its examples run."""

from __future__ import annotations

import doctest
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import helio_py as hp

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
