"""Three things to try: URLs that work with the table that is there."""

from __future__ import annotations

from pathlib import Path

from store import tables
from store.errors import StoreError
from store.store import Store

__all__ = ["hints"]


def hints(root: Path, address: str, page: Path) -> list[str]:
    """Return lines to print when a service starts at `address` (scheme, host and port) over the store at `root`, with
    the web page that is built in `page`, if it is.
    """
    try:
        store = Store.open(root)
        names = store.table_names()
        if not names:
            return ["no table yet: build one with `wizen table build --store DIR`; it is served as soon as it is there"]
        table = tables.info(store, names[0])
    except StoreError as error:
        return [str(error)]
    middle = "&".join(f"{axis}={(low + high) / 2:.4g}" for axis, (low, high) in table.axes.items())
    last = table.stages[-1]
    shape = f"{address}/v1/shapes/{table.solver}?{middle}&s={last:g}".replace("?&", "?")
    # the page of /docs is built with the other
    docs = "docs" if (page / "index.html").is_file() else "openapi.json"
    return [
        "try:",
        f"  curl '{shape}&resolution=128&format=glb' -o fruit.glb",
        f"  curl '{shape}' -H 'Accept: application/json'",
        f"  curl '{address}/v1/tables'",
        f"and {address}/{docs} explains every parameter with its unit and range",
    ]
