#!/usr/bin/env python3
"""A second reader of .dermis files, written from format/SPEC.md alone: proof that the text is complete.

    dermis.py [--prefix] [--values] FILE...

prints, for each file, its name and a line for each table of decoded numbers: name, count, and the CRC-32 of the numbers
as 32-bit little-endian words (an f32 is its bits). --values adds the words in hex; --prefix takes files that are cut
short, too. A file that is not valid gives one line on stderr, `file: place: cause`, and exit code 1.

f32 arithmetic is exact: Python computes in f64, and one + - * / or sqrt of f32 numbers that is rounded to f64 and then
to f32 is rounded as if at once. Numbers that belong together are columns: arrays of one kind.
"""

import math
import struct
import sys
import zlib
from array import array
from types import SimpleNamespace

MAGIC = b"DERMIS\r\n"
WORLD = 0
DISC, FULL = 0, 1
SQUARE_ROOT = 1
OPACITY, ALL = 1, 2  # per_level
NONE = 0xFFFF  # no parent; the rest pose
GROUP = 256
# Greatest magnitudes of values: position x, y, z, log2 scale, Y, Co, Cg, then opacity or one code of the harmonics.
DISC_LIMITS = (2e12, 2e12, 12_000, 41, 2_000, 2_000, 2_000, 2)
FULL_LIMITS = (2e12, 2e12, 2e12, 41, 2_000, 2_000, 2_000)
DISC_NUMBERS = ("x", "y", "z", "angle", "scale 0", "scale 1", "red", "green", "blue", "opacity")
FULL_NUMBERS = ("x", "y", "z", "w", "i", "j", "k", "scale 0", "scale 1", "scale 2", "red", "green", "blue", "opacity")


class Refused(Exception):
    """Place and cause."""


def need(truth, place, cause):
    if not truth:
        raise Refused(f"{place}: {cause}")


def f32(numbers):
    """A column of f32: each number rounded once."""
    return array("f", numbers)


PI, ROOT_HALF = f32((math.pi, math.sqrt(0.5)))


