"""The families that come with wizen: how the runs behind them settled, and what packing them lost.

    python -m benchmarks.dehydration.families --store maps

Of each table in the package, from the runs in the store that it was made of: how many stages meet their residual, the
worst one, crossing triangles of finite elements and lattices, the least J; and of its file how far a point of a sample
was moved to even out what crossed on the lattice, bytes and loss. A table
whose runs the store does not hold keeps what is in the record of it, if it is that very file (by its digest).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks import figures
from benchmarks.figures import Sheet
from store import starter, tables
from store.manifest import TableInfo
from store.store import Store

_HEAD = (
    *("family", "version", "samples", "quality", "part solved", "stages met", "worst residual"),
    *("crossing pairs", "least J", "evened [r1]", "MB", "loss [r1]"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True, help="where the runs are")
    runs, package = Store.open(parser.parse_args().store), Store.open(starter.ROOT)
    kept = {entry["family"]: entry for entry in figures.load("dehydration-families")["runs"]}
    sheet = Sheet("dehydration-families", _HEAD, "dehydration")
    for name in package.table_names():
        info = tables.info(package, name)
        if all(runs.has(key) for key in info.keys):
            found = [_row(runs.get(key)) for key in info.keys]
        elif name in kept and _is_of(kept[name], info, tables.path_of(package, info)):
            found = kept[name]["runs"]
        else:
            raise SystemExit(f"the runs of {name} are not in the store, nor in the record: `wizen table plan {name}`")
        _add(sheet, name, info, package, found)
    sheet.keep()


def _is_of(entry: Mapping[str, Any], info: TableInfo, path: Path) -> bool:
    """Return whether an entry of the record is of that file; entries of before digests were kept tell by its bytes."""
    return entry.get("digest", info.digest) == info.digest and entry["bytes"] == path.stat().st_size


def _add(sheet: Sheet, name: str, info: TableInfo, package: Store, found: list[Mapping[str, Any]]) -> None:
    path = tables.path_of(package, info)
    with xr.open_dataset(path, engine="h5netcdf", group="/") as stored:
        loss = float(stored["spectrum"].attrs.get("max_loss", 0.0)) if "spectrum" in stored else 0.0
        evened = float(stored["lattice_evened"].max())
    met, asked = sum(row["met"] for row in found), sum(row["stages"] for row in found)
    residual, least = max(row["residual"] for row in found), min(row["least_jacobian"] for row in found)
    pairs, size = sum(row["pairs"] for row in found), path.stat().st_size / 1e6
    part = {"": "whole", "xz": "quarter", "xyz": "eighth"}[str(info.fixed.get("mirrors", ""))]
    quality = info.quality
    settled = f"{met} of {asked}", f"{residual:.1e}"
    shape = pairs, f"{least:.2f}", f"{evened:.3f}"
    sheet.add(
        (name, info.version, len(found), quality, part, *settled, *shape, f"{size:.1f}", f"{loss:.0e}"),
        family=name, digest=info.digest, version=info.version, quality=quality, part=part, runs=found,
        bytes=path.stat().st_size, loss=loss, evened=evened,
    )  # fmt: skip


def _row(run: xr.Dataset) -> Mapping[str, Any]:
    return {
        "params": run.attrs["params"],
        "version": str(run.attrs["solver_version"]),
        "stages": run.sizes["stage"],
        "met": int(run["converged"].sum()),
        "residual": float(run["residual"].max()),
        "pairs": int(run["crossings"].sum() + run["lattice_crossings"].sum()),
        "least_jacobian": float(np.min(run["least_jacobian"])),
    }


if __name__ == "__main__":
    main()
