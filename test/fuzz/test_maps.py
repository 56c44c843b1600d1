"""Whatever is in a map's files, there is a map or a sentence, in bounded time and memory.

Each of the 23 tests in this folder that are given something gets `--fuzz N` spoiled inputs, 50 unless told. The full run, of
138,000 in some 30 minutes:

    pytest test/fuzz --fuzz 6000 --hypothesis-seed 1 --hypothesis-show-statistics
"""

import io
import json
import zlib
from functools import partial
from pathlib import Path

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from support.bounded import Bounds, read_or_refused
from support.images import chunks_of, palette, pgm, png, png_of, row_of, saved
from support.mutations import json_of, spoiled, spoiled_documents

from dubins_rrt_ros.planning import GridMap, MapError, MapNotFound, load_map
from dubins_rrt_ros.planning.maps.images import read_image
from dubins_rrt_ros.planning.maps.locate import find_map
from dubins_rrt_ros.planning.maps.polygons import parse_geojson

MAPS = Path(__file__).parents[2] / "maps"
MAX_CELLS = 10_000
fuzz = settings.get_profile("fuzz")

PGMS = [pgm([[0, 100, 205, 254]]), pgm([[0, 65535], [300, 7]], 65535), b"P2 # c\n4 1\n255\n0 100 205 254\n"]
BMPS = [saved(image, "BMP") for image in (row_of("1", 0, 255), row_of("L", 0, 7, 254), row_of("RGB", (1, 2, 3)), palette())]
PNGS = [png(3, 1, 8, 0, [[0, 1, 2]]), png(3, 1, 16, 0, [[0] * 6], (b"tRNS", b"\0\0")), png(3, 1, 2, 0, [[0]], (b"tRNS", b"\0\1")),
        png(1, 1, 16, 2, [[0] * 6], (b"tRNS", b"\1\2\3\4\5\6")), png(2, 2, 4, 3, [[1], [1]], (b"PLTE", b"\0\0\0\xfe\xfe\xfe")),
        saved(row_of("LA", (0, 255), (9, 9))), saved(row_of("RGBA", (0, 0, 0, 0))), saved(palette(b"\0\xff\1"))]
YAML = {"image": "m.pgm", "resolution": 0.05, "origin": [0.0, -1.5, 0.1], "negate": 0, "occupied_thresh": 0.65,
        "free_thresh": 0.196, "mode": "trinary"}
YAMLS = ["".join(f"{key}: {value}\n" for key, value in YAML.items()).encode(), json.dumps(YAML).encode(),
         b"image: &i m.pgm\nresolution: 1\norigin: &o [0, 0, 0]\nnegate: 'no'\noccupied_thresh: 6e-1\nfree_thresh: 0\nx: [*o]"]
WKTS = [b"POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0), (1 1, 1 2, 2 2, 2 1, 1 1))",
        b"MULTIPOLYGON Z (((0 0 1, 4 0 1, 4 4 1, 0 0 1)), ((5 5 1, 9 5 1, 9 9 1, 5 5 1)))"]
GEOJSONS = [json.loads((MAPS / "block.geojson").read_text()),
            {"type": "Feature", "id": 7, "properties": {"role": "bounds"},
             "geometry": {"type": "MultiPolygon", "coordinates": [[[[0, 0], [4, 0], [4, 4], [0, 0]]]]}}]


def image_or_refused(content):
    found = read_or_refused(lambda: read_image(io.BytesIO(content), MAX_CELLS), MapError)
    if found is not None:
        grey, transparent, colours = found
        assert len(colours) <= 6
        assert 1 <= grey.size <= MAX_CELLS
        assert transparent is None or transparent.shape == grey.shape


@fuzz
@given(spoiled(PGMS) | st.binary(max_size=60).map(lambda rest: b"P2 " + rest) | st.binary(max_size=60))
def test_pgm(content):
    image_or_refused(content)


@fuzz
@given(spoiled(BMPS) | st.binary(max_size=90).map(lambda rest: b"BM" + rest))
def test_bmp(content):
    image_or_refused(content)


@pytest.mark.slow
@fuzz
@given(spoiled(PNGS))
def test_png_whose_checksums_tell(content):
    image_or_refused(content)


