"""Threads of mould: where mould is and nowhere else, on feet that stay, as USD curves, GLB cards and in pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from service.sequences import EXPORTS, Options, of_run, prepared, write
from solver import registry
from solver.contract import Need
from solver.decay.hyphae import FURS
from sweeps.pictures.fur import feet, grown, ribbons
from sweeps.pictures.raster import normals

from ._gltf import parsed


def mouldy(preset: str = "tomato"):
    solver = registry.get("decay")
    need = Need(fields=(*solver.default_fields, "position"), stages=(0.0, 3.0), quality="preview", resolution=32)
    return solver.solve(solver.parse({"wounds": [{"colatitude": 20}]}, preset=preset), need)


def test_threads_stand_where_mould_is_and_their_feet_stay() -> None:
    run = mouldy()
    sequence = of_run(run)
    fresh, old = sequence
    assert len(sequence.threads(fresh, 5000).points) == 0
    assert sequence.threads(old, 0) is None
    threads = sequence.threads(old, 5000)
    assert threads is not None
    assert 50 < len(threads.points) < 5000
    roots = threads.points[:, 0]
    near = np.linalg.norm(old.vertices[:, None] - roots[None, ::7], axis=2)
    mould = old.fields["mould"]
    nearest = np.argsort(near, axis=0)[:3]
    assert (mould[nearest].max(axis=0) > 0).all()  # each foot stands beside mould
    lengths = np.linalg.norm(np.diff(threads.points, axis=1), axis=2).sum(axis=1)
    given = FURS["rhizopus"]
    assert lengths.max() < 3.5 * given.length
    assert np.array_equal(sequence.threads(old, 5000).points, threads.points)
    # where the same mould stands on a smaller fruit the same feet stand
    again = old._replace(vertices=old.vertices * np.float32(0.9))
    assert np.array_equal(sequence.threads(again, 5000).foot, threads.foot)
    assert np.allclose(sequence.threads(again, 5000).points[:, 0], 0.9 * roots, atol=1e-6)


def test_as_many_stand_as_the_density_says() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    look = registry.get("decay").looks.fur
    assert look is not None
    params = {
        "hyphae": {**FURS["penicillium-expansum"].model_dump(), "density": 900.0},
        "mould_colour": (0.2, 0.3, 0.3),
    }
    for mould, share in ((0.0, 0.0), (0.075, 0.5), (1.0, 1.0)):
        fur = look({"mould": np.full(len(points), mould)}, params)
        assert fur is not None
        threads = grown(feet(points, faces, fur.peak), points, normals(points, faces), fur)
        assert abs(len(threads.points) - 900 * share * ball.area) <= 5 * np.sqrt(900 * ball.area)
        vertices, parts, colour, _ = ribbons(threads)
        assert len(parts) == 6 * len(threads.points)
        assert len(vertices) == len(colour)
        if share == 1:
            assert np.allclose(threads.high, params["mould_colour"], atol=0.02)  # ripe: the spores' colour


def test_usd_has_curves_and_heads_and_glb_has_cards(tmp_path: Path) -> None:
    run = mouldy()
    path = tmp_path / "run.usdc"
    path.write_bytes(write(of_run(run), EXPORTS["usdc"], Options(threads=3000)))
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/decay/hyphae"))
    counts = [len(curves.GetCurveVertexCountsAttr().Get(at)) for at in (1, 13)]
    assert counts[0] == 0 < counts[1]
    assert len(curves.GetPointsAttr().Get(13)) == 4 * counts[1] == len(curves.GetWidthsAttr().Get(13))
    assert len(UsdGeom.Points(stage.GetPrimAtPath("/decay/heads")).GetPointsAttr().Get(13)) > 0
    plain = write(of_run(run), EXPORTS["usdc"], Options())
    bare = tmp_path / "bare.usdc"
    bare.write_bytes(plain)
    assert not Usd.Stage.Open(str(bare)).GetPrimAtPath("/decay/hyphae")
    document, _ = parsed(write(prepared(run, Options(), 3.0), EXPORTS["animation"], Options(threads=3000)))
    skin, cards = document["meshes"][0]["primitives"]
    assert document["materials"][cards["material"]] == {
        "name": "hyphae",
        "doubleSided": True,
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
    }
    assert skin["material"] != cards["material"]
    for name in ("hyphae", "heads"):
        prim = stage.GetPrimAtPath(f"/decay/{name}")
        bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader = UsdShade.Shader(bound.ComputeSurfaceSource()[0])
        assert shader.GetInput("roughness").Get() == 1.0
        assert shader.GetInput("diffuseColor").HasConnectedSource()
