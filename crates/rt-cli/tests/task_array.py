"""Runs a script of `--emit hq` as a task array on a HyperQueue cluster of this machine: SCRIPT SHARDS FOLDER.

The package has server and workers, but not the command `hq`, which reads the script's lines `#HQ`: what those say is
done here.
"""

import sys
from pathlib import Path

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

script, shards, folder = Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
if f"#HQ --array=1-{shards}\n" not in script.read_text():
    sys.exit(f"no array of {shards} tasks in {script}")

with LocalCluster(str(folder / "server"), WorkerConfig(cores=2)) as cluster:
    job = Job(default_workdir=folder, max_fails=1)
    # Tasks are numbered from 0 on here: HyperQueue tells each its number by HQ_TASK_ID.
    job.program(["true"])
    for shard in range(1, shards + 1):
        output = {"stdout": str(folder / f"{shard}.out"), "stderr": str(folder / f"{shard}.err")}
        job.program(["sh", str(script)], **output)
    client = cluster.client()
    client.wait_for_jobs([client.submit(job)])
