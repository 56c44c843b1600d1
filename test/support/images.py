"""Images of maps, made by hand or by Pillow."""

import io
import struct
import zlib

import numpy as np
from PIL import Image

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def pgm(rows, maxval=255):
    """A binary PGM."""
    rows = np.asarray(rows)
    header = b"P5\n%d %d\n%d\n" % (rows.shape[1], rows.shape[0], maxval)
    return header + rows.astype("u1" if maxval < 256 else ">u2").tobytes()


def png(width, height, depth, colour, rows, *chunks):
    """A PNG made by hand, for what Pillow does not write: `rows` are packed bytes, one a line."""
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    return png_of([(b"IHDR", header), *chunks, (b"IDAT", body), (b"IEND", b"")])


def png_of(chunks):
    """A PNG of any chunks, (kind, data), whose checksums fit."""
    return PNG_SIGNATURE + b"".join(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
                                    for kind, data in chunks)


def chunks_of(content):
    """The (kind, data) of the chunks of a PNG."""
    chunks, at = [], len(PNG_SIGNATURE)
    while at < len(content):
        length, kind = struct.unpack_from(">I4s", content, at)
        chunks.append((kind, content[at + 8:at + 8 + length]))
        at += 12 + length
    return chunks


def saved(image, kind="PNG"):
    """The bytes of an image's file."""
    file = io.BytesIO()
    image.save(file, kind)
    return file.getvalue()


def row_of(mode, *pixels):
    """An image of one row."""
    image = Image.new(mode, (len(pixels), 1))
    image.putdata(pixels)
    return image


def palette(transparent=None):
    """Three colours, the first black, the second light, the third grey; each once."""
    image = row_of("P", 0, 1, 2)
    image.putpalette([0, 0, 0, 254, 254, 254, 205, 205, 205])
    if transparent is not None:
        image.info["transparency"] = transparent
    return image
