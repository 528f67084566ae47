"""Writes small GeoTIFFs with the creation options of GDAL, and beside them what rasterio reads: python make.py (needs rasterio).

Each line of expected.txt is the name of a file, its columns, rows and transform (in the order of GDAL), and its cells from the north
west, `-` without data. A line with `!` says what is refused, and a word that the message must have.
"""

import os
import warnings

import numpy as np
import rasterio
import rasterio.shutil
from rasterio.transform import Affine, from_origin
from rasterio.windows import Window

warnings.simplefilter("ignore")
os.chdir(os.path.dirname(os.path.abspath(__file__)))
HOLE = -9999.0
NORTH = from_origin(678100, 5404500, 2, 2)
rows, columns = np.mgrid[0:9, 0:11]
TERRAIN = np.where((rows == 4) & (columns > 6), HOLE, 100 + 3 * rows - columns + (rows * columns % 4) / 4.0)
PLAIN = np.abs(np.round(TERRAIN)).clip(0, 200)
lines = []


def write(name, z=TERRAIN, kind="float32", nodata=HOLE, transform=NORTH, mask=None, windows=None, refused=None, notes=None, unit=None, factor=1.0, **options):
    path = f"{name}.tif"
    height, width = z.shape
    crs = options.pop("crs", "EPSG:25832")
    with rasterio.open(
        path, "w", driver="GTiff", width=width, height=height, count=1, dtype=kind, crs=crs, transform=transform, nodata=nodata, **options
    ) as file:
        for window in windows or [Window(0, 0, width, height)]:
            part = z[window.row_off : window.row_off + window.height, window.col_off : window.col_off + window.width]
            file.write(part.astype(kind), 1, window=window)
        if mask is not None:
            file.write_mask(mask)
        if notes is not None:
            file.scales, file.offsets = notes
        if unit is not None:
            file.units = (unit,)
    expect(path, refused, factor)


def expect(path, refused=None, factor=1.0):
    if refused is not None:
        lines.append(f"{path} ! {refused}")
        return
    with rasterio.open(path) as file:
        band = file.read(1, masked=True)
        cells = np.where(np.ma.getmaskarray(band), np.nan, np.ma.getdata(band).astype(np.float64))
        cells = cells * (file.scales[0] * factor) + file.offsets[0] * factor
        c, a, b, f, d, e = file.transform.to_gdal()
        if b == d == 0 and e > 0:
            cells, f, e = cells[::-1], f + e * file.height, -e
        if b == d == 0 and a < 0:
            cells, c, a = cells[:, ::-1], c + a * file.width, -a
        place = [file.width, file.height, c, a, b, f, d, e]
    text = ["-" if np.isnan(x) else f"{x!r}".replace("np.float64(", "").rstrip(")").removesuffix(".0") for x in cells.ravel()]
    lines.append(" ".join([path, *(f"{x:.17g}" for x in place), *text]))


# Compression, order of bytes and cells.
write("plain")
write("deflate", compress="deflate", predictor=3)
write("deflate2", compress="deflate", predictor=2)
write("double", kind="float64", compress="deflate", predictor=3)
write("lzw", kind="int16", compress="lzw", predictor=2)
write("lzw_tiles", compress="lzw", tiled=True, blockxsize=16, blockysize=16, predictor=3)
write("packbits", compress="packbits")
write("zstd", compress="zstd")
write("zstd_tiles", kind="int32", compress="zstd", predictor=2, tiled=True, blockxsize=16, blockysize=16)
write("strips", blockysize=2)
write("tiles", kind="int16", tiled=True, blockxsize=16, blockysize=16)
write("bigtiff", kind="int16", BIGTIFF="YES")
write("big_endian", ENDIANNESS="BIG", compress="deflate", predictor=3)
write("big_endian2", kind="int32", ENDIANNESS="BIG", compress="lzw", predictor=2)
# Kinds of numbers.
for kind in ("uint8", "uint16", "uint32", "uint64", "int64"):
    write(kind, PLAIN, kind, None)
