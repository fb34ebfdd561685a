"""How the explicit kernel is compiled: back ends, the cache, the generated module."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import solver.dehydration.kernel as package
from solver.dehydration.kernel import march as march_module_function  # the function; its module is reached below
from solver.dehydration.kernel.generate import source

BACKENDS = ("vector", "scalar")
march_module = sys.modules[march_module_function.__module__]

PROBE = """
import numpy as np
from solver.dehydration.kernel import build_layout, internal_force, new_state, place, positions
from solver.dehydration.kernel.march import compiled
cube = np.array([[a >> 2 & 1, a >> 1 & 1, a & 1] for a in range(8)], dtype=float)
layout = build_layout(cube, [range(8)], [False], [1.0], [30.0], np.zeros(8, bool))
state, _ = new_state(layout)
place(state, positions(state) * 1.1)
print(internal_force(layout, state, 1.0, backend="vector").norm, sum(compiled("vector").stats.cache_hits.values()))
"""


def test_back_end_is_chosen_by_environment_and_falls_back(monkeypatch, caplog):
    choose = march_module.default_backend.__wrapped__

    def broken(backend):
        raise RuntimeError("no vectors here")

    monkeypatch.setattr(march_module, "compiled", broken)
    for name in BACKENDS:
        monkeypatch.setenv("WIZEN_KERNEL", name)
        assert choose() == name
    monkeypatch.setenv("WIZEN_KERNEL", "auto")
    assert choose() == "scalar"
    assert "no vectors here" in caplog.text
    monkeypatch.setenv("WIZEN_KERNEL", "gpu")
    with pytest.raises(ValueError, match="WIZEN_KERNEL"):
        choose()


@pytest.mark.slow  # it compiles the kernel twice from nothing
def test_cache_is_used_across_processes_and_never_stale(tmp_path):
    """numba keys its cache by the file of the function; ours by every source the function is made of."""
    kernel = tmp_path / "solver" / "dehydration" / "kernel"
    shutil.copytree(Path(package.__file__).parent, kernel, ignore=shutil.ignore_patterns("__pycache__"))
    contact = Path(package.__file__).parent.parent / "contact"
    shutil.copytree(contact, kernel.parent / "contact", ignore=shutil.ignore_patterns("__pycache__"))
    for module in ("arrays.py", "fem.py"):
        shutil.copy(Path(package.__file__).parents[2] / module, kernel.parent.parent)
    for parent in (kernel.parent, kernel.parent.parent):
        (parent / "__init__.py").touch()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def probe():
        run = subprocess.run(
            [sys.executable, "-c", PROBE], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        norm, hits = run.stdout.split()
        return float(norm), int(hits)

    first, hits = probe()
    assert hits == 0
    assert probe() == (first, 1)
    source = kernel / "elements.py"
    text = source.read_text()
    source.write_text(
        text.replace("pressure = plane(KAPPA) * (ratio - 1.0)", "pressure = 2.0 * plane(KAPPA) * (ratio - 1.0)")
    )
    changed, hits = probe()
    assert hits == 0
    assert changed == pytest.approx(2 * first, rel=1e-5)
    source.write_text(text)
    assert probe() == (first, 1)


def test_generated_module_finds_a_writable_directory(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setattr(source, "cache_directories", lambda: iter([blocked / "sub", tmp_path / "good"]))
    path = source.generated_path()
    assert path.parent == tmp_path / "good"
    assert path.read_text() == source.module_source()
    assert list(path.parent.iterdir()) == [path]
    monkeypatch.setattr(source, "cache_directories", lambda: iter([blocked / "sub"]))
    with pytest.raises(OSError, match="NUMBA_CACHE_DIR"):
        source.generated_path()


RUN = """
import hashlib
from solver import registry
from solver.contract import Context, Need
solver = registry.get("dehydration")
params = solver.parse({"te": 0.04, "gamma": 30.0, "mirrors": "xyz"})
need = Need(stages=(0.2, 0.3), quality="preview", fields=("mesh_position",))
found = solver.solve(params, need, Context())
print(hashlib.sha256(found["mesh_position"].values.tobytes()).hexdigest())
"""


@pytest.mark.slow  # it compiles all kernels from nothing
def test_a_run_has_the_same_bytes_compiled_or_loaded(tmp_path):
    """Folds touch in it, so contact is part of it; numba keeps other code of some parallel loops than it ran first."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled, loaded = (
        subprocess.run([sys.executable, "-c", RUN], env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    )
    assert compiled
    assert compiled == loaded
