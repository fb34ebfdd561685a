"""Workers from a Slurm cluster for `wizen sweep --scheduler` or `WIZEN_SCHEDULER` (pip install dask-jobqueue)."""

import time

from dask_jobqueue import SLURMCluster

cluster = SLURMCluster(
    cores=1,  # one job at a time and worker: a solver's threads are set below
    processes=1,
    memory="4GB",
    walltime="04:00:00",
    queue="compute",
    job_script_prologue=["export NUMBA_NUM_THREADS=1 OMP_NUM_THREADS=1", "source /shared/wizen/bin/activate"],
    scheduler_options={"port": 8786},
)
cluster.adapt(minimum=0, maximum=200)
print(cluster.scheduler_address, flush=True)  # wizen sweep plan.toml --store DIR --scheduler tcp://...
while True:
    time.sleep(60)
