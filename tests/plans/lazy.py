import json
import os

import dask
import dask.array as da
import numpy as np
import rasterio
import xarray as xr
from plans import read, run_task


def read_tile(path, done):
    with rasterio.open(path) as file:
        return file.read()


def lazy(plan):
    (head, tasks), folder = read(plan), os.path.dirname(plan)
    with open(os.path.join(folder, head["scene"])) as index:
        whole = json.loads(next(index))
    bands, (x, dx, _, y, _, dy) = len(head["bands"]), whole["transform"]
    rows, columns = head["chunks"]
    chunks = [[da.full((bands, high, wide), np.nan, "f4") for wide in columns] for high in rows]
    run, load, done = dask.delayed(run_task, pure=False), dask.delayed(read_tile), {}
    for task in tasks:
        id, output = task["id"], os.path.join(folder, head["folder"], task["output"])
        done[id] = run(plan, id, *(done[needed] for needed in task["after"]))
        if output.endswith(".tif"):
            left, top, wide, high = task["tile"]
            tile = da.from_delayed(load(output, done[id]), (bands, high, wide), "f4")
            row, column = (np.cumsum([0, *sizes]).tolist().index(at) for sizes, at in ((rows, top), (columns, left)))
            chunks[row][column] = tile
    places = {"y": y + dy * (np.arange(whole["rows"]) + 0.5), "x": x + dx * (np.arange(whole["columns"]) + 0.5)}
    return xr.DataArray(da.block(chunks), places, ("band", "y", "x"))
