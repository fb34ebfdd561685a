from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from _command import document, wizen

REFERENCE = Path(__file__).parents[1] / "solver" / "core_shell_sphere.json"


def test_help_teaches_by_example() -> None:
    result = wizen("onset", "--help")
    assert result.exit_code == 0
    assert "wizen onset --preset sphere" in " ".join(result.stdout.split())


def test_json_is_one_document_with_the_exact_onset() -> None:
    case = json.loads(REFERENCE.read_text())["bifurcation"][0]
    stone, te, gamma = (case[name] for name in ("stone_radius", "exocarp_thickness", "gamma"))
    grammar = ["--set", f"stone=[{stone},{stone}]", "--set", f"te={te}", "--set", f"gamma={gamma}", "--json"]
    said = document(wizen("onset", *grammar))
    assert said["s_cr"] == pytest.approx(case["s_cr"], rel=1e-9)
    assert (said["degree"], said["wavenumber"], said["path"]) == (case["l_cr"], 0, "radial")
    assert (said["method"], said["kappa_ratio"], said["mode"]) == ("exact", None, None)
    assert said["seconds"] > 0
    assert said["ties"][0]["s_cr"] > said["s_cr"]
    softer = document(wizen("onset", *grammar, "--kappa-ratio", 1000))
    assert softer["s_cr"] == pytest.approx(case["s_cr_kappa_over_mu_1000"], rel=1e-7)


def test_both_methods() -> None:
    said = document(wizen("onset", "--preset", "sphere", "--method", "both", "--json"))
    assert said["method"] == "exact"
    assert said["linear"]["method"] == "linear"
    assert said["linear"]["s_cr"] > said["s_cr"]
    shown = wizen("onset", "--preset", "sphere", "--method", "both").stdout
    assert "0.08038" in shown
    assert "8.04%" in shown
    assert "misses that by +21.4%" in " ".join(shown.split())


def test_no_onset_is_an_answer() -> None:
    grammar = ["--set", "stone=[0.8,0.8]", "--set", "te=0.2", "--set", "gamma=1.0"]
    result = wizen("onset", *grammar, "--json")
    assert result.exit_code == 0
    said = document(result)
    assert said["s_cr"] is None
    assert said["degree"] is None
    assert "does not buckle up to s = 0.6" in said["reason"]
    assert "This fruit does not buckle" in wizen("onset", *grammar).stdout


def test_the_mode_as_numbers_and_as_a_picture(tmp_path: Path) -> None:
    out = tmp_path / "mode.npz"
    said = document(wizen("onset", "--preset", "sphere", "--mode-out", out, "--json"))
    assert said["mode"] == str(out)
    with np.load(out) as file:
        height = file["height"]
        assert height.shape == (len(file["colatitude"]), len(file["azimuth"]))
        assert 0.9 < np.abs(height).max() <= 1.0
        assert json.loads(str(file["onset"]))["degree"] == said["degree"]
    picture = tmp_path / "mode.png"
    assert "mode written to" in wizen("onset", "--preset", "sphere", "--mode-out", picture).stdout
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--method guess", "Known: exact, linear, both."),
        ("--mode-out mode.txt", "Known: .npz, .png."),
        ("--mode-out /nowhere/mode.npz", "there is no directory"),
        ("--preset spere", "did you mean 'sphere'"),
        ("--set gama=3", "did you mean 'gamma'"),
        ("--kappa-ratio 0.1", "5 to 1e6"),
        ("--quality superb", "Known: preview, default, fine."),
    ],
)
def test_what_is_refused(words: str, said: str) -> None:
    result = wizen("onset", *words.split())
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())
