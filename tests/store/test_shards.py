from __future__ import annotations

import resource
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from store import shards
from store.errors import CorruptShard, StorageFull

from .conftest import answer, make, python, question


@pytest.fixture
def shard(tmp_path: Path) -> tuple[Path, xr.Dataset]:
    name, dataset = make()
    path = tmp_path / "one.h5"
    shards.write(path, dataset, name)
    return path, dataset


def test_round_trip(shard: tuple[Path, xr.Dataset]) -> None:
    path, dataset = shard
    back = shards.read(path)
    xr.testing.assert_equal(back, dataset)
    assert back.attrs["digest"] == shards.digest(dataset) == shards.digest(back)
    assert back.displacement.dtype == np.float32
    assert back.displacement.attrs == dataset.displacement.attrs
    assert list(back.component.values) == ["x", "y", "z"]


def test_is_hdf5_that_opens_everywhere(shard: tuple[Path, xr.Dataset]) -> None:
    path, dataset = shard
    assert path.read_bytes()[:4] == b"\x89HDF"
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        xr.testing.assert_equal(opened, dataset)
    with h5py.File(path) as file:
        assert file["displacement"].fletcher32
        assert file["displacement"].chunks == (1, 16, 32, 3)
        assert all(v.fletcher32 for name, v in file.items() if name in dataset.variables and name != "component")
    assert not list(path.parent.glob(".*"))


def test_digest_is_of_the_content() -> None:
    params, need = question()
    dataset = answer(params, need)
    same = shards.digest(answer(params, need, seconds=99.0).assign_attrs(host="elsewhere"))
    assert same == shards.digest(dataset) == shards.digest(dataset[sorted(dataset.data_vars, reverse=True)])
    changed = [
        dataset.assign(displacement=dataset.displacement + np.float32(1e-6)),
        dataset.assign(displacement=dataset.displacement.astype("float64")),
        dataset.assign_coords(stage=dataset.stage + 0.01),
        dataset.rename(roughness="wavelength"),
        dataset.drop_vars("residual"),
        dataset.assign_attrs(params="{}"),
        dataset.transpose("azimuth", ...),
    ]
    dataset.roughness.attrs["units"] = "m"
    changed.append(dataset)
    assert len({same, *map(shards.digest, changed)}) == 1 + len(changed)


def test_a_flipped_byte_never_passes(shard: tuple[Path, xr.Dataset], tmp_path: Path) -> None:
    path, _ = shard
    good = path.read_bytes()
    bad = tmp_path / "bad.h5"
    places = {*range(0, 512, 7), *np.linspace(0, len(good) - 1, 400).astype(int).tolist(), len(good) - 1}
    for place in places:
        data = bytearray(good)
        data[place] ^= 1 << (place % 8)
        bad.write_bytes(data)
        with pytest.raises(CorruptShard, match="sweep"):
            shards.read(bad)


@pytest.mark.parametrize("keep", [0, 3, 40, 512, 4096, -41, -1])
def test_a_cut_file_never_passes(shard: tuple[Path, xr.Dataset], keep: int) -> None:
    path, _ = shard
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(CorruptShard):
        shards.read(path)


def test_flipped_values_never_pass_without_the_seal_either(shard: tuple[Path, xr.Dataset]) -> None:
    path, _ = shard
    with h5py.File(path) as file:
        chunk = file["displacement"].id.get_chunk_info(1)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 16
    path.write_bytes(data)
    with pytest.raises(CorruptShard, match="OSError"):
        shards.read(path, verify=False)


def test_a_sealed_file_with_other_content_does_not_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name, dataset = make()
    with monkeypatch.context() as patch:
        patch.setattr(shards, "digest", lambda _: "0" * 64)
        shards.write(tmp_path / "a.h5", dataset, name)
    with pytest.raises(CorruptShard, match="does not hold"):
        shards.read(tmp_path / "a.h5")


WRITE = """
import sys
from pathlib import Path
from store import shards
from store.errors import StorageFull
from tests.store.conftest import make
name, dataset = make(resolution=32)
print("ready", flush=True)
try:
    shards.write(Path(sys.argv[1]), dataset, name)
except StorageFull as error:
    print(error.code)
else:
    print("written")
"""


def test_file_size_limit_leaves_nothing(tmp_path: Path) -> None:
    limit = 20_000

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    process = python(WRITE, tmp_path / "a.h5", preexec_fn=limited)
    assert process.communicate(timeout=120)[0].split() == ["ready", "storage-full"]
    assert not list(tmp_path.iterdir())


def test_full_disk_leaves_nothing(tmp_path: Path) -> None:
    # a real full disk, where this machine lets us mount one in a namespace of our own
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-rm", "true"], capture_output=True).returncode:
        pytest.skip("no right to mount here")
    script = f'mount -t tmpfs -o size=64k none {tmp_path} && python -c "$0" {tmp_path}/a.h5 && ls -A {tmp_path}'
    import sys

    from .conftest import ROOT

    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin:/usr/sbin:/sbin"}
    command = [unshare, "-rm", "sh", "-c", script, WRITE]
    result = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120)
    assert result.stdout.split() == ["ready", "storage-full"], result.stderr
    with pytest.raises(StorageFull, match="Free space"):
        raise StorageFull("full.", "Free space.")


def test_a_missing_library_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever is told that a file is damaged deletes it."""
    name, dataset = make()
    path = tmp_path / "one.h5"
    shards.write(path, dataset, name)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError):
        shards.read(path)
