#!/usr/bin/env python3
"""A second reader of .dermis files, written from format/SPEC.md alone: it shows that the text is complete.

    dermis.py [--prefix] [--values] FILE...

prints, for each file, its name and a line for each column of decoded numbers: name, count, and the CRC-32 of the numbers
as 32-bit little-endian words (an f32 is its bits). --values adds the words in hex; --prefix takes files that are cut
short, too. A file that is not valid gives one line on stderr, `file: place: cause`, and exit code 1.

f32 arithmetic is exact: Python computes in f64, and one + - * / or square root of f32 numbers, rounded to f64 and then
to f32, is as if rounded once. So sums and products are made a column at a time, each rounded by `f32`.
"""

import math
import struct
import sys
import zlib
from array import array
from types import SimpleNamespace

WORLD, DISC, FULL, SQUARE_ROOT, OPACITY, ALL = 0, 0, 1, 1, 1, 2  # of the header's enums
NONE = 0xFFFF  # no parent; the rest pose
GROUP = 256
PLACES = [int(f"{i:012b}"[::-1], 2) for i in range(4_096)]  # of a block, in the order of rank
# Greatest magnitudes of what ranges hold: position, log2 scale, Y, Co, Cg; of discs the opacity, too.
DISC_LIMITS = (2e12, 2e12, 12_000, 41, 2_000, 2_000, 2_000, 2)
FULL_LIMITS = (2e12, 2e12, 2e12, 41, 2_000, 2_000, 2_000)


class Refused(Exception):
    """Place and cause."""


def f32(numbers):
    """A column of f32: each number rounded once."""
    return array("f", numbers)


def bf16(halves):
    """A column of f32 from the upper 16 bits of each."""
    return f32(struct.unpack(f"<{len(halves)}f", b"".join(bytes(2) + half for half in halves)))


HALF_PI, COMPONENT, PART = f32([math.pi / 2, f32([math.sqrt(0.5)])[0] / 511, 1 / 255])


