"""Data at rest: keys, immutable shards, the ledger, tables and the look-up."""
