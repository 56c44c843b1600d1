"""Images of maps: every kind gives the brightness and transparency that map_server sees; damage gives a reason."""

import io
import struct
import warnings

import numpy as np
import pytest
from PIL import Image
from support.images import chunks_of, palette, pgm, png, png_of, row_of, saved

from dubins_rrt_ros.planning.maps.errors import MapError
from dubins_rrt_ros.planning.maps.images import read_image

ROW = np.array([[0, 100, 205, 254]])


def read(content, max_cells=10_000):
    """Brightness and transparency as lists."""
    grey, transparent, _ = read_image(io.BytesIO(content), max_cells)
    assert grey.dtype == np.uint8
    assert transparent is None or (transparent.dtype, transparent.shape) == (bool, grey.shape)
    return grey.tolist(), None if transparent is None else transparent.tolist()


@pytest.mark.parametrize("content", [
    pgm(ROW),
    pgm(ROW * 257, 65535),
    pgm(ROW * 4, 1020),
    b"P2 4 1 255 0 100 205 254",
    b"P2\n# made by hand\n4 # wide\n1\n# and\n255\n0 100 # half\n205\n254\n",
    b"P2 4 1 255 0 100 205 254 7 8",
    b"P2\r\n4 1\r\n255\r\n0 100\r\n205 254\r\n",
    b"P2 4 1 65535 0 25700 52685 65278",
    b"P5 4 1 255\n" + bytes([0, 100, 205, 254]) + b"more",
    b"P5\n#a\n#b\n4 1\n255\n" + bytes([0, 100, 205, 254]),
], ids=["P5", "P5-16", "P5-1020", "P2", "P2-comments", "P2-more", "P2-CRLF", "P2-16", "P5-more", "P5-comments"])
def test_pgm(content):
    assert read(content) == (ROW.tolist(), None)


@pytest.mark.parametrize("maxval", [1, 4, 100, 254, 1000, 65535])
def test_pgm_is_scaled_by_its_maxval(maxval):
    samples = np.arange(maxval + 1)[None]
    grey, *_ = read_image(io.BytesIO(pgm(samples, maxval)), 10**6)
    assert np.abs(grey - samples * 255 / maxval).max() <= 0.51
    plain = b"P2 %d 1 %d " % (maxval + 1, maxval) + b" ".join(b"%d" % i for i in range(maxval + 1))
    assert (read_image(io.BytesIO(plain), 10**6)[0] == grey).all()


def test_pgm_rows_from_the_top():
    assert read(pgm([[1, 2, 3], [4, 5, 6]]))[0] == [[1, 2, 3], [4, 5, 6]]


GREYS = [0, 254, 205]


@pytest.mark.parametrize("content, grey, transparent", [
    (saved(row_of("L", *GREYS)), GREYS, None),
    (saved(row_of("L", *GREYS), "BMP"), GREYS, None),
    (saved(row_of("1", 0, 255, 0)), [0, 255, 0], None),
    (saved(row_of("1", 0, 255, 0), "BMP"), [0, 255, 0], None),
    (saved(row_of("RGB", *((g, g, g) for g in GREYS))), GREYS, None),
    (saved(row_of("RGB", *((g, g, g) for g in GREYS)), "BMP"), GREYS, None),
    (saved(row_of("RGB", (255, 0, 0), (0, 255, 0), (0, 0, 255))), [76, 150, 29], None),
    (saved(palette()), GREYS, None),
    (saved(palette(), "BMP"), GREYS, None),
    (saved(palette(b"\xff\xfe\xff")), GREYS, [False, True, False]),
    (saved(palette(0)), GREYS, [True, False, False]),
    (saved(row_of("LA", (0, 255), (254, 255), (205, 254))), GREYS, [False, False, True]),
    (saved(row_of("RGBA", (0, 0, 0, 0), (254, 254, 254, 255), (205, 205, 205, 1))), GREYS, [True, False, True]),
], ids=["L", "L-bmp", "1", "1-bmp", "RGB", "RGB-bmp", "colours", "P", "P-bmp", "P-alpha", "P-index", "LA", "RGBA"])
def test_png_and_bmp(content, grey, transparent):
    assert read(content) == ([grey], transparent and [transparent])