class Bytes:
    """Bytes of one place, taken from the front."""

    def __init__(self, data, place):
        self.data, self.place, self.at = data, place, 0

    def need(self, truth, cause):
        if not truth:
            raise Refused(f"{self.place}: {cause}")

    def left(self):
        return len(self.data) - self.at

    def take(self, count):
        self.need(count <= self.left(), f"{count} bytes are needed where {self.left()} are left")
        self.at += count
        return self.data[self.at - count : self.at]

    def numbers(self, layout):
        """Numbers in the notation of `struct`."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def rows(self, layout, count):
        """A tuple of numbers for each of `count` records."""
        return list(struct.iter_unpack("<" + layout, self.take(struct.calcsize("<" + layout) * count)))

    def column(self, kind, count):
        """Numbers of one kind."""
        return [number for (number,) in self.rows(kind, count)]

    def varint(self, bits):
        number = 0
        for shift in range(0, bits, 7):
            (byte,) = self.take(1)
            number |= (byte & 127) << shift
            if byte < 128:
                self.need(number >> bits == 0, f"{number} is no u{bits}")
                return number
        raise Refused(f"{self.place}: a varint of too many bytes")

    def below(self, limit, what, *numbers):
        """Indices of things that exist."""
        self.need(max(numbers, default=-1) < limit, f"{what} {max(numbers, default=0)}, of {limit}")
        return numbers

    def within(self, least, greatest, *numbers):
        """Numbers in a range: not a NaN or an infinity, either."""
        for x in numbers:
            self.need(least <= x <= greatest, f"{x} is not from {least:g} to {greatest:g}")
        return numbers

    def text(self, count):
        """UTF-8: its length and its bytes."""
        text = self.take(count)
        try:
            text.decode()
        except UnicodeDecodeError:
            raise Refused(f"{self.place}: text that is not UTF-8") from None
        return [count, *text]

    def names(self, count):
        return [x for _ in range(count) for x in self.text(*self.take(1))]

    def end(self):
        self.need(self.left() == 0, f"{self.left()} bytes too many")


# Sections 2 to 4: preamble, header, sections.


def read(data, prefix=False):
    """All columns of a file by name; Refused if it is not valid."""
    b = Bytes(data, "preamble")
    b.need(b.take(8) == b"DERMIS\r\n", "not a .dermis file")
    version, size, crc = b.numbers("HHI")
    b.need(version == 3, f"version {version} is unknown")
    payload = b.take(size)
    b.need(zlib.crc32(payload, zlib.crc32(data[:12])) == crc, "wrong CRC")
    h = read_header(Bytes(payload, "header"))
    columns, tables, counts, blocks = {"header": h.all}, {}, {"MRPH": 0, "CLIP": 0, "BLCK": 0, "LEVL": 0, "SHAP": 0}, []
    for tag, payload in read_sections(b, prefix):
        place = f"{tag} {counts[tag]}" if tag in counts else tag
        section = Bytes(payload, place)
        if tag in counts:
            counts[tag] += 1
        if tag in ("MRPH", "CLIP"):
            columns[place] = (read_morph if tag == "MRPH" else read_clip)(section, h)
            section.end()
        elif tag in counts:
            blocks.append((tag, section))
        else:
            tables[tag] = section
    b.need(counts["MRPH"] == h.morph_targets, f"{counts['MRPH']} of {h.morph_targets} morph targets")
    missing = counts["CLIP"] < h.clips and not prefix
    b.need(counts["CLIP"] <= h.clips and not missing, f"{counts['CLIP']} of {h.clips} clips")
    for tag, (must, reader) in TABLES.items():
        b.need(tag in tables or not must(h), f"{tag} is missing")
        if tag in tables:
            columns[tag] = reader(tables[tag], h)
            tables[tag].end()
    columns.setdefault("SIDE", [0] * h.triangles)
    columns.setdefault("TREG", [0] * h.triangles)
    columns.setdefault("IMPO", [1.0, 0.0, 0.0, 0.0] * h.regions)
    b.need(sum(columns["LAYR"]) == h.gaussians, f"{sum(columns['LAYR'])} Gaussians in LAYR, {h.gaussians} in the header")
    drawn = read_gaussians(h, columns, blocks, prefix)
    b.need(prefix or drawn == h.gaussians, f"{drawn} of {h.gaussians} Gaussians")
    return columns


def read_header(b):
    h = SimpleNamespace()
    h.vertices, h.triangles = b.varint(32), b.varint(32)
    h.joints, h.binds, h.morph_targets, h.clips = (b.varint(16) for _ in range(4))
    h.regions, h.layers = b.take(2)
    h.gaussians = b.varint(32)
    enum = lambda variants, what: b.below(variants, what, b.varint(32))[0]
    h.frame, h.record = enum(4, "frame"), enum(2, "record")
    h.low_pass, h.scale_law = enum(3, "low-pass"), enum(2, "scale law")
    (h.degree,) = b.take(1)
    h.per_level = enum(3, "per level")
    numbers = b.within(-1e12, 1e12, *b.column("f", 12))
    b.end()
    h.all = [*vars(h).values(), *numbers]
    h.position_min, h.position_step = numbers[6:9], numbers[9:]
    h.harmonics = 3 * ((h.degree + 1) ** 2 - 1)
    h.index = "H" if h.vertices <= 65_536 else "I"
    b.need(h.joints <= 65_534 and (h.joints or not h.binds), f"{h.joints} joints, {h.binds} binds")
    b.need(1 <= h.regions <= 32 and 1 <= h.layers <= 16, f"{h.regions} regions, {h.layers} layers")
    b.need((h.frame == WORLD) == (h.triangles == 0), f"{h.triangles} triangles, frame {h.frame}")
    b.need(h.triangles or not h.vertices and not h.binds and h.record == FULL, "no triangles, but what needs them")
    b.need(h.degree <= (3 if h.record == FULL else 0), f"harmonics of degree {h.degree}")
    levels = h.record == DISC and h.scale_law == SQUARE_ROOT
    b.need(h.per_level != ALL or levels, "levels of other than discs under SquareRoot")
    return h


def read_sections(b, prefix):
    """Tag and payload of each section; a prefix may end with a part of one."""
    while b.left():
        start, b.place = b.at, f"section at byte {b.at}"
        try:
            tag, size, crc = b.numbers("4sII")
            payload = b.take(size)
        except Refused:
            if prefix:
                return
            raise
        b.need(zlib.crc32(payload, zlib.crc32(b.data[start : start + 8])) == crc, "wrong CRC")
        yield str(tag, "latin-1"), payload
    b.place = "file"


# Section 5: mesh and rig.


def scaled(codes, offset, step):
    """offset + code * step."""
    return f32([offset + product for product in f32([code * step for code in codes])])


def ranged(b, codes, offset, step, last_code, greatest):
    """Values of codes, the range being checked at its ends."""
    b.need(step >= 0, f"a range of step {step}")
    b.within(-greatest, greatest, offset, *scaled([last_code], offset, step))
    return scaled(codes, offset, step)


def read_vertices(b, h):
    codes = b.column("H", h.vertices * 3)
    axes = [scaled(codes[axis::3], h.position_min[axis], h.position_step[axis]) for axis in range(3)]
    return [x for position in zip(*axes) for x in position]


def read_skin(b, h):
    binds = b.below(h.binds, "bind", *b.column("B" if h.binds <= 256 else "H", h.vertices * 4))
    return [*binds, *b.take(h.vertices * 4)]


def read_sides(b, h):
    row = b.take((h.triangles + 7) // 8)
    return [row[t // 8] >> t % 8 & 1 for t in range(h.triangles)]


def read_mesh_levels(b, h):
    coarser = b.column("I", b.left() // 4)
    b.need(len(coarser) <= 15 and sum(coarser) < h.triangles and all(coarser), f"meshes of {coarser} triangles")
    return coarser


def read_joints(b, h):
    joints = b.rows("H10f", h.joints)
    for index, (parent, *numbers) in enumerate(joints):
        b.need(parent < index or parent == NONE, f"joint {index} has the parent {parent}")
        b.within(-1e12, 1e12, *numbers)
    return [x for joint in joints for x in joint]


def read_binds(b, h):
    binds = b.rows("H12f", h.binds)
    for joint, *numbers in binds:
        b.below(h.joints, "joint", joint)
        b.within(-1e12, 1e12, *numbers)
    return [x for bind in binds for x in bind]


def read_morph(b, h):
    step, weight, name = b.numbers("2fH")
    b.within(-1e6, 1e6, step, weight)
    name = b.text(name)
    count = b.left() // (8 if h.index == "H" else 10)
    vertices = b.below(h.vertices, "vertex", *b.column(h.index, count))
    return [*name, step, weight, *vertices, *b.column("h", count * 3)]


def read_clip(b, h):
    seconds, count, name = b.numbers("f2H")
    clip = [*b.text(name), *b.within(0, 1e6, seconds)]
    for kind, interpolation, target, keys, offset, step in b.rows("BBHIff", count):
        b.below(4, "property", kind)
        b.below(2, "interpolation", interpolation)
        b.below(*((h.morph_targets, "morph target") if kind == 3 else (h.joints, "joint")), target)
        b.need(keys > 0, "a channel without keys")
        codes = b.column("H", keys * (3, 4, 3, 1)[kind])
        clip += [kind, interpolation, target, keys, *ranged(b, codes, offset, step, 65_535, 1e12)]
    return clip


def read_importances(b, h):
    regions = b.rows("4f", h.regions)
    for column, greatest in zip(zip(*regions), (1e3, 1e6, 1, 1)):
        b.within(0, greatest, *column)
    return [x for region in regions for x in region]


def read_curves(b, h):
    density, octaves = b.numbers("fB")
    b.need(0 < density <= 1e12 and 1 <= octaves <= 8, f"{density} pixels to a metre, {octaves} octaves")
    points = bf16(b.column("2s", 2 * h.regions * octaves * (2 * h.layers + 2)))
    return [density, octaves, *b.within(0, 1e6, *points)]


def read_samples(b, h):
    samples = b.rows("I2s2s", b.left() // 8)
    triangles = [triangle for triangle, *_ in samples]
    b.below(h.triangles, "triangle", *triangles)
    b.need(all(x < y for x, y in zip(triangles, triangles[1:])), "triangles do not ascend")
    numbers = bf16([number for _, *both in samples for number in both])
    return [*triangles, *b.within(0, 999_424, *numbers)]


def read_movements(b, h):
    return b.within(0, 999_424, *bf16(b.column("2s", h.joints + h.morph_targets + h.clips)))


def read_key_frames(b, h):
    frames = b.rows("Hf", b.left() // 6)
    for clip, seconds in frames:
        b.need(clip < h.clips or clip == NONE, f"clip {clip}, of {h.clips}")
        b.within(0, 1e6, seconds)
    return [x for frame in frames for x in frame]


# Sections that are there once: when they must be, and their reader.
TABLES = {
    "VERT": (lambda h: h.triangles, read_vertices),
    "TRIS": (lambda h: h.triangles, lambda b, h: b.below(h.vertices, "vertex", *b.column(h.index, h.triangles * 3))),
    "SKIN": (lambda h: h.binds, read_skin),
    "SIDE": (lambda h: False, read_sides),
    "MLEV": (lambda h: False, read_mesh_levels),
    "TREG": (lambda h: False, lambda b, h: b.below(h.regions, "region", *b.take(h.triangles))),
    "JNTS": (lambda h: h.joints, read_joints),
    "JNAM": (lambda h: False, lambda b, h: b.names(h.joints)),
    "BIND": (lambda h: h.binds, read_binds),
    "REGN": (lambda h: True, lambda b, h: b.names(h.regions)),
    "LAYR": (lambda h: True, lambda b, h: b.column("I", h.regions * h.layers)),
    "IMPO": (lambda h: False, read_importances),
    "CURV": (lambda h: False, read_curves),
    "SAMP": (lambda h: False, read_samples),
    "MOVE": (lambda h: False, read_movements),
    "KEYF": (lambda h: False, read_key_frames),
}


# Section 7: blocks.


def read_gaussians(h, columns, sections, prefix):
    """Columns of blocks and levels; how many Gaussians there are."""
    layers = [columns["LAYR"][r * h.layers : (r + 1) * h.layers] for r in range(h.regions)]
    blocks = [[] for _ in layers]  # rank and length of each of a region
    run = []  # region, level and tag of each level's section since the last block
    for tag, b in sections:
        head = r, layer, n, first = b.numbers("BBHI")
        b.below(h.regions, "region", r)
        b.below(h.layers, "layer", layer)
        b.need(1 <= n <= 4_096, f"{n} Gaussians")
        start, drawn = sum(layers[r][:layer]), sum(n for _, n in blocks[r])
        leads = h.per_level == ALL and drawn == start and layers[r][layer] > 0
        if tag == "BLCK":
            b.need(first == drawn, f"rank {first} where {drawn} follows")
            b.need(start <= first and first + n <= start + layers[r][layer], f"it leaves layer {layer}")
            wanted = len(blocks[r]) if leads else 0
            led = len(run) == wanted and all(level[:2] == (r, layer) for level in run)
            b.need(led, f"led by {len(run)} sections of levels, not by its {wanted}")
            blocks[r].append((first, n))
            run = []
            numbers = read_block(b, h, layer, n, first)
        else:
            b.need(leads, f"no level {layer} begins here")
            of = blocks[r][len(run) : len(run) + 1]
            b.need(of == [(first, n)], f"its Gaussians are not those of the next block, {of}")
            run.append((r, layer, tag))
            b.need(run[0] == run[-1], "it stands among those of another level or kind")
            numbers = read_discs(b, n, is_shape=tag == "SHAP")
        b.end()
        columns[b.place] = head
        columns.update((f"{b.place} {name}", column) for name, column in numbers.items())
    if run and not prefix:
        raise Refused(f"{run[-1][2]}: no block follows the last")
    return sum(n for region in blocks for _, n in region)


def read_block(b, h, layer, n, first):
    ranks = {place: rank for rank, place in enumerate((place for place in PLACES if place < n), first)}
    numbers = {"rank": [ranks[place] for place in range(n)]}
    if h.frame != WORLD:
        numbers["triangle"] = read_triangles(b, h, n)
    numbers |= read_discs(b, n) if h.record == DISC else read_full(b, n)
    steps = numbers.pop("step", None)
    if h.per_level == OPACITY:
        numbers["opacities"] = f32([code * PART for code in b.take(n * (h.layers - 1 - layer))])
    if h.harmonics:
        codes = b.column("b", n * h.harmonics)
        numbers["harmonics"] = f32([code * steps[i // h.harmonics // GROUP] for i, code in enumerate(codes)])
    return numbers


def read_triangles(b, h, n):
    """Elias and Fano's code."""
    base, width, size = b.numbers("IBH")
    b.need(width <= 24, f"triangles of {width} low bits")
    (low,) = bit_row(b, n, [width])
    steps = f"{int.from_bytes(b.take(size), 'little'):b}"[::-1]
    ones = [place for place, bit in enumerate(steps) if bit == "1"]
    b.need(len(ones) == n, f"{len(ones)} triangles of {n} Gaussians")
    triangles = [base + ((place - i) << width | bits) for i, (place, bits) in enumerate(zip(ones, low))]
    b.need(triangles == sorted(triangles), "triangles descend")
    return b.below(h.triangles, "triangle", *triangles)