@st.composite
def pngs(draw):
    """PNGs with checksums that fit, so that the readers of the chunks see nonsense; some is in the compressed pixels."""
    chunks = chunks_of(draw(st.sampled_from(PNGS)))
    if draw(st.booleans()):
        chunks = [(kind, zlib.compress(draw(spoiled([zlib.decompress(data)]))) if kind == b"IDAT" else data)
                  for kind, data in chunks]
    for _ in range(draw(st.integers(0, 3))):
        at = draw(st.integers(0, len(chunks) - 1))
        kind, data = chunks[at]
        edit = draw(st.sampled_from(["content", "kind", "twice", "out"]))
        if edit == "content":
            chunks[at] = kind, draw(spoiled([data]))
        elif edit == "kind":
            chunks[at] = draw(st.sampled_from([b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"iCCP", b"zTXt", b"acTL"])), data
        elif edit == "twice":
            chunks.insert(draw(st.integers(0, len(chunks))), chunks[at])
        elif len(chunks) > 1:
            del chunks[at]
    return png_of(chunks)


@fuzz
@given(pngs())
def test_png_whose_checksums_fit(content):
    image_or_refused(content)


@fuzz
@given(st.integers(0, 40), st.integers(0, 40), st.sampled_from([1, 2, 3, 4, 8, 16]), st.integers(0, 6), st.binary(max_size=40),
       st.sampled_from([b"tRNS", b"PLTE", b"tEXt", b"gAMA", b"pHYs", b"IHDR"]), st.binary(max_size=30))