@pytest.mark.parametrize("depth, row, grey", [
    (1, [0b01000000], [0, 255, 0]),
    (2, [0b00111000], [0, 255, 170]),
    (4, [0x0F, 0x80], [0, 255, 136]),
    (8, [0, 255, 128], [0, 255, 128]),
    (16, struct.pack(">3H", 0, 65535, 128 * 257 - 128), [0, 255, 128]),
])
def test_png_grey_of_every_depth_with_and_without_a_transparent_sample(depth, row, grey):
    assert read(png(3, 1, depth, 0, [row])) == ([grey], None)
    white = (b"tRNS", struct.pack(">H", 2**depth - 1))
    assert read(png(3, 1, depth, 0, [row], white)) == ([grey], [[False, True, False]])


@pytest.mark.parametrize("depth, row, grey", [(1, [0b01000000], [9, 254, 9]), (2, [0b00010000], [9, 254, 9]),
                                              (4, [0x01, 0x00], [9, 254, 9])])
def test_png_palette_of_few_bits(depth, row, grey):
    colours = (b"PLTE", bytes([9, 9, 9, 254, 254, 254]))
    assert read(png(3, 1, depth, 3, [row], colours)) == ([grey], None)
    assert read(png(3, 1, depth, 3, [row], colours, (b"tRNS", b"\x80"))) == ([grey], [[True, False, True]])


def test_png_colour_with_a_transparent_colour():
    content = png(2, 1, 8, 2, [[254, 254, 254, 9, 9, 9]], (b"tRNS", struct.pack(">3H", 9, 9, 9)))
    assert read(content) == ([[254, 9]], [[False, True]])


def test_png_of_16_bits_with_alpha_or_colour():
    assert read(png(2, 1, 16, 4, [struct.pack(">4H", 0, 65535, 65535, 300)])) == ([[0, 255]], [[False, True]])
    assert read(png(2, 1, 16, 2, [struct.pack(">6H", 0, 0, 0, 65535, 65535, 65535)])) == ([[0, 255]], None)


GOOD_PNG = png(3, 1, 8, 0, [[0, 1, 2]])


def huge_bmp(width, height, bits=24, compression=0):
    """The header of a BMP without its pixels."""
    return b"BM" + struct.pack("<IHHIIiiHHIIiiII", 54, 0, 0, 54, 40, width, height, 1, bits, compression, 0, 0, 0, 0, 0)


def compressed_bmp(width, runs):
    """Run lengths may skip 255 rows in four bytes."""
    return huge_bmp(width, 1, 8, 1) + bytes(1024) + runs