def bit_row(b, n, widths):
    """A column of numbers for each width."""
    total = sum(widths)
    row = b.take((n * total + 7) // 8)
    starts = (i * total for i in range(n))
    records = [int.from_bytes(row[bit // 8 : (bit + total + 7) // 8], "little") >> bit % 8 for bit in starts]
    columns, at = [], 0
    for width in widths:
        columns.append([record >> at & (1 << width) - 1 for record in records])
        at += width
    return columns


def grouped(b, codes, ranges, last_code, greatest):
    """Values of a column of codes, each group by its range: (offset, step)."""
    values = f32([])
    for group, (offset, step) in enumerate(ranges):
        values += ranged(b, codes[group * GROUP : (group + 1) * GROUP], offset, step, last_code, greatest)
    return values


def colours(luma, orange, green):
    """r, g, b of Y, Co, Cg."""
    rest = f32([y - cg for y, cg in zip(luma, green)])
    red, blue = ([x + sign * co for x, co in zip(rest, orange)] for sign in (1, -1))
    return {"red": f32(red), "green": f32([y + cg for y, cg in zip(luma, green)]), "blue": f32(blue)}


def read_discs(b, n, is_shape=False):
    widths = b.below(9, "width", *b.take(9))
    b.need(not is_shape or not any(widths[:4] + widths[5:8]), "it has bits for more than scales and opacity")
    widths = [*widths[:5], *widths[4:]]  # that of the scales holds twice
    groups = [bf16(group) for group in b.rows("2s" * 16, (n + GROUP - 1) // GROUP)]
    x, y, root, angle, s, t, luma, orange, green, opacity = codes = bit_row(b, n, widths)
    ranges = [[group[2 * i : 2 * i + 2] for group in groups] for i in range(8)]
    value = lambda number, i: grouped(b, codes[number], ranges[i], (1 << widths[number]) - 1, DISC_LIMITS[i])
    root, colour = value(2, 2), colours(value(6, 4), value(7, 5), value(8, 6))
    return {
        "x": value(0, 0),
        "y": value(1, 1),
        "z": f32([square * r for square, r in zip(f32([r * r for r in root]), root)]),
        "angle": f32([turn / (1 << widths[3]) for turn in f32([(code + 0.5) * HALF_PI for code in angle])]),
        "scale 0": value(4, 3),
        "scale 1": value(5, 3),
        **colour,
        "opacity": value(9, 7),
    }


def read_full(b, n):
    groups = b.rows("15f", (n + GROUP - 1) // GROUP)
    x, y, z, rotation, s, t, u, luma, orange, green, opacity = zip(*b.rows("3HI7B", n))
    ranges = [[group[2 * i : 2 * i + 2] for group in groups] for i in range(7)]
    value = lambda codes, i: grouped(b, codes, ranges[i], 65_535 if i < 3 else 255, FULL_LIMITS[i])
    return {
        "step": b.within(-2_000, 2_000, *(group[14] for group in groups)),
        "x": value(x, 0),
        "y": value(y, 1),
        "z": value(z, 2),
        **dict(zip(("turn w", "turn x", "turn y", "turn z"), rotations(rotation))),
        **{f"scale {i}": value(codes, 3) for i, codes in enumerate((s, t, u))},
        **colours(value(luma, 4), value(orange, 5), value(green, 6)),
        "opacity": f32([code * PART for code in opacity]),
    }


def rotations(codes):
    """Smallest three: columns w, x, y, z."""
    three = [f32([((code >> shift & 1_023) - 511) * COMPONENT for code in codes]) for shift in (20, 10, 0)]
    sums = f32([0.0] * len(codes))
    for column in three:
        sums = f32([x + square for x, square in zip(sums, f32([y * y for y in column]))])
    greatest = f32([math.sqrt(max(x, 0.0)) for x in f32([1 - x for x in sums])])
    quaternions = [list(others) for others in zip(*three)]
    for code, left_out, quaternion in zip(codes, greatest, quaternions):
        quaternion.insert(code >> 30, left_out)
    return zip(*quaternions)


# What the command prints.


def words(numbers):
    """Numbers as 32-bit words."""
    kinds = ("f" if isinstance(x, float) else "i" if x < 0 else "I" for x in numbers)
    return struct.pack("<" + "".join(kinds), *numbers)


def main(arguments):
    flags = {argument for argument in arguments if argument.startswith("--")}
    files = [argument for argument in arguments if argument not in flags]
    if not files or flags - {"--prefix", "--values"}:
        sys.exit(__doc__)
    code = 0
    for file in files:
        try:
            with open(file, "rb") as opened:
                columns = read(opened.read(), "--prefix" in flags)
        except (Refused, OSError) as error:
            print(f"{file}: {error}", file=sys.stderr)
            code = 1
            continue
        print(file)
        for name, numbers in columns.items():
            bits = words(numbers)
            print(f"  {name}: {len(numbers)} {zlib.crc32(bits):08x}", bits.hex(" ", 4) if "--values" in flags else "")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
