"""The grey image of a map_server map: PGM, PNG and BMP."""

import io
import re
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from types import MappingProxyType
from typing import BinaryIO, NamedTuple

import numpy as np
from PIL import BmpImagePlugin, Image, PngImagePlugin

from .errors import MapError

#: Maximum length of a plain (P2) PGM, and of a pixel in it, beyond the header [bytes].
MAX_PLAIN_PGM_BYTES, PLAIN_PGM_BYTES_PER_PIXEL = 64 * 2**20, 16
#: Maximum length of a PGM header, with its comments [bytes].
MAX_PGM_HEADER_BYTES = 64 * 2**10
#: Size that the chunks of a PNG may have beyond twice the bytes of its pixels [bytes].
PNG_SLACK = 2**20

#: Largest difference between red, green and blue of a shade of grey.
GREY_CHROMA = 16
#: Maximum number of colours that are listed, and of pixels and of frequent colours that are looked at for them.
MAX_COLOURS, MAX_COLOURED_PIXELS, MAX_FREQUENT = 6, 1_000_000, 1000
#: Largest difference between red, green and blue of colours that are listed as one: a smooth edge has many.
SAME_COLOUR = 32

_GAP = rb"(?:\s|#[^\r\n]*[\r\n])"
_PGM_HEADER = re.compile(rb"P([25])" + 3 * (_GAP + rb"+(\d{1,9})") + _GAP)
_PNG_START = struct.Struct(">8sI4sIIBBBBB")
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
#: Chunks that define the pixels. Pillow gets no others, since it warns of some that do not matter, or fails.
_PNG_CHUNKS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
_BMP_START = struct.Struct("<14xI12xI")
#: Length of the header without a compression field, maximum length of a header [bytes], and the codes of no compression.
_BMP_SHORT_HEADER, _BMP_LONGEST_HEADER, _BMP_PLAIN = 12, 124, (0, 3)
#: First column, first row and the steps from there, for each pass of an interlaced PNG.
_PNG_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
#: Exceptions that Pillow raises for damaged files.
_PILLOW_ERRORS = (OSError, SyntaxError, ValueError, TypeError, LookupError, OverflowError, EOFError, struct.error)


class Picture(NamedTuple):
    """The pixels of an image.

    Attributes:
        grey: (height, width) uint8 brightness, the top row first.
        transparent: (height, width) bool, true where a pixel is not fully opaque; None where the image has no transparency.
        colours: the brightness of the most frequent colours that are no shades of grey, by (red, green, blue).
    """

    grey: np.ndarray
    transparent: np.ndarray | None = None
    colours: Mapping[tuple[int, int, int], int] = MappingProxyType({})


def read_image(file: BinaryIO, max_cells: int) -> Picture:
    """Return the pixels of an image.

    As for map_server, brightness has 8 bits: 16 bits are rounded, colours weighted by Rec. 601.

    Args:
        file: a PGM (P2, P5), PNG or BMP, recognised by its content; at its start.
        max_cells: maximum number of pixels, checked by the header before any are read.

    Raises:
        MapError: the image cannot be read, or is too large.
    """
    magic = file.read(8)
    file.seek(0)
    if not magic:
        raise MapError("is empty; save it again")
    if magic.startswith((b"P2", b"P5")):
        return Picture(_read_pgm(file, max_cells))
    if magic == _PNG_SIGNATURE:
        return _read_png(file, max_cells)
    if magic.startswith(b"BM"):
        return _read_bmp(file, max_cells)
    raise MapError("has not the content of a PGM (P2, P5), PNG or BMP; save or convert it as one of them, which a new name alone "
                   "does not do")


def _check_size(width: int, height: int, max_cells: int) -> None:
    if width < 1 or height < 1:
        raise MapError(f"has a width of {width} and a height of {height}; save an image with at least one pixel")
    if width * height > max_cells:
        raise MapError(f"is {width} x {height} = {width * height} cells, above max_map_cells = {max_cells}; "
                       "crop it, make its cells larger, or raise max_map_cells")


