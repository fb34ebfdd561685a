"""The element algebra, compiled: as vector code of LLVM, or as plain source text for numba."""