class Bytes:
    """Bytes of one place, taken from the front."""

    def __init__(self, data, place):
        self.data, self.place, self.at = data, place, 0

    def left(self):
        return len(self.data) - self.at

    def take(self, count):
        need(count <= self.left(), self.place, f"{count} bytes are needed where {self.left()} are left")
        self.at += count
        return self.data[self.at - count : self.at]

    def numbers(self, layout):
        """Numbers in the notation of `struct`."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def rows(self, layout, count):
        """A tuple of numbers for each of `count` records."""
        return list(struct.iter_unpack("<" + layout, self.take(struct.calcsize("<" + layout) * count)))

    def column(self, kind, count):
        """Numbers of one kind: B, H, I, b, h or f."""
        column = array(kind)
        column.frombytes(self.take(column.itemsize * count))
        if sys.byteorder == "big":
            column.byteswap()
        return column

    def varint(self, bits):
        number = 0
        for shift in range(0, bits, 7):
            (byte,) = self.take(1)
            number |= (byte & 127) << shift
            if byte < 128:
                need(number >> bits == 0, self.place, f"{number} is no u{bits}")
                return number
        raise Refused(f"{self.place}: a varint of too many bytes")

    def enum(self, name, variants):
        return self.below(self.varint(32), variants, name)

    def below(self, number, limit, what):
        need(number < limit, self.place, f"{what} {number}, of {limit}")
        return number

    def all_below(self, numbers, limit, what):
        self.below(max(numbers, default=-1), limit, what)
        return numbers

    def within(self, numbers, least, greatest, what):
        """All in a range, and so no NaN and no infinity."""
        for x in numbers:
            need(least <= x <= greatest, self.place, f"{what} {x}, not from {least:g} to {greatest:g}")
        return numbers

    def magnitudes(self, numbers, greatest, what):
        return self.within(numbers, -greatest, greatest, what)

    def text(self, count):
        try:
            return str(self.take(count), "utf-8")
        except UnicodeDecodeError:
            raise Refused(f"{self.place}: text that is not UTF-8") from None

    def names(self, count):
        return [self.text(*self.take(1)) for _ in range(count)]

    def end(self):
        need(self.left() == 0, self.place, f"{self.left()} bytes too many")


# Sections 2 to 4: preamble, header, sections.


def read_header(b):
    h = SimpleNamespace()
    h.vertices, h.triangles = b.varint(32), b.varint(32)
    h.joints, h.binds, h.morph_targets, h.clips = (b.varint(16) for _ in range(4))
    h.regions, h.layers = b.take(2)
    h.gaussians = b.varint(32)
    h.frame, h.record = b.enum("frame", 4), b.enum("record", 2)
    h.low_pass, h.scale_law = b.enum("low-pass", 3), b.enum("scale law", 2)
    (h.harmonics_degree,) = b.take(1)
    h.per_level = b.enum("per level", 3)
    floats = b.magnitudes(b.column("f", 12), 1e12, "number")
    h.box_min, h.box_max, h.position_min, h.position_step = (floats[i : i + 3] for i in (0, 3, 6, 9))
    b.end()
    need(h.joints <= 65_534, b.place, f"{h.joints} joints")
    need(h.joints or not h.binds, b.place, "binds without joints")
    need(1 <= h.regions <= 32, b.place, f"{h.regions} regions")
    need(1 <= h.layers <= 16, b.place, f"{h.layers} layers")
    need((h.frame == WORLD) == (h.triangles == 0), b.place, "World frames are those of no triangles")
    bare = h.vertices == 0 and h.binds == 0 and h.record == FULL
    need(h.frame != WORLD or bare, b.place, "World frames have no vertices, binds or discs")
    need(h.harmonics_degree <= (3 if h.record == FULL else 0), b.place, f"harmonics of degree {h.harmonics_degree}")
    levels = h.record == DISC and h.scale_law == SQUARE_ROOT
    need(h.per_level != ALL or levels, b.place, "all per level needs discs and SquareRoot")
    return h


def read_sections(b):
    """Tag and payload of each section."""
    while b.left():
        b.place = f"section at byte {b.at}"
        head = b.take(12)
        tag, size, crc = struct.unpack("<4sII", head)
        payload = b.take(size)
        need(zlib.crc32(payload, zlib.crc32(head[:8])) == crc, b.place, "wrong CRC")
        yield str(tag, "latin-1"), payload


def read(data, prefix=False):
    """Everything in a file; Refused if it is not valid."""
    b = Bytes(data, "preamble")
    need(b.take(8) == MAGIC, b.place, "not a .dermis file")
    version, size, crc = b.numbers("HHI")
    need(version == 2, b.place, f"version {version} is unknown")
    header = b.take(size)
    need(zlib.crc32(header, zlib.crc32(data[:12])) == crc, b.place, "wrong CRC")
    a = SimpleNamespace(header=read_header(Bytes(header, "header")), morphs=[], clips=[], blocks=[])
    h, single, gaussians = a.header, {}, []
    for tag, payload in read_sections(b):
        if tag == "MRPH":
            a.morphs.append(read_morph(Bytes(payload, f"MRPH {len(a.morphs)}"), h))
        elif tag == "CLIP":
            a.clips.append(read_clip(Bytes(payload, f"CLIP {len(a.clips)}"), h))
        elif tag in ("BLCK", "LEVL"):
            gaussians.append((tag, payload))
        else:
            single[tag] = payload
    need(len(a.morphs) == h.morph_targets, "MRPH", f"{len(a.morphs)} of {h.morph_targets} morph targets")
    missing = len(a.clips) < h.clips and not prefix
    need(len(a.clips) <= h.clips and not missing, "CLIP", f"{len(a.clips)} of {h.clips} clips")
    for tag, needed, reader, default in tables(h):
        need(tag in single or not needed, tag, "is missing")
        table = default
        if tag in single:
            section = Bytes(single[tag], tag)
            table = reader(section)
            section.end()
        setattr(a, tag, table)
    need(sum(a.LAYR) == h.gaussians or prefix, "LAYR", f"{sum(a.LAYR)} Gaussians where the header says {h.gaussians}")
    read_gaussians(a, gaussians, prefix)
    return a


# Section 5: mesh and rig.


def tables(h):
    """Tag, whether it must be present, reader, and what stands in its place, of sections that are there once."""
    mesh, binds = h.triangles > 0, h.binds > 0
    weight_only = (1.0, 0.0, 0.0, 0.0)
    return (
        ("VERT", mesh, lambda b: read_vertices(b, h), []),
        ("TRIS", mesh, lambda b: b.all_below(vertex_column(b, h, h.triangles * 3), h.vertices, "vertex"), []),
        ("SKIN", binds, lambda b: read_skin(b, h), ([], [])),
        ("SIDE", False, lambda b: read_sides(b, h), [0] * h.triangles),
        ("TREG", False, lambda b: b.all_below(b.take(h.triangles), h.regions, "region"), [0] * h.triangles),
        ("JNTS", h.joints > 0, lambda b: read_joints(b, h), []),
        ("JNAM", False, lambda b: b.names(h.joints), []),
        ("BIND", binds, lambda b: read_binds(b, h), []),
        ("REGN", True, lambda b: b.names(h.regions), None),
        ("LAYR", True, lambda b: b.column("I", h.regions * h.layers), None),
        ("IMPO", False, lambda b: read_importance(b, h), [weight_only] * h.regions),
        ("KEYF", False, lambda b: read_key_frames(b, h), []),
    )


def vertex_column(b, h, count):
    return b.column("H" if h.vertices <= 65_536 else "I", count)


def scaled(codes, offset, step):
    """offset + code * step."""
    return f32([offset + product for product in f32([code * step for code in codes])])


def read_vertices(b, h):
    """Positions x, y, z, x, y, z, ..."""
    codes = b.column("H", h.vertices * 3)
    positions = f32([0]) * len(codes)
    for axis in range(3):
        positions[axis::3] = scaled(codes[axis::3], h.position_min[axis], h.position_step[axis])
    return positions


def read_skin(b, h):
    binds = b.column("B" if h.binds <= 256 else "H", h.vertices * 4)
    return b.all_below(binds, h.binds, "bind"), b.take(h.vertices * 4)


def read_sides(b, h):
    row = b.take((h.triangles + 7) // 8)
    return [row[t // 8] >> t % 8 & 1 for t in range(h.triangles)]


def read_joints(b, h):
    joints = b.rows("H10f", h.joints)
    for index, (parent, *numbers) in enumerate(joints):
        need(parent < index or parent == NONE, b.place, f"joint {index} has the parent {parent}")
        b.magnitudes(numbers, 1e12, "number")
    return joints


def read_binds(b, h):
    binds = b.rows("H12f", h.binds)
    for joint, *numbers in binds:
        b.below(joint, h.joints, "joint")
        b.magnitudes(numbers, 1e12, "number")
    return binds


def read_morph(b, h):
    step, weight, name = b.numbers("2fH")
    b.magnitudes((step, weight), 1e6, "number")
    name = b.text(name)
    size = 8 if h.vertices <= 65_536 else 10
    need(b.left() % size == 0, b.place, f"{b.left()} bytes of vertices, {size} each")
    count = b.left() // size
    vertices = b.all_below(vertex_column(b, h, count), h.vertices, "vertex")
    return SimpleNamespace(name=name, step=step, weight=weight, vertices=vertices, codes=b.column("h", count * 3))


def read_clip(b, h):
    seconds, count, name = b.numbers("f2H")
    b.within((seconds,), 0, 1e6, "length")
    name = b.text(name)
    channels = []
    for kind, interpolation, target, keys, offset, step in b.rows("BBHIff", count):
        b.below(kind, 4, "property")
        b.below(interpolation, 2, "interpolation")
        b.below(target, *((h.morph_targets, "morph target") if kind == 3 else (h.joints, "joint")))
        need(keys > 0, b.place, "a channel without keys")
        check_range(b, offset, step, 65_535, 1e12)
        channels.append(SimpleNamespace(
            property=kind, interpolation=interpolation, target=target, keys=keys, offset=offset, step=step))
    for channel in channels:
        codes = b.column("H", channel.keys * (3, 4, 3, 1)[channel.property])
        channel.values = scaled(codes, channel.offset, channel.step)
    b.end()
    return SimpleNamespace(name=name, seconds=seconds, channels=channels)


def read_importance(b, h):
    regions = b.rows("4f", h.regions)
    for column, greatest in zip(zip(*regions), (1e3, 1e6, 1, 1)):
        b.within(column, 0, greatest, "number")
    return regions


def read_key_frames(b, h):
    need(b.left() % 6 == 0, b.place, f"{b.left()} bytes, 6 each")
    frames = b.rows("Hf", b.left() // 6)
    for clip, seconds in frames:
        need(clip < h.clips or clip == NONE, b.place, f"clip {clip}, of {h.clips}")
        b.within((seconds,), 0, 1e6, "time")
    return frames


# Section 7: blocks.


def read_gaussians(a, sections, prefix):
    """Blocks with the records of their levels, and that they follow each other."""
    h = a.header
    layers = [a.LAYR[r * h.layers : (r + 1) * h.layers] for r in range(h.regions)]
    regions = [SimpleNamespace(drawn=0, blocks=[]) for _ in layers]
    row = []  # region and level of the LEVL sections since the last block
    levels = 0
    for tag, payload in sections:
        b = Bytes(payload, f"{tag} {len(a.blocks) if tag == 'BLCK' else levels}")
        r, layer, n, first = b.numbers("BBHI")
        b.below(r, h.regions, "region")
        b.below(layer, h.layers, "layer")
        region = regions[r]
        start = sum(layers[r][:layer])
        if tag == "BLCK":
            need(1 <= n <= 4_096, b.place, f"{n} Gaussians")
            need(first == region.drawn, b.place, f"rank {first} where {region.drawn} follows")
            need(start <= first and first + n <= start + layers[r][layer], b.place, f"leaves layer {layer}")
            starts_level = h.per_level == ALL and first == start
            wanted = [(r, layer)] * (len(region.blocks) if starts_level else 0)
            need(row == wanted, b.place, f"{len(row)} LEVL sections stand before it, not its {len(wanted)}")
            row = []
            block = read_block(b, h, r, layer, n, first)
            a.blocks.append(block)
            region.blocks.append(block)
            region.drawn += n
        else:
            need(h.per_level == ALL, b.place, "nobody asked for it")
            need(not row or row[0] == (r, layer), b.place, "stands among those of another level")
            need(region.drawn == start and layers[r][layer], b.place, f"no level {layer} begins here")
            need(len(row) < len(region.blocks), b.place, "has no block")
            block = region.blocks[len(row)]
            need((first, n) == (block.first, block.n), b.place, f"{n} Gaussians from {first} are not those of its block")
            block.levels[layer] = read_discs(b, n)
            row.append((r, layer))
            levels += 1
        b.end()
    if not prefix:
        need(not row, "LEVL", "no block follows the last")
        drawn = sum(region.drawn for region in regions)
        need(drawn == h.gaussians, "BLCK", f"{drawn} of {h.gaussians} Gaussians")


def read_block(b, h, r, layer, n, first):
    block = SimpleNamespace(region=r, layer=layer, n=n, first=first, levels={}, triangles=[], opacities=[], harmonics=[])
    # Places in the order of their 12 reversed bits.
    block.ranks = array("I", bytes(4 * n))
    for rank, place in enumerate(place for place in PLACES if place < n):
        block.ranks[place] = first + rank
    if h.frame != WORLD:
        block.triangles = b.all_below(read_triangles(b, n), h.triangles, "triangle")
    if h.record == DISC:
        block.numbers = read_discs(b, n)
    else:
        block.numbers, harmonic_steps = read_full(b, n)
    if h.per_level == OPACITY:
        block.opacities = f32([code / 255 for code in b.take(n * (h.layers - 1 - layer))])
    each = 3 * ((h.harmonics_degree + 1) ** 2 - 1)
    if each:
        codes = b.column("b", n * each)
        block.harmonics = f32([code * harmonic_steps[i // each // GROUP] for i, code in enumerate(codes)])
    return block


PLACES = [int(f"{i:012b}"[::-1], 2) for i in range(4_096)]


def read_triangles(b, n):
    """Elias and Fano's code."""
    base, width, size = b.numbers("IBH")
    need(width <= 24, b.place, f"triangles of {width} low bits")
    (low,) = bit_row(b, n, [width])
    steps = f"{int.from_bytes(b.take(size), 'little'):b}"[::-1]
    ones = [place for place, bit in enumerate(steps) if bit == "1"]
    need(len(ones) == n, b.place, f"{len(ones)} triangles of {n} Gaussians")
    triangles = [base + ((place - i) << width | bits) for i, (place, bits) in enumerate(zip(ones, low))]
    need(triangles[0] == base, b.place, "the first triangle is not the base")
    need(triangles == sorted(triangles), b.place, "triangles descend")
    need(size == ones[-1] // 8 + 1, b.place, "bytes of steps behind the last")
    return triangles


def bit_row(b, n, widths):
    """A column for each width."""
    total = sum(widths)
    row = b.take((n * total + 7) // 8)
    need(not n * total % 8 or row[-1] >> n * total % 8 == 0, b.place, "bits are set behind a row")
    records = [
        int.from_bytes(row[bit // 8 : (bit + total + 7) // 8], "little") >> bit % 8 for bit in range(0, n * total, total)
    ] if total else [0] * n
    columns, at = [], 0
    for width in widths:
        mask = (1 << width) - 1
        columns.append([record >> at & mask for record in records])
        at += width
    return columns


def check_range(b, offset, step, last_code, greatest):
    need(step >= 0, b.place, f"a range of step {step}")
    b.magnitudes((offset, *scaled((last_code,), offset, step)), greatest, "value")


def ranged(b, codes, ranges, last_code, greatest):
    """Values of a column of codes; each group has a range."""
    values = array("f")
    for g, (offset, step) in enumerate(ranges):
        check_range(b, offset, step, last_code, greatest)
        values.extend(scaled(codes[g * GROUP : (g + 1) * GROUP], offset, step))
    return values


def colours(luma, orange, green):
    """r, g, b of Y, Co, Cg."""
    rest = f32([y - cg for y, cg in zip(luma, green)])
    return (
        f32([x + co for x, co in zip(rest, orange)]),
        f32([y + cg for y, cg in zip(luma, green)]),
        f32([x - co for x, co in zip(rest, orange)]),
    )


def read_discs(b, n):
    """Columns of DISC_NUMBERS."""
    px, py, pz, angle, scale, luma, co, cg, opacity = b.all_below(b.take(9), 9, "width")
    widths = (px, py, pz, angle, scale, scale, luma, co, cg, opacity)
    bf16 = b.column("H", (n + GROUP - 1) // GROUP * 16)
    group = Bytes(b"".join(bytes((0, 0, x & 255, x >> 8)) for x in bf16), b.place).column("f", len(bf16))
    codes = bit_row(b, n, widths)
    of_range = (0, 1, 2, 3, 3, 4, 5, 6, 7)
    columns = [
        ranged(b, codes[i], list(zip(group[2 * r :: 16], group[2 * r + 1 :: 16])), (1 << widths[i]) - 1, DISC_LIMITS[r])
        for i, r in zip((0, 1, 2, 4, 5, 6, 7, 8, 9), of_range)
    ]
    x, y, root, scale_0, scale_1, *colour, opacity = columns
    z = f32([rr * r for rr, r in zip(f32([r * r for r in root]), root)])
    angle = f32([turn / (1 << widths[3]) for turn in f32([code * PI for code in codes[3]])])
    return [x, y, z, angle, scale_0, scale_1, *colours(*colour), opacity]


def read_full(b, n):
    """Columns of FULL_NUMBERS, and the step of the harmonics of each group."""
    group = b.column("f", (n + GROUP - 1) // GROUP * 15)
    ranges = [list(zip(group[2 * r :: 15], group[2 * r + 1 :: 15])) for r in range(7)]
    harmonic_steps = b.magnitudes(group[14::15], 2_000, "step of harmonics")
    x, y, z, rotation, *small = zip(*b.rows("3HI7B", n))
    position = [ranged(b, codes, ranges[i], 65_535, FULL_LIMITS[i]) for i, codes in enumerate((x, y, z))]
    scales = [ranged(b, codes, ranges[3], 255, FULL_LIMITS[3]) for codes in small[:3]]
    colour = [ranged(b, codes, ranges[4 + i], 255, FULL_LIMITS[4 + i]) for i, codes in enumerate(small[3:6])]
    opacity = f32([code / 255 for code in small[6]])
    return [*position, *rotations(rotation), *scales, *colours(*colour), opacity], harmonic_steps


def rotations(codes):
    """Smallest three: columns w, x, y, z."""
    a, b, c = (
        f32([x / 511 for x in f32([((code >> shift & 1_023) - 511) * ROOT_HALF for code in codes])])
        for shift in (20, 10, 0)
    )
    rest = [1.0] * len(codes)
    for column in (a, b, c):
        rest = f32([x - square for x, square in zip(rest, f32([y * y for y in column]))])
    greatest = f32([math.sqrt(max(x, 0.0)) for x in rest])
    quaternions = []
    for code, left_out, *others in zip(codes, greatest, a, b, c):
        others.insert(code >> 30, left_out)
        quaternions.append(others)
    return [f32(column) for column in zip(*quaternions)]


# What the command prints.


def dump(a):
    """Name and numbers of each table, in order."""
    h = a.header
    yield "header", [x for field in vars(h).values() for x in (field if isinstance(field, array) else [field])]
    yield "VERT", a.VERT
    yield "TRIS", a.TRIS
    yield "SKIN binds", a.SKIN[0]
    yield "SKIN weights", a.SKIN[1]
    yield "SIDE", a.SIDE
    yield "TREG", a.TREG
    for tag in ("JNTS", "BIND", "IMPO", "KEYF"):
        yield tag, [x for record in getattr(a, tag) for x in record]
    yield "JNAM", letters(a.JNAM)
    yield "REGN", letters(a.REGN)
    yield "LAYR", a.LAYR
    for i, morph in enumerate(a.morphs):
        yield f"MRPH {i}", [*letters([morph.name]), morph.step, morph.weight]
        yield f"MRPH {i} vertices", morph.vertices
        yield f"MRPH {i} codes", morph.codes
    for i, clip in enumerate(a.clips):
        yield f"CLIP {i}", [*letters([clip.name]), clip.seconds]
        for j, c in enumerate(clip.channels):
            yield f"CLIP {i} channel {j}", [c.property, c.interpolation, c.target, c.keys, *c.values]
    for i, block in enumerate(a.blocks):
        yield f"BLCK {i}", [block.region, block.layer, block.n, block.first]
        yield f"BLCK {i} ranks", block.ranks
        yield f"BLCK {i} triangles", block.triangles
        for name, column in zip(DISC_NUMBERS if h.record == DISC else FULL_NUMBERS, block.numbers):
            yield f"BLCK {i} {name}", column
        yield f"BLCK {i} opacities", block.opacities
        yield f"BLCK {i} harmonics", block.harmonics
        for level, columns in block.levels.items():
            for name, column in zip(DISC_NUMBERS, columns):
                yield f"BLCK {i} level {level} {name}", column


def letters(names):
    """Of each name the number of its bytes, and the bytes."""
    return [x for name in names for x in (len(name.encode()), *name.encode())]


def words(numbers):
    """Numbers as 32-bit words."""
    layout = "".join("f" if isinstance(x, float) else "i" if x < 0 else "I" for x in numbers)
    return struct.pack("<" + layout, *numbers)


def main(arguments):
    flags = {argument for argument in arguments if argument.startswith("--")}
    files = [argument for argument in arguments if argument not in flags]
    if not files or flags - {"--prefix", "--values"}:
        print("usage: dermis.py [--prefix] [--values] FILE...", file=sys.stderr)
        return 2
    code = 0
    for file in files:
        try:
            with open(file, "rb") as opened:
                avatar = read(opened.read(), "--prefix" in flags)
        except (Refused, OSError) as error:
            print(f"{file}: {error}", file=sys.stderr)
            code = 1
            continue
        print(file)
        for name, numbers in dump(avatar):
            bits = words(numbers)
            values = f" {bits.hex(' ', 4)}" if "--values" in flags else ""
            print(f"  {name}: {len(numbers)} {zlib.crc32(bits):08x}{values}")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