def _read_pgm(file: BinaryIO, max_cells: int) -> np.ndarray:
    # Pillow's reader of P2 is a loop in Python, and old ones differ in how they scale 16 bits.
    header = _PGM_HEADER.match(file.read(MAX_PGM_HEADER_BYTES))
    if not header:
        raise MapError("has a PGM header without width, height and maxval; save the image again")
    kind, width, height, maxval = map(int, header.groups())
    _check_size(width, height, max_cells)
    if not 0 < maxval < 2**16:
        raise MapError(f"has a PGM maxval of {maxval}; save it with one from 1 to 65535")
    file.seek(header.end())
    samples = _read_plain(file, width * height) if kind == 2 else _read_binary(file, width * height, maxval)
    if len(samples) < width * height:
        raise MapError(f"is truncated, with {len(samples)} of {width * height} pixels; copy or save it again")
    if samples.max() > maxval:
        raise MapError(f"has a pixel of {samples.max()}, above its PGM maxval of {maxval}; correct the maxval")
    grey = _to_8_bits((65535 * np.arange(maxval + 1) + maxval // 2) // maxval)
    return np.asarray(grey[samples].reshape(height, width))


def _read_binary(file: BinaryIO, count: int, maxval: int) -> np.ndarray:
    dtype = np.dtype("u1" if maxval < 256 else ">u2")
    raw = file.read(count * dtype.itemsize)
    return np.frombuffer(raw, dtype, len(raw) // dtype.itemsize)


def _read_plain(file: BinaryIO, count: int) -> np.ndarray:
    longest = min(MAX_PLAIN_PGM_BYTES, MAX_PGM_HEADER_BYTES + PLAIN_PGM_BYTES_PER_PIXEL * count)
    text = file.read(longest + 1)
    if len(text) > longest:
        raise MapError(f"is a plain PGM of more than {longest} bytes for {count} pixels; save it as binary PGM (P5) or PNG")
    text = re.sub(rb"#[^\r\n]*", b"", text)
    if not re.fullmatch(rb"[\d\s]*", text):
        raise MapError("is a plain PGM (P2) with something other than numbers among its pixels; save the image again")
    return np.fromstring(text, np.int64, sep=" ")[:count] if text.strip() else np.empty(0, np.int64)


def _to_8_bits(samples: np.ndarray) -> np.ndarray:
    """uint8 of 16 bit samples, rounded to the nearest."""
    return ((samples.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _read_png(file: BinaryIO, max_cells: int) -> Picture:
    start = file.read(_PNG_START.size)
    if len(start) < _PNG_START.size or start[12:16] != b"IHDR":
        raise _damaged("it has no header")
    width, height, depth, colour, _, _, interlaced = _PNG_START.unpack(start)[3:]
    _check_size(width, height, max_cells)
    needed = _png_bytes(width, height, depth * _PNG_CHANNELS.get(colour, 1), interlaced)
    chunks = list(_png_chunks(file, 2 * needed + PNG_SLACK))
    if sum(chunk[4:8] == b"IHDR" for chunk in chunks) > 1:
        raise _damaged("it has several headers")
    # Pillow would make missing rows black.
    found = _inflated_bytes((chunk[8:-4] for chunk in chunks if chunk[4:8] == b"IDAT"), needed)
    if found < needed:
        raise _damaged(f"it has {found} of {needed} bytes of pixels")
    clean = io.BytesIO(_PNG_SIGNATURE + b"".join(chunks))
    return _read_with_pillow(PngImagePlugin.PngImageFile, clean, max_cells, depth)


def _damaged(reason: object) -> MapError:
    return MapError(f"is damaged ({reason}); copy or save it again")


def _png_chunks(file: BinaryIO, most: int) -> Iterator[bytes]:
    """Yield the chunks about pixels, after a check of their checksums, which Pillow omits for pixels.

    They may take `most` bytes, each other chunk counted as 12.
    """
    end = file.seek(0, io.SEEK_END)
    at, kind = len(_PNG_SIGNATURE), b""
    while kind != b"IEND":
        file.seek(at)
        length, kind = struct.unpack(">I4s", file.read(8).ljust(8, b"\0"))
        at += 12 + length
        most -= 12 + (length if kind in _PNG_CHUNKS else 0)
        if at > end:
            raise _damaged("it ends within a chunk")
        if most < 0:
            raise _damaged("its chunks take far more bytes than its pixels")
        if kind not in _PNG_CHUNKS:
            continue
        data, checksum = file.read(length), file.read(4)
        if zlib.crc32(kind + data) != int.from_bytes(checksum, "big"):
            raise _damaged(f"the checksum of its chunk {kind.decode()} does not fit")
        yield struct.pack(">I4s", length, kind) + data + checksum


def _png_bytes(width: int, height: int, bits: int, interlaced: int) -> int:
    """Return the number of bytes of all rows: in each pass a row has a byte for its filter, then its pixels of `bits`."""
    total = 0
    for x, y, dx, dy in _PNG_PASSES if interlaced else ((0, 0, 1, 1),):
        columns, rows = -((x - width) // dx), -((y - height) // dy)
        if columns > 0 and rows > 0:
            total += rows * (1 + (columns * bits + 7) // 8)
    return total


def _inflated_bytes(parts: Iterable[bytes], enough: int) -> int:
    """Return the number of bytes that a compressed stream inflates to, counted up to `enough`, in small pieces."""
    inflate = zlib.decompressobj()
    count = 0
    try:
        for part in parts:
            while part and count < enough:
                count += len(inflate.decompress(part, 2**20))
                part = inflate.unconsumed_tail
        # Not flush() where there is enough: it would inflate all that is left, at once.
        return count if count >= enough else count + len(inflate.flush())
    except zlib.error as error:
        raise _damaged(error) from None


def _read_bmp(file: BinaryIO, max_cells: int) -> Picture:
    header, compression = _BMP_START.unpack(file.read(_BMP_START.size).ljust(_BMP_START.size, b"\0"))
    file.seek(0)
    if header > _BMP_LONGEST_HEADER:
        raise _damaged(f"it has a header of {header} bytes")
    # Pillow decompresses in a loop in Python, and old ones without a limit.
    if header > _BMP_SHORT_HEADER and compression not in _BMP_PLAIN:
        raise MapError("is a compressed BMP; save it without compression, or as PNG")
    return _read_with_pillow(BmpImagePlugin.BmpImageFile, file, max_cells, 8)


def _read_with_pillow(reader: Callable[[BinaryIO], Image.Image], file: BinaryIO, max_cells: int,
                      depth: int) -> Picture:
    # Not Image.open: its guard against huge images warns or raises by a limit that is global. Here it is `max_cells`.
    try:
        image = reader(file)
        _check_size(*image.size, max_cells)
        image.load()
        return _picture(image, depth)
    except MapError:
        raise
    except _PILLOW_ERRORS as error:
        raise _damaged(error) from None


def _picture(image: Image.Image, depth: int) -> Picture:
    transparent = image.info.get("transparency")
    if image.mode.startswith("I"):
        samples = np.asarray(image)
        return Picture(_to_8_bits(samples), None if transparent is None else samples == transparent)
    if image.mode in ("1", "L"):
        grey = np.asarray(image.convert("L"))
        # Pillow scales the samples to 8 bits, but the transparent one not, or not in every version.
        return Picture(grey, None if transparent is None else grey == min(transparent * 255 // (2**depth - 1), 255))
    if image.mode == "P" or (transparent is not None and "A" not in image.getbands()):
        image = image.convert("RGB" if transparent is None else "RGBA")
    transparency = np.asarray(image.getchannel("A")) < 255 if "A" in image.getbands() else None
    grey = np.asarray(image.convert("L"))
    return Picture(grey, transparency, _colours(image, grey, transparency))


def _colours(image: Image.Image, grey: np.ndarray, transparent: np.ndarray | None) -> dict[tuple[int, int, int], int]:
    """Return the brightness of the most frequent colours of opaque pixels that are no shades of grey, by (red, green, blue)."""
    if "R" not in image.getbands():
        return {}
    red, green, blue = (np.asarray(image.getchannel(band)) for band in "RGB")
    coloured = np.maximum(np.maximum(red, green), blue) - np.minimum(np.minimum(red, green), blue) > GREY_CHROMA
    if transparent is not None:
        coloured &= ~transparent
    at = np.flatnonzero(coloured)
    at = at[::1 + len(at) // MAX_COLOURED_PIXELS]
    colours = np.stack([band.ravel()[at] for band in (red, green, blue, grey)], axis=1)
    found, count = np.unique(colours, axis=0, return_counts=True)
    listed: dict[tuple[int, int, int], int] = {}
    for r, g, b, brightness in found[np.argsort(-count, kind="stable")[:MAX_FREQUENT]].tolist():
        if all(max(abs(r - x), abs(g - y), abs(b - z)) > SAME_COLOUR for x, y, z in listed):
            listed[r, g, b] = brightness
    return dict(islice(listed.items(), MAX_COLOURS))
