"""Factors of positive definite matrices: ours, and MKL's Pardiso where it is installed and asked for."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidInput, Need
from solver.linalg import definite, multifrontal
from solver.linalg.patterns import of_pairs

DISC = {"shape": "disc", "tools": [{"kind": "spot", "at": (0.2, 0.0, 0.0)}]}


def strip(n: int = 40) -> tuple[multifrontal.Analysis, np.ndarray]:
    """Springs of random stiffness along a strip of nodes, held softly: order and blocks of a definite matrix."""
    generator = np.random.default_rng(3)
    pairs = np.concatenate([np.stack([np.arange(n - k), np.arange(k, n)], -1) for k in (1, 2, 7)])
    indptr, indices, diagonal = of_pairs(pairs, n)
    rows = np.repeat(np.arange(n), np.diff(indptr))
    way = generator.normal(size=(n, 3))
    blocks = np.zeros((len(indices), 3, 3))
    for entry, (i, j) in enumerate(zip(rows, indices, strict=True)):
        if i != j:
            blocks[entry] = -np.outer(way[i] - way[j], way[i] - way[j])
            blocks[diagonal[i]] -= blocks[entry]
    blocks[diagonal] += 0.01 * np.eye(3)
    centres = np.stack([pairs.mean(axis=1), *np.zeros((2, len(pairs)))], -1)
    return multifrontal.analyse(pairs, centres, indptr, indices), blocks


@pytest.fixture
def mkl(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pypardiso", reason="no Pardiso: pip install -e '.[mkl]'")
    monkeypatch.setenv("WIZEN_FACTOR", "mkl-pardiso")
    assert definite.chosen() == "mkl-pardiso"


def test_ours_is_taken_unless_another_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WIZEN_FACTOR", raising=False)
    assert definite.chosen() == "wizen"
    analysis, blocks = strip()
    right = np.random.default_rng(0).normal(size=analysis.size)
    factor = definite.factorise(analysis, blocks)
    assert isinstance(factor, multifrontal.Factor)
    whole = np.zeros((analysis.size, analysis.size))
    for i in range(len(analysis.indptr) - 1):
        for entry in range(analysis.indptr[i], analysis.indptr[i + 1]):
            j = analysis.indices[entry]
            whole[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = blocks[entry]
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(whole, right), rtol=1e-9, atol=1e-9)
    with pytest.raises(np.linalg.LinAlgError):
        definite.factorise(analysis, -blocks)


def test_what_is_not_installed_is_refused_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    definite._installed.cache_clear()
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    monkeypatch.setenv("WIZEN_FACTOR", "mkl-pardiso")
    growth = registry.get("growth")
    with pytest.raises(InvalidInput, match="not installed") as refused:
        growth.solve(growth.parse(DISC), Need(stages=(0.1,), quality="preview"))
    assert "pip install -e '.[mkl]'" in refused.value.advice


def test_an_unknown_factor_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WIZEN_FACTOR", "umfpack")
    with pytest.raises(InvalidInput, match="must be wizen or mkl-pardiso, not 'umfpack'"):
        definite.chosen()


def test_growth_names_the_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WIZEN_FACTOR", raising=False)
    growth = registry.get("growth")
    assert growth.solve(growth.parse(DISC), Need(stages=(0.0,), quality="preview")).attrs["factor"] == "wizen"


@pytest.mark.usefixtures("mkl")
def test_pardiso_solves_as_ours_does_and_repeats_its_bytes() -> None:
    analysis, blocks = strip()
    right = np.random.default_rng(0).normal(size=analysis.size)
    for scale in (1.0, 2.0):
        ours = multifrontal.factorise(analysis, scale * blocks, definite=True).solve(right)
        theirs = definite.factorise(analysis, scale * blocks).solve(right)
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max())
    assert np.array_equal(definite.factorise(analysis, scale * blocks).solve(right), theirs)


@pytest.mark.usefixtures("mkl")
def test_pardiso_refuses_what_ours_refuses_and_goes_on() -> None:
    analysis, blocks = strip()
    right = np.ones(analysis.size)
    before = definite.factorise(analysis, blocks)
    kept = before.solve(right)
    for wrong in (-blocks, np.full_like(blocks, np.nan)):
        with pytest.raises(np.linalg.LinAlgError):
            definite.factorise(analysis, wrong)
    with pytest.raises(RuntimeError, match="earlier"):
        before.solve(right)
    assert np.array_equal(definite.factorise(analysis, blocks).solve(right), kept)
    del analysis, before
    gc.collect()


@pytest.mark.usefixtures("mkl")
def test_growth_by_pardiso_is_growth(monkeypatch: pytest.MonkeyPatch) -> None:
    growth = registry.get("growth")
    asked = Need(stages=(0.0, 0.2), quality="preview")
    theirs, again = (growth.solve(growth.parse(DISC), asked) for _ in range(2))
    monkeypatch.delenv("WIZEN_FACTOR")
    ours = growth.solve(growth.parse(DISC), asked)
    assert theirs.attrs["factor"] == "mkl-pardiso"
    assert ours["converged"].all()
    assert theirs["converged"].all()
    # one equilibrium, reached by steps that differ in their last digits
    np.testing.assert_allclose(theirs["stored_energy"], ours["stored_energy"], rtol=1e-4)
    assert np.array_equal(theirs["mesh_position"], again["mesh_position"])