def test_png_of_any_header(width, height, depth, colour, row, kind, data):
    image_or_refused(png(width, height, depth, colour, [row] * max(1, height), (kind, data)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With a good image."""
    folder = tmp_path_factory.mktemp("maps")
    (folder / "m.pgm").write_bytes(PGMS[0])
    return folder


def load(path, **limits):
    return load_map(path, max_map_cells=MAX_CELLS, **limits)


@fuzz
@given(content=spoiled(YAMLS) | st.binary(max_size=80)
       | spoiled_documents([YAML]).map(lambda document: json.dumps(document).encode()))
def test_yaml(folder, content):
    (folder / "m.yaml").write_bytes(content)
    found = read_or_refused(partial(load, folder / "m.yaml"), MapError)
    assert found is None or isinstance(found, GridMap)


def polygons_or_refused(path, content):
    path.write_bytes(content)
    found = read_or_refused(partial(load, path), MapError)
    assert found is None or shapely.is_valid(found.free)


@fuzz
@given(content=json_of(GEOJSONS))
def test_geojson(folder, content):
    polygons_or_refused(folder / "m.geojson", content)


def rings(number):
    """Rings that are closed, most of them no good."""
    return st.lists(st.tuples(number, number), min_size=3, max_size=5).map(lambda ring: [*ring, ring[0]])


@fuzz
@given(polygons=st.lists(st.lists(rings(st.integers(-3, 13)) | rings(st.floats(-1e10, 1e10)), max_size=2), max_size=2))
def test_polygons_of_any_rings(folder, polygons):
    geometry = {"type": "MultiPolygon", "coordinates": polygons}
    (bounds, *posts), obstacle = GEOJSONS[0]["features"], {"type": "Feature", "geometry": geometry}
    document = {"type": "FeatureCollection", "features": [bounds, obstacle, *posts]}
    polygons_or_refused(folder / "m.geojson", json.dumps(document).encode())


@fuzz
@given(content=spoiled(WKTS) | st.binary(max_size=80))
def test_wkt(folder, content):
    polygons_or_refused(folder / "m.wkt", content)


NAMES = [b"maze", b"maps/maze.yaml", b"/srv/m.yaml", b"~/m.wkt", b"~root/m.wkt", b"file:///srv/a%20b.yaml",
         b"package://dubins_rrt_ros/maps/maze.yaml", b"http://localhost/m.yaml"]


@fuzz
@given(name=(spoiled(NAMES) | st.binary(max_size=40)).map(lambda name: name.decode("utf-8", "surrogateescape")) | st.text())
def test_name_of_a_map_outside_the_directory(folder, name):
    """What load_map's service does of a name, limited to a directory that none of the names is in."""
    assert read_or_refused(lambda: load(find_map(name), map_directory=str(folder)), MapNotFound) is None


# Bombs: small files that promise or expand to much.

def idat_bomb(width):
    """Pixels of one row, and after them 300 MB of zeros in 300 kB."""
    deflate = zlib.compressobj(9)
    start = deflate.compress(b"") + deflate.flush(zlib.Z_FULL_FLUSH)
    megabyte = deflate.compress(bytes(2**20)) + deflate.flush(zlib.Z_FULL_FLUSH)
    header = chunks_of(png(width, 1, 8, 0, []))[0]
    return png_of([header, (b"IDAT", start + 300 * megabyte), (b"IEND", b"")])


def comb(teeth, swap):
    """A polygon of thin teeth, upright or lying."""
    tooth = [(0.1, 0), (0.1, teeth), (0.6, teeth), (0.6, 0)]
    ring = [(0, -1), *((x + dx, y) for x in range(teeth) for dx, y in tooth), (teeth, -1)]
    return [[y, x] if swap else [x, y] for x, y in [*ring, ring[0]]]


def crossed_combs(teeth):
    """Two obstacles of which each tooth crosses all of the other."""
    features = [{"type": "Feature", "properties": {"role": role}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
                for role, ring in (("bounds", [[-9, -9], [2e3, -9], [2e3, 2e3], [-9, 2e3], [-9, -9]]),
                                   ("post", comb(teeth, False)), ("post", comb(teeth, True)))]
    return json.dumps({"type": "FeatureCollection", "features": features})


def aliases(levels, start, level):
    """YAML of a few lines in which each level holds the one before nine times."""
    return "\n".join([start, *(level.format(i, i - 1) for i in range(1, levels))]).encode()


LISTS = aliases(20, "a0: &a0 [x]", "a{0}: &a{0} [" + ", ".join(["*a{1}"] * 9) + "]") + b"\nimage: m.pgm\nresolution: *a19"
MAPPINGS = aliases(20, "a0: &a0 {x: y}", "a{0}: &a{0} {{<<: *a{1}, " + ", ".join(f"k{k}: *a{{1}}" for k in range(9)) + "}}")


@pytest.mark.parametrize(("name", "content"), [
    ("m.yaml", LISTS), ("m.yaml", MAPPINGS), ("m.yaml", b"- [" + LISTS.replace(b"\n", b"\n  ") + b"]"), ("m.yaml", b"[" * 60_000),
    ("m.yaml", b"- " * 30_000), ("m.yaml", b"? " * 30_000), ("m.yaml", b"{a: " * 15_000), ("m.yaml", b"&a " * 20_000),
    ("m.yaml", b"a: b\n" * 13_000), ("m.yaml", b"? a\n" * 16_000), ("m.yaml", b"!!" * 30_000), ("m.yaml", b"'" * 64_001),
    ("m.yaml", b"image: " + b"n" * 60_000), ("m.yaml", b"#" * 2**26),
    ("m.geojson", b"[" * 2**20), ("m.geojson", b'{"a":' * 2**20), ("m.geojson", b"[" + b"[]," * 2**24 + b"[]]"),
    ("m.geojson", b"[" + b"9" * 2**24 + b"]"), ("m.geojson", b" " * 2**26 + b"7"), ("m.geojson", b'"' + b"a" * 2**24 + b'"'),
    ("m.wkt", b"POLYGON " + b"(" * 2**20), ("m.wkt", b"GEOMETRYCOLLECTION (" * 2**16),
    ("m.wkt", b"POLYGON ((0 0" + b", 1 1" * 2**22 + b"))"),
    ("m.wkt", b"POLYGON ((" + b"9" * 2**20), ("m.wkt", b"POLYGON ((0 0)" + b" " * 2**22 + b") x"),
])
def test_a_file_that_expands_is_refused(folder, name, content):
    (folder / name).write_bytes(content)
    assert read_or_refused(partial(load, folder / name), MapError) is None


@pytest.mark.parametrize("teeth", [300, 2000])
def test_obstacles_that_cross_too_often_are_refused(teeth):
    text = crossed_combs(teeth)
    with Bounds(), pytest.raises(MapError, match="may cross; unite what overlaps"):
        parse_geojson(text, "combs")


def test_obstacles_that_cross_often_are_united():
    with Bounds():
        assert parse_geojson(crossed_combs(60), "combs").free.area > 0


@pytest.mark.parametrize("width", [1, 9000])
def test_pixels_that_are_too_many_are_not_inflated(width):
    content = idat_bomb(width)
    with Bounds():
        assert read_image(io.BytesIO(content), MAX_CELLS)[0].shape == (1, width)
