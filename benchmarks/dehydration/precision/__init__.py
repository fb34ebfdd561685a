"""Parts of `benchmarks.dehydration`: error over CPU time, one file per part."""
