"""On which file system a path lies, and whether SQLite's locks hold there."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import NetworkFileSystem

__all__ = ["filesystem", "refuse_network"]

_MOUNTS = Path("/proc/self/mountinfo")
#: File systems whose locks are another machine's or another program's affair (FUSE: fuse, fuse.sshfs, ...).
_FAR = re.compile(r"nfs\d?|cifs|smb\d?|smbfs|9p|fuse(\..*)?|afs|ceph|lustre|gpfs|beegfs|virtiofs")
_ESCAPE = re.compile(r"\\([0-7]{3})")


def filesystem(path: Path) -> tuple[str, Path] | None:
    """Return the type and the mount point of the file system that `path` is or would be on; None where nobody says."""
    try:
        lines = _MOUNTS.read_text().splitlines()
    except OSError:
        return None  # not Linux
    place = path.resolve()
    found: tuple[str, Path] | None = None
    for line in lines:
        before, _, after = line.partition(" - ")
        # proc(5): the fifth field is the mount point, spaces as \040; the first one after the dash the type
        mount = Path(_ESCAPE.sub(lambda octal: chr(int(octal[1], 8)), before.split()[4]))
        # of mounts on one point the last covers the others
        if place.is_relative_to(mount) and (found is None or len(mount.parts) >= len(found[1].parts)):
            found = after.split()[0], mount
    return found


def refuse_network(path: Path) -> None:
    """Refuse a path whose file system other machines see too.

    SQLite keeps its promises by locks and shared memory that these do not honour among hosts
    (https://sqlite.org/wal.html: "does not work over a network filesystem").

    Raises:
        NetworkFileSystem: it is NFS, CIFS, 9p, FUSE or the like.

    """
    found = filesystem(path)
    if found is not None and _FAR.fullmatch(found[0]):
        raise NetworkFileSystem(
            f"{path} lies on {found[0]}, mounted at {found[1]}, where the ledger's locks do not hold.",
            "Keep the store on a disk of the machine that runs the plan; workers elsewhere get their jobs through "
            "--scheduler.",
        )
