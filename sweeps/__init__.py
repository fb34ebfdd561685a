"""Batch: plans, the resumable runner, executors and the command line."""
