"""Tokens: hashed at rest, shown once, and without one nothing is run."""

from __future__ import annotations

import json
import stat
import threading
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from store.errors import CorruptTokens, InvalidToken, ReadOnlyStore, UnknownToken
from store.starter import ROOT as STARTER
from store.store import Store
from store.tokens import Tokens
from sweeps.commands.cli import app

from ._asking import checked
from .conftest import QUERY, SHAPE, client_of

ASKED: dict[str, Any] = {"solver": "dehydration", "need": {"stages": [0.05], "quality": "preview"}}


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


def test_a_secret_is_not_kept_and_its_file_is_private(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)
    token, secret = tokens.create("studio", ["run"])
    assert secret not in tokens.path.read_text()
    assert secret.removeprefix(f"wizen_{token.id}_") not in tokens.path.read_text()
    assert stat.S_IMODE(tokens.path.stat().st_mode) == 0o600
    assert Tokens(tmp_path).find(secret) == token
    changed = secret[:-1] + ("A" if secret[-1] != "A" else "B")
    for wrong in (changed, secret + "A", "wizen_", "", "é", secret.replace(token.id, "0" * 12)):
        assert tokens.find(wrong) is None
    tokens.revoke("studio")
    assert tokens.find(secret) is None
    with pytest.raises(UnknownToken):
        tokens.revoke("studio")


def test_tokens_that_cannot_be(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)
    tokens.create("one", ["read"])
    scopes: list[Any]
    for name, scopes, seconds in (
        ("one", ["read"], None),
        ("", ["read"], None),
        ("a\nb", ["read"], None),
        ("two", [], None),
        ("two", ["rum"], None),
        ("two", ["run"], -1.0),
    ):
        with pytest.raises(InvalidToken):
            tokens.create(name, scopes, seconds)
    assert [token.name for token in tokens.all()] == ["one"]
    with pytest.raises(ReadOnlyStore):
        Tokens(STARTER).create("two", ["run"])
    (good,) = json.loads(tokens.path.read_text())
    damage: list[Any] = [{"expires": when} for when in ("soon", float("nan"), 10**400)]
    damage += [{"scopes": ["write"]}, {"scopes": 3}, {"id": None}, {"digest": "é"}, {"created": []}]
    for entry in ({}, *({**good, **wrong} for wrong in damage)):
        tokens.path.write_text(json.dumps([entry]))
        with pytest.raises(CorruptTokens):
            Tokens(tmp_path).all()
    tokens.path.write_text(json.dumps([good]))
    assert [token.name for token in Tokens(tmp_path).all()] == ["one"]


def test_many_at_once_lose_no_token(tmp_path: Path) -> None:
    threads = [threading.Thread(target=lambda i=i: Tokens(tmp_path).create(f"t{i}", ["read"])) for i in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(Tokens(tmp_path).all()) == 12


def test_without_a_good_token_nothing_is_run(own: Store) -> None:
    tokens = Tokens(own.root)
    with client_of(own.root, jobs_workers=0) as client:
        answer = client.post("/v1/jobs", json=ASKED)
        assert "wizen token create" in checked(answer, 401, "unauthorized")["advice"]
        assert answer.headers["www-authenticate"].startswith("Bearer")
        wrong = client.post("/v1/jobs", json=ASKED, headers=bearer("wizen_guess"))
        checked(wrong, 401, "unauthorized")
        assert 'error="invalid_token"' in wrong.headers["www-authenticate"]
        reader = client.post("/v1/jobs", json=ASKED, headers=bearer(tokens.create("reader", ["read"])[1]))
        assert "'run'" in checked(reader, 403, "forbidden")["detail"]
        assert 'scope="run"' in reader.headers["www-authenticate"]
        short = tokens.create("short", ["run"], 0.2)[1]
        time.sleep(0.3)
        assert (
            "expired"
            in checked(client.post("/v1/jobs", json=ASKED, headers=bearer(short)), 401, "unauthorized")["detail"]
        )
        assert own.ledger.jobs("wanted") == []
        good = tokens.create("good", ["run"])[1]
        asked = client.post("/v1/jobs", json=ASKED, headers=bearer(good))
        assert asked.status_code == 202
        checked(client.delete(asked.headers["location"]), 401, "unauthorized")
        # revoking holds from the next request on
        tokens.revoke("good")
        checked(client.delete(asked.headers["location"], headers=bearer(good)), 401, "unauthorized")


def test_reading_can_be_closed(own: Store, client: httpx.Client) -> None:
    assert "public" in client.get(SHAPE, params=QUERY).headers["cache-control"]
    headers = bearer(Tokens(own.root).create("studio", ["run"])[1])
    with client_of(own.root, public_read=False) as closed:
        pages = (SHAPE, "/v1/tables", "/v1/tables/default", "/v1/solvers", "/v1/jobs", f"/v1/jobs/{'0' * 64}/result")
        for page in pages:
            checked(closed.get(page, params=QUERY), 401, "unauthorized")
        answer = closed.get(SHAPE, params=QUERY, headers=headers)
        assert answer.status_code == 200
        assert "private" in answer.headers["cache-control"]
        for page in ("/v1/maps/default/thumbnail.png", "/v1/solvers/dehydration/presets/potato/portrait.png"):
            assert closed.get(page, headers=headers).headers["cache-control"] == "private, max-age=86400"
            checked(closed.get(page), 401, "unauthorized")
        for page in ("/", "/healthz", "/openapi.json", "/metrics"):
            assert closed.get(page).status_code == 200
        paths = closed.get("/openapi.json").json()["paths"]
        assert paths["/v1/shapes/{solver}"]["get"]["security"] == [{"token": []}]
        assert "401" in paths["/v1/shapes/{solver}"]["get"]["responses"]


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def wizen(*words: str) -> Any:
        with pytest.raises(SystemExit) as ended:
            app([*words, "--store", str(tmp_path / "store"), "--json"])
        out = capsys.readouterr().out
        return ended.value.code, json.loads(out)

    code, made = wizen("token", "create", "--name", "studio", "--scopes", "run,read", "--expires", "90d")
    assert (code, made["scopes"]) == (0, ["read", "run"])
    tokens = Tokens(tmp_path / "store")
    (token,) = tokens.all()
    assert tokens.find(made["secret"]) == token
    assert token.expires is not None
    assert token.expires - token.created == 90 * 86400
    code, listed = wizen("token", "list")
    assert listed["tokens"][0]["name"] == "studio"
    assert made["secret"] not in json.dumps(listed)
    assert wizen("token", "create", "--name", "b", "--expires", "soon")[0] == 2
    code, refused = wizen("token", "create", "--name", "b", "--expires", "400000d")
    assert (code, "within 300 years" in json.dumps(refused)) == (2, True)
    code, refused = wizen("token", "create", "--name", "b", "--expires", "0d")
    assert (code, "in the future" in json.dumps(refused)) == (2, True)
    assert wizen("token", "create", "--name", "studio")[0] == 2
    assert wizen("token", "revoke", "studio")[0] == 0
    assert wizen("token", "revoke", "studio")[0] == 1
    assert wizen("work", "--until-empty") == (0, {"solved": 0, "failed": []})
