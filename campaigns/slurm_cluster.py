"""Runs a campaign on a SLURM cluster: start `python slurm_cluster.py` on a login node. Submit no job by hand.

It needs `pip install 'warpimpact[cluster]' dask-jobqueue`. Set your queue and account below. dask-jobqueue submits one
job per worker. Jobs may start late, end early or die; other jobs then take over their work. If this script itself ends
early, start it again: it continues the run (`resume`).
"""

from pathlib import Path

from dask_jobqueue import SLURMCluster

from warpimpact import Campaign, RunOptions, Store, run_to_file

CAMPAIGN = Path(__file__).with_name("slotted_plate.toml")
OUTPUT = Path("slotted_plate.nc")

if __name__ == "__main__":
    campaign = Campaign.from_toml(CAMPAIGN, count=10_000_000)
    with SLURMCluster(
        queue="gpu",
        account="your-account",
        processes=1,  # one worker per job, which takes all cores, or the GPU, of the job
        cores=1,  # tasks at a time per worker: warpimpact itself uses every core that the job gives it
        job_cpu=16,
        memory="16GB",
        walltime="02:00:00",
        job_extra_directives=["--gpus=1"],
        worker_extra_args=["--lifetime", "110m", "--lifetime-stagger", "5m"],  # ends before SLURM ends it
    ) as cluster:
        cluster.adapt(minimum_jobs=1, maximum_jobs=32)
        options = RunOptions(scheduler=cluster.scheduler_address)
        run_to_file(campaign, Store(OUTPUT, resume=True), options=options)
