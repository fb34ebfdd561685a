"""--region of query and solve: one way to write it, that of HTTP, and the numbers with commas besides."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from _command import document, wizen
from conftest import Solves

from solver.contract import Region
from solver.lattice import azimuths, colatitudes, window
from sweeps.commands.terminal.regions import part

QUERY = ("query", "--set", "te=0.03", "--set", "gamma=20", "--stages", "0.1,0.15", "--resolution", 16)


def loaded(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as opened:
        return dict(opened)


def test_query_writes_a_part_of_what_it_writes_whole(table: Path, tmp_path: Path) -> None:
    whole, some, same = (tmp_path / f"{name}.npz" for name in ("whole", "some", "same"))
    document(wizen(*QUERY, "--store", table, "--out", whole, "--json"))
    said = document(wizen(*QUERY, "--store", table, "--region", "45:90,350:20", "--out", some, "--json"))
    document(wizen(*QUERY, "--store", table, "--region", "45,90,350,20", "--out", same, "--json"))
    assert some.read_bytes() == same.read_bytes()
    full, part_ = loaded(whole), loaded(some)
    rows, columns = np.arange(4, 8), np.array([0, 1])
    assert said["region"] == {"degrees": "45:90,350:20", "rows": [4, 4], "columns": [0, 2]}
    assert np.array_equal(part_["azimuth"], full["azimuth"][columns])
    assert np.array_equal(part_["colatitude"], full["colatitude"][rows])
    assert part_["position"].shape == (2, 4, 2, 3)
    np.testing.assert_allclose(part_["position"], full["position"][:, rows][:, :, columns], atol=1e-6)
    # it is no closed mesh, and does not say to be one
    assert set(part_) == {"stage", "colatitude", "azimuth", "position", "about"}


def test_query_says_which_part_in_a_document(table: Path, tmp_path: Path) -> None:
    out = tmp_path / "said.json"
    said = document(wizen(*QUERY, "--store", table, "--region", "0:90,-45:45", "--out", out, "--json"))
    assert json.loads(out.read_text())["region"] == said["region"]
    assert said["region"]["columns"] == [28, 9]
    assert "region" not in document(wizen(*QUERY, "--store", table, "--json"))


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".png"])
def test_query_refuses_a_part_where_a_closed_mesh_is_meant(table: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"part{suffix}"
    one = ("query", "--set", "te=0.03", "--set", "gamma=20", "--stages", "0.1")
    refused = wizen(*one, "--store", table, "--region", "0:180,0:360", "--out", out, "--json")
    assert refused.exit_code == 2
    error = document(refused)["error"]
    assert error["code"] == "invalid-option"
    assert error["advice"] == "Leave --region out, or write .npz."
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "azimuth"),
    [
        ("0:90,0:360", [0.0, 360.0]),
        ("0,90,0,180", [0.0, 180.0]),
        ("0:90,350:20", [350.0, 380.0]),
        ("0:90,-45:45", [315.0, 405.0]),
        ("0,90,-360,360", [0.0, 360.0]),
        ("0:90,360:20", [0.0, 20.0]),
    ],
)
def test_solve_takes_both_notations_and_passes_azimuth_0(shrinking: Solves, text: str, azimuth: list[float]) -> None:
    need = document(wizen("solve", "shrinking", "--stages", "0.1", "--region", text, "--json"))["need"]
    assert need["region"] == {"colatitude": [0.0, 90.0], "azimuth": azimuth}


@pytest.mark.parametrize("text", ["30:90,350:20", "30:90,-45:45", "30:90,-90:-30", "30,90,100,200"])
def test_solve_and_query_mean_the_same_part(text: str) -> None:
    """But for points on the ends, which runs leave out at the end: 16 colatitudes have none on these."""
    asked = part(text)
    assert asked is not None
    rows, columns = window(16, Region(**asked.need))
    patch = asked.window.on(16)
    assert np.array_equal(colatitudes(16)[rows], colatitudes(16)[patch.rows])
    ends = azimuths(16)[patch.columns]
    last = np.isclose(np.degrees(ends) % 360, asked.azimuth[1] % 360)
    assert np.array_equal(azimuths(16)[columns], ends[~last])


def test_a_run_is_cut_on_both_sides_of_azimuth_0(tmp_path: Path) -> None:
    whole, some = tmp_path / "whole.npz", tmp_path / "part.npz"
    eighth = ("solve", "dehydration", "--set", "te=0.1", "--set", "mirrors=xyz", "--quality", "preview")
    asked = (*eighth, "--stages", "0.01", "--fields", "position", "--resolution", 8)
    document(wizen(*asked, "--out", whole, "--json"))
    document(wizen(*asked, "--region", "0:90,300:40", "--out", some, "--json"))
    full, part_ = loaded(whole), loaded(some)
    columns = [14, 15, 0, 1]
    assert np.array_equal(part_["azimuth"], full["azimuth"][columns])
    assert np.array_equal(part_["position"], full["position"][:, :4][:, :, columns])
