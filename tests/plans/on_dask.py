from plans import read, run_task


def run_plan(client, plan):
    client.upload_file("plans.py")
    done = {}
    for task in read(plan)[1]:
        needed = [done[id] for id in task["after"]]
        done[task["id"]] = client.submit(run_task, plan, task["id"], *needed, pure=False, retries=3)
    client.gather(list(done.values()))
