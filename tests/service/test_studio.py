"""`wizen serve --studio`: the store it makes, the tables it lays in, the token it gives."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.commands.studio import fit_out
from store import starter
from store.errors import ReadOnlyStore
from store.store import Store
from store.tokens import Tokens


def test_a_studio_has_the_packages_tables_and_a_token_for_a_day(tmp_path: Path) -> None:
    secret = fit_out(tmp_path / "own")
    store, package = Store.open(tmp_path / "own"), Store(starter.ROOT)
    assert store.table_names() == package.table_names()
    for path in (starter.ROOT / "tables").rglob("*.*"):
        assert (store.root / path.relative_to(starter.ROOT)).read_bytes() == path.read_bytes()
    token = Tokens(store.root).find(secret)
    assert token is not None
    assert token.scopes == ("run",)
    assert token.expires is not None
    assert token.expires - token.created == pytest.approx(86_400)


def test_what_is_there_stays(tmp_path: Path) -> None:
    first = fit_out(tmp_path / "own")
    (tmp_path / "own" / "tables" / "raisin" / "current.json").unlink()
    names = Store.open(tmp_path / "own").table_names()
    fit_out(tmp_path / "own")
    # a store with tables of its own gets no others, and whoever works there already goes on
    assert Store.open(tmp_path / "own").table_names() == names
    assert Tokens(tmp_path / "own").find(first) is not None


def test_the_package_is_no_studio() -> None:
    with pytest.raises(ReadOnlyStore):
        fit_out(starter.ROOT)