write("int8", PLAIN - 90, "int8", -10)
write("half", NBITS=16, nodata=None, z=PLAIN)
write("bits12", PLAIN, "uint16", None, NBITS=12)
write("bits1", rows + columns > 8, "uint8", None, NBITS=1)
write("scaled", np.where(TERRAIN == HOLE, HOLE, np.round(10 * TERRAIN)), "int16", notes=((0.1,), (100.0,)))
# White is zero.
write("white8", PLAIN, "uint8", None, photometric="MINISWHITE")
write("white16", PLAIN, "uint16", 101, photometric="MINISWHITE", compress="deflate")
write("white_float", photometric="MINISWHITE")
write("white_short", kind="int16", photometric="MINISWHITE", tiled=True, blockxsize=16, blockysize=16)
# Strips and tiles that were never written.
wide = np.add.outer(np.arange(20), np.arange(40)) / 4.0
corner = [Window(16, 0, 16, 16)]
tiles = {"tiled": True, "blockxsize": 16, "blockysize": 16, "SPARSE_OK": "TRUE"}
write("sparse", wide, windows=corner, **tiles)
write("sparse_deflate", wide, windows=corner, compress="deflate", **tiles)
write("sparse_zero", wide, nodata=None, windows=corner, compress="lzw", **tiles)
write("sparse_strips", nodata=HOLE, windows=[Window(0, 2, 11, 4)], blockysize=2, SPARSE_OK="TRUE")
# Marks and masks.
inside = np.where((rows > 2) & (rows < 6) & (columns > 3) & (columns < 7), 0, 255).astype(np.uint8)
write("nan", np.where(TERRAIN == HOLE, np.nan, TERRAIN), nodata=np.nan)
write("lowest", np.where(TERRAIN == HOLE, np.finfo("f4").min, TERRAIN), nodata=float(np.finfo("f4").min))
write("near_mark", 2.0**24 + rows, "uint32", 2.0**24)
with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
    write("mask", PLAIN, nodata=None, mask=inside)
    write("mask_deflate", PLAIN, "int16", None, mask=inside, compress="deflate")
    write("mask_tiles", PLAIN, nodata=None, mask=inside, tiled=True, blockxsize=16, blockysize=16)
with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False):
    write("outer_mask", PLAIN, nodata=None, mask=inside)
# Ways to store a place.
write("south", TERRAIN[::-1], transform=Affine(2, 0, 678100, 0, 2, 5404482))
write("mirrored", TERRAIN[:, ::-1], transform=Affine(-2, 0, 678122, 0, -2, 5404500))
write("both", TERRAIN[::-1, ::-1], transform=Affine(-2, 0, 678122, 0, 2, 5404482), kind="int16")
write("turned", transform=Affine(1.8, 0.5, 678100, 0.5, -1.8, 5404500))
with rasterio.open("point.tif", "w", driver="GTiff", width=11, height=9, count=1, dtype="int16", crs="EPSG:25832", transform=NORTH) as file:
    file.update_tags(AREA_OR_POINT="Point")
    file.write(PLAIN.astype("int16"), 1)
expect("point.tif")
# Units: of a compound system, of heights in metres over feet, and places where lengths are not those on the ground.
write("feet", crs="EPSG:2263+6360", transform=from_origin(980000, 200000, 2, 2))
write("feet_metres", kind="int16", crs="EPSG:2263", unit="metre", factor=1 / (1200 / 3937), transform=from_origin(980000, 200000, 2, 2))
web = from_origin(1288000, 6130000, 2, 2)
write("mercator", crs="EPSG:3857", transform=web, refused="lengths in EPSG:3857 are 1.500 times as long as on the ground at 48.14")
write("degrees", crs="EPSG:4326", transform=from_origin(-105.3, -40, 1e-5, 1e-5), refused="gdalwarp -t_srs EPSG:32713 in.tif out.tif")
# With overviews, which are no masks, and a mask of each.
with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
    with rasterio.open("mask.tif") as file:
        rasterio.shutil.copy(file, "overviews.tif", driver="COG", overview_count=1, blocksize=128, compress="deflate")
expect("overviews.tif")
# What is refused.
write("lerc", compress="lerc", refused="LERC, which is not read; rewrite the file with gdal_translate -co COMPRESS=DEFLATE")
write("lzma", compress="lzma", refused="LZMA")
write("jpeg", PLAIN, "uint8", None, compress="jpeg", refused="JPEG")
write("complex", PLAIN, "complex64", None, refused="complex numbers")
write("palette", PLAIN, "uint8", None, photometric="PALETTE", refused="colours")
with rasterio.open("bands.tif", "w", driver="GTiff", width=3, height=3, count=2, dtype="uint8", transform=NORTH) as file:
    file.write(np.zeros((2, 3, 3), "uint8"))
expect("bands.tif", "2 bands")
text = open("plain.tif", "rb").read()
open("mark.tif", "wb").write(text.replace(b"-9999\0", b"-99,9\0"))
expect("mark.tif", "GDAL_NODATA) is `-99,9`")
open("expected.txt", "w").write("\n".join(lines) + "\n")
