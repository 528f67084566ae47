from itertools import islice

import apache_beam as beam
from plans import read, run_task


def run_plan(plan, options=None):
    head, tasks = read(plan)
    ids = iter([task["id"] for task in tasks])
    for count in head["levels"]:
        with beam.Pipeline(options=options) as pipeline:
            level = pipeline | beam.Create(list(islice(ids, count))) | beam.Reshuffle()
            level | beam.Map(lambda id: run_task(plan, id))
