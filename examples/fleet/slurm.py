"""A fleet on Slurm by dask-jobqueue: workers are jobs, and come and go with the queue.

    pip install '.[fleet,dask]' dask-jobqueue      # in a checkout
    python examples/fleet/slurm.py '/data/cars/*' --out /data/out --jobs 20
    python examples/fleet/slurm.py '/data/cars/*' --out /data/out --script     # prints the job script and starts nothing
    python examples/fleet/slurm.py '/data/cars/*' --out /data/out --local      # the same with processes of this machine, to try it

/data has to be a file system that all nodes see, or a URL of a store.
"""

import argparse

from kisspoint import fleet


def cluster(asked):
    """Workers as Slurm jobs of 16 cores; on this machine with --local."""
    if asked.local:
        from distributed import LocalCluster

        return LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    from dask_jobqueue import SLURMCluster

    # A diagnosis has one thread and some tens of MB: 16 at a time in one worker process, which only waits for the commands.
    return SLURMCluster(queue=asked.queue, cores=16, processes=1, memory="8GB", walltime="04:00:00", job_extra_directives=["--job-name=kisspoint"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("campaigns", nargs="+")
    parser.add_argument("--out", required=True)
    parser.add_argument("--queue", default="short")
    parser.add_argument("--jobs", type=int, default=10)
    parser.add_argument("--script", action="store_true")
    parser.add_argument("--local", action="store_true")
    asked = parser.parse_args()
    with cluster(asked) as made:
        if asked.script:
            print(made.job_script())
            return
        from distributed import Client

        if not asked.local:
            made.adapt(maximum_jobs=asked.jobs)
        with Client(made) as client:
            found = fleet.diagnose(asked.campaigns, client, f"{asked.out}/fleet.parquet")
    print(found.page, found.progress)


if __name__ == "__main__":
    main()
