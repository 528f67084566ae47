import ray
from plans import read, run_task


def run_plan(plan):
    task_of_ray = ray.remote(run_task).options(num_cpus=1, max_retries=3, retry_exceptions=True)
    done = {}
    for task in read(plan)[1]:
        needed = [done[id] for id in task["after"]]
        done[task["id"]] = task_of_ray.remote(plan, task["id"], *needed)
    ray.get(list(done.values()))
