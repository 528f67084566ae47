"""Plans for engines: the tasks in a plan, and a function that runs one."""

import json
import subprocess


def read(plan):
    """The first line of a plan, and its tasks, each after the tasks that it needs."""
    with open(plan) as lines:
        head, *tasks = map(json.loads, lines)
    return head, tasks


def run_task(plan, id, *needed):
    """Runs a task. `needed` makes an engine wait for the results of other tasks."""
    subprocess.run(["antumbra", "run", "-q", plan, "--task", id, "--threads", "1"], check=True)
    return id
