"""Results of made-up runs: a ball that shrinks, an orange that rots, a box that becomes a ball."""

from __future__ import annotations

import numpy as np
import trimesh
import xarray as xr
from typer.testing import CliRunner

from service.cli import app
from service.sequences import EXPORTS, Options, prepared, write
from solver import meshes, registry
from solver.fruit import directions, lattice

STAGES = (0.0, 2.0, 5.0)


def shrinking(n: int = 8, **fields: np.ndarray) -> xr.Dataset:
    ball = directions(*lattice(n))
    position = np.stack([(1 - 0.1 * k) * ball + [0.3 * k, 0, 0] for k in range(len(STAGES))])
    data = {"position": (("stage", "colatitude", "azimuth", "component"), position.astype("f4"))}
    data |= {name: (("stage", "colatitude", "azimuth"), values) for name, values in fields.items()}
    return xr.Dataset(data, {"stage": list(STAGES)}, {"solver": "decay"})


def rotting(n: int = 8) -> xr.Dataset:
    """An orange whose rot falls from pole to pole and grows by stage."""
    theta, _ = lattice(n)
    rot = np.stack([k / 2 * (1 + np.cos(theta)) / 2 for k in range(3)]).astype("f4")
    run = shrinking(n, rot=rot, mould=rot / 2, mould_active=rot / 4)
    run.attrs["params"] = registry.get("decay").parse({}, "orange").model_dump_json()
    return run


def splitting(metres: float = 0.01) -> xr.Dataset:
    """A box that becomes a ball: triangles change."""
    solids = [trimesh.creation.box(), trimesh.creation.icosphere(2), trimesh.creation.icosphere(1)]
    frames = [
        meshes.Frame(np.array(s.vertices, "f4"), np.array(s.faces), {"heat": np.array(s.vertices[:, 1], "f4")})
        for s in solids
    ]
    return xr.Dataset(meshes.changing(frames), {"stage": list(STAGES)}, {"metres_per_unit": metres, "solver": "growth"})


def wizen(*words: str) -> str:
    """What a command says that has to succeed."""
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code == 0, done.output
    return done.output


def made(run: xr.Dataset, name: str, stage: float | None = None, **options: object) -> bytes:
    chosen, asked = EXPORTS[name], Options.parse(dict(options))
    return write(prepared(run, asked, stage, chosen.single), chosen, asked)
