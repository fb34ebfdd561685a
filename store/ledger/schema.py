"""The tables of the ledger's file, and how older files become as these."""

__all__ = ["SCHEMA", "UPGRADES"]

SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    key TEXT PRIMARY KEY, solver TEXT NOT NULL, version TEXT NOT NULL, params TEXT NOT NULL, need TEXT NOT NULL,
    plan TEXT NOT NULL DEFAULT '', state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0, worker TEXT,
    lease_until REAL, digest TEXT, error TEXT, seconds REAL, created REAL NOT NULL, updated REAL NOT NULL,
    progress REAL NOT NULL DEFAULT 0,
    claims INTEGER NOT NULL DEFAULT 0, clock TEXT, lease REAL, failures INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX IF NOT EXISTS jobs_state ON jobs (state, created);
-- a job may belong to several plans, of which jobs.plan is the one that asked first
CREATE TABLE IF NOT EXISTS plans (plan TEXT, key TEXT, PRIMARY KEY (plan, key)) WITHOUT ROWID;
-- what a running job says of itself
CREATE TABLE IF NOT EXISTS notes (key TEXT PRIMARY KEY, message TEXT NOT NULL) WITHOUT ROWID;
-- who asked for it over HTTP, how long it was expected to take, without secrets, and how many claims had ended by then
CREATE TABLE IF NOT EXISTS asks (
    key TEXT NOT NULL, token TEXT NOT NULL, name TEXT NOT NULL, client TEXT NOT NULL, at REAL NOT NULL,
    expected REAL NOT NULL, claims INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX IF NOT EXISTS asks_at ON asks (at);
-- live sessions: whose, what they have cost [s], and until when they are counted as open, by which clock
CREATE TABLE IF NOT EXISTS sessions (
    id TEXT PRIMARY KEY, token TEXT NOT NULL, name TEXT NOT NULL, client TEXT NOT NULL, at REAL NOT NULL,
    seconds REAL NOT NULL, clock TEXT, lease REAL
)
"""

#: What older files lack: by the version that they have, how they become the next.
UPGRADES = {
    1: "ALTER TABLE jobs ADD COLUMN claims INTEGER NOT NULL DEFAULT 0; "
    "ALTER TABLE jobs ADD COLUMN clock TEXT; ALTER TABLE jobs ADD COLUMN lease REAL",
    2: "ALTER TABLE jobs ADD COLUMN failures INTEGER NOT NULL DEFAULT 0",
    # files that were begun before anybody could ask have no such table
    3: "CREATE TABLE IF NOT EXISTS asks (key TEXT NOT NULL, token TEXT NOT NULL, name TEXT NOT NULL, "
    "client TEXT NOT NULL, at REAL NOT NULL, expected REAL NOT NULL); "
    "ALTER TABLE asks ADD COLUMN claims INTEGER NOT NULL DEFAULT 0",
}
