"""Remeshing by the rest metric: edges collapse, split and flip."""