@pytest.mark.parametrize("content, word", [
    (b"", "empty"), (b"hello", "PGM"), (b"P6 1 1 255\n\0\0\0", "PGM"), (b"\xff\xd8\xff\xe0 JFIF", "PGM"),
    (b"P5", "header"), (b"P5 1 1", "header"), (b"P5 x 1 255\n\0", "header"), (b"P5 -1 1 255\n\0", "header"),
    (b"P5 9999999999 1 255\n", "header"), (b"P5#" + 70000 * b"c" + b"\n1 1 255\n\0", "header"),
    (b"P5 0 1 255\n", "width"), (b"P5 1 0 255\n", "height"),
    (b"P5 1 1 0\n\0", "maxval"), (b"P5 1 1 65536\n\0\0", "maxval"), (pgm([[5]], 4), "maxval"),
    (b"P2 1 1 255 256", "maxval"), (b"P2 1 1 255 99999999999999999999999", "maxval"),
    (b"P2 1 1 255 -1", "numbers"), (b"P2 1 1 255 1.5", "numbers"), (b"P2 2 1 255 0 x", "numbers"),
    (pgm(ROW)[:-1], "3 of 4"), (pgm(ROW * 257, 65535)[:-1], "3 of 4"), (b"P2 2 1 255 0", "1 of 2"),
    (b"P2 2 1 255\n", "0 of 2"),
    (b"\x89PNG\r\n\x1a\n", "damaged"), (GOOD_PNG[:-30], "damaged"), (png(3, 9, 8, 0, [[0, 1, 2]]), "damaged"),
    (GOOD_PNG.replace(b"IDAT", b"IDxT"), "damaged"), (png(3, 1, 7, 0, [[0, 1, 2]]), "damaged"),
    (GOOD_PNG[:-13] + b"\0" + GOOD_PNG[-12:], "checksum of its chunk IDAT"), (GOOD_PNG[:-1] + b"\0", "chunk IEND"),
    (png(3, 1, 8, 0, [[0, 1]]), "3 of 4 bytes"), (png(0, 1, 8, 0, [[]]), "width"),
    (png_of([*chunks_of(GOOD_PNG)[:1], *chunks_of(png(3, 2, 8, 0, []))[:1], *chunks_of(GOOD_PNG)[1:]]), "several headers"),
    (compressed_bmp(9, b"\0\2\0\xff" * 99), "compressed BMP"),
    (huge_bmp(1, 1)[:14] + struct.pack("<I", 2**31) + bytes(99), "header of 2147483648 bytes"),
    (b"BM", "damaged"), (b"BM" + bytes(60), "damaged"), (saved(row_of("L", 1, 2), "BMP")[:-3], "damaged"),
])
def test_bad_image(content, word):
    with pytest.raises(MapError, match=word) as caught:
        read(content)
    assert "; " in str(caught.value)


@pytest.mark.parametrize("content", [
    b"P5 30000 30000 255\n", b"P2 30000 30000 255\n", png(30000, 30000, 8, 0, []), huge_bmp(30000, -30000)],
    ids=["P5", "P2", "PNG", "BMP"])
def test_size_is_judged_by_the_header(content):
    # The pixels are not there, so a reader that wanted them would call the image truncated.
    with pytest.raises(MapError, match="30000 x 30000 = 900000000 cells, above max_map_cells = 100000000;"):
        read(content, 100_000_000)


@pytest.mark.parametrize("content", [pgm([[0, 0], [0, 0]]), png(2, 2, 8, 0, [[0, 0], [0, 0]])], ids=["PGM", "PNG"])
def test_size_limit_is_inclusive(content):
    assert read(content, 4)[0] == [[0, 0], [0, 0]]
    with pytest.raises(MapError, match="max_map_cells = 3"):
        read(content, 3)


def test_our_limit_replaces_pillows_guard(monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read(GOOD_PNG)[0] == [[0, 1, 2]]


def test_long_plain_pgm_is_refused(monkeypatch):
    with pytest.raises(MapError, match="more than 65552 bytes for 1 pixels; save it as binary PGM"):
        read(b"P2 1 1 255 " + b"0 " * 40_000)
    monkeypatch.setattr("dubins_rrt_ros.planning.maps.images.MAX_PLAIN_PGM_BYTES", 10)
    with pytest.raises(MapError, match="more than 10 bytes for 9 pixels; save it as binary PGM"):
        read(b"P2 9 1 255 1 2 3 4 5 6 7 8 9")


@pytest.mark.parametrize("chunks", [[(b"tEXt", b"")] * 90_000, [(b"IDAT", b"")] * 90_000, [(b"PLTE", bytes(2**20))] * 2],
                         ids=["others", "pixels", "palette"])
def test_chunks_that_take_far_more_than_the_pixels_are_refused(chunks):
    header, *rest = chunks_of(GOOD_PNG)
    with pytest.raises(MapError, match="chunks take far more bytes than its pixels"):
        read(png_of([header, *chunks, *rest]))


def test_a_chunk_of_no_interest_may_be_long():
    header, *rest = chunks_of(GOOD_PNG)
    assert read(png_of([header, (b"tEXt", bytes(2**22)), *rest]))[0] == [[0, 1, 2]]
