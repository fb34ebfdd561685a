"""The ledger: jobs as values, one SQLite file for them, its leases and its queue."""
