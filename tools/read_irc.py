#!/usr/bin/env python3
"""Reads a brume irradiance cache (docs/cache_format.md) with nothing but the standard library.

    read_irc.py FILE            the header and counts, as JSON
    read_irc.py FILE --records  each record as one line of JSON, positions in world space

It knows only what that page says, so that the page is tested by it. Every sum is
checked. Exit codes: 0 a complete file, 3 damaged, unfinished or no cache.
"""
import argparse
import json
import signal
import struct
import sys

KIND_NAMES = {1: "surface", 2: "volume"}
RECORD_KINDS = tuple(KIND_NAMES)
MASK = (1 << 64) - 1
P32_1, P32_2, P32_3 = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D
P64_1, P64_2, P64_3 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
P64_4, P64_5 = 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578"
    "825ad07dccff7221b8084674f743248ee03590e6813a264c3c2852bb91c300cb88d0658b1b532ea3"
    "71644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931"
    "c89f7ec9d9787364eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")


def u64(data, at):
    return int.from_bytes(data[at:at + 8], "little")


def rotated(x, by):
    return ((x << by) | (x >> (64 - by))) & MASK


def folded(a, b):
    product = a * b
    return (product & MASK) ^ (product >> 64)


def avalanche(h):
    h = ((h ^ (h >> 37)) * 0x165667919E3779F9) & MASK
    return h ^ (h >> 32)


def mix16(data, at, secret_at):
    return folded(u64(data, at) ^ u64(SECRET, secret_at),
                  u64(data, at + 8) ^ u64(SECRET, secret_at + 8))


def xxh3_64(data):
    """XXH3, 64 bits, seed 0, for the lengths that occur in a cache: 0 and 4 bytes or more."""
    n = len(data)
    if n == 0:
        h = u64(SECRET, 56) ^ u64(SECRET, 64)
        h = ((h ^ (h >> 33)) * P64_2) & MASK
        h = ((h ^ (h >> 29)) * P64_3) & MASK
        return h ^ (h >> 32)
    if n < 4:
        raise ValueError("no sum in a cache is over so few bytes")
    if n <= 8:
        first, last = struct.unpack_from("<I", data)[0], struct.unpack_from("<I", data, n - 4)[0]
        h = (last + (first << 32)) ^ u64(SECRET, 8) ^ u64(SECRET, 16)
        h ^= rotated(h, 49) ^ rotated(h, 24)
        h = (h * 0x9FB21C651E98DF25) & MASK
        h ^= (h >> 35) + n
        h = (h * 0x9FB21C651E98DF25) & MASK
        return h ^ (h >> 28)
    if n <= 16:
        low = u64(data, 0) ^ u64(SECRET, 24) ^ u64(SECRET, 32)
        high = u64(data, n - 8) ^ u64(SECRET, 40) ^ u64(SECRET, 48)
        swapped = int.from_bytes(low.to_bytes(8, "little"), "big")
        return avalanche((n + swapped + high + folded(low, high)) & MASK)
    if n <= 128:
        h = n * P64_1
        for i in range((n - 1) // 32 + 1):
            h += mix16(data, 16 * i, 32 * i) + mix16(data, n - 16 * (i + 1), 32 * i + 16)
        return avalanche(h & MASK)
    if n <= 240:
        h = n * P64_1
        for i in range(8):
            h += mix16(data, 16 * i, 16 * i)
        h = avalanche(h & MASK)
        for i in range(8, n // 16):
            h += mix16(data, 16 * i, 16 * (i - 8) + 3)
        return avalanche((h + mix16(data, n - 16, 136 - 17)) & MASK)

    secret = [struct.unpack_from("<8Q", SECRET, 8 * i) for i in range(17)]
    acc = [P32_3, P64_1, P64_2, P64_3, P64_4, P32_2, P64_5, P32_1]

    def accumulate(at, key):
        stripe = struct.unpack_from("<8Q", data, at)
        for i in range(8):
            mixed = stripe[i] ^ key[i]
            acc[i ^ 1] += stripe[i]
            acc[i] += (mixed & 0xFFFFFFFF) * (mixed >> 32)
        for i in range(8):
            acc[i] &= MASK

    stripes = (n - 1) // 64
    for stripe in range(stripes):
        accumulate(64 * stripe, secret[stripe % 16])
        if stripe % 16 == 15:
            for i in range(8):
                acc[i] = ((acc[i] ^ (acc[i] >> 47) ^ secret[16][i]) * P32_1) & MASK
    accumulate(n - 64, struct.unpack_from("<8Q", SECRET, 192 - 64 - 7))
    h = n * P64_1
    for i in range(4):
        h += folded(acc[2 * i] ^ u64(SECRET, 11 + 16 * i), acc[2 * i + 1] ^ u64(SECRET, 19 + 16 * i))
    return avalanche(h & MASK)


class Damaged(Exception):
    pass


def check(condition, what):
    if not condition:
        raise Damaged(what)


def text(data):
    return data.split(b"\0")[0].decode("ascii")


def read_header(data):
    check(data[:8] == b"\x89IRC\r\n\x1a\n", "not a brume cache")
    check(len(data) >= 4096, "the file ends in its header")
    major, minor, endian, header_bytes, block_records = struct.unpack_from("<HHIII", data, 8)
    check(major == 1 and endian == 0x01020304 and header_bytes == 4096, "another format version")
    check(xxh3_64(data[:4088]) == u64(data, 4088), "the header's checksum does not match")
    kinds = struct.unpack_from("<4I", data, 24)
    required, fields = struct.unpack_from("<II", data, 40)
    check(required == 0, "needs features of a newer version")
    words = struct.unpack_from("<2Q", data, 48)
    schema = []
    for i in range(fields):
        at = 128 + 40 * i
        kind, offset, count = struct.unpack_from("<HHH", data, at + 32)
        schema.append({"name": text(data[at:at + 16]), "unit": text(data[at + 16:at + 28]),
                       "type": text(data[at + 28:at + 32]), "kind": kind, "offset": offset,
                       "count": count})
    settings = data[1024:1024 + struct.unpack_from("<I", data, 88)[0]].decode("utf-8", "replace")
    shards = {"request": 0, "count": 0, "done": []}
    if minor >= 1:
        shards["request"], shards["count"] = struct.unpack_from("<QI", data, 3560)
        shards["done"] = [i for i in range(4096) if data[3576 + i // 8] >> i % 8 & 1]
        check(shards["count"] <= 4096 and all(i < shards["count"] for i in shards["done"]),
              "it names shards that cannot be")
    return {"format": [major, minor], "records_per_block": block_records, "record_bytes": list(kinds),
            "fingerprint": "%016x%016x" % words, "origin": list(struct.unpack_from("<3d", data, 64)),
            "creator": text(data[96:128]), "settings": settings, "shards": shards,
            "schema": schema}


def read_blocks(data, header):
    """Yields (block, offset of its payload), then checks what follows the last."""
    at, cumulative, previous, index, sums = 4096, 0, data[4088:4096], b"", b""
    sequence = 0
    while data[at:at + 4] == b"IRCB":
        check(at + 64 <= len(data) and xxh3_64(data[at:at + 56]) == u64(data, at + 56),
              "block %d: the checksum of its header does not match" % sequence)
        kind, layer, wave, flags, count, number, units, before, first, last = struct.unpack_from(
            "<4BIIIIQQ", data, at + 4)
        check((number, 64 * units, before) == (sequence, at, cumulative)
              and data[at + 40:at + 48] == previous, "block %d: not written here" % sequence)
        size = count * header["record_bytes"][kind - 1] if 1 <= kind <= 4 else 0
        check(size > 0 and at + 64 + size <= len(data), "block %d: bad size" % sequence)
        check(xxh3_64(data[at + 64:at + 64 + size]) == u64(data, at + 48),
              "block %d: the checksum of its records does not match" % sequence)
        yield {"kind": kind, "layer": layer, "wave": wave, "flags": flags, "count": count,
               "offset": at, "first_key": first, "last_key": last}, at + 64
        index += struct.pack("<QQQI4B", at, first, last, count, kind, layer, wave, flags)
        previous = data[at + 56:at + 64]
        sums += previous
        at += 64 + size
        cumulative += count
        sequence += 1
    check(at < len(data), "unfinished: no footer")
    end = at + len(index) + 128
    footer = struct.pack("<4sIQQQQQ", b"IRCF", sequence, cumulative, at, end, xxh3_64(sums),
                         xxh3_64(index)).ljust(120, b"\0")
    footer += struct.pack("<Q", xxh3_64(footer))
    check(data[at:] == index + footer, "damaged behind block %d" % (sequence - 1))


def records_of(data, at, block, header):
    codes = {"f32": "f", "u32": "I", "u64": "Q"}
    size = header["record_bytes"][block["kind"] - 1]
    fields = [f for f in header["schema"] if f["kind"] == block["kind"]]
    for i in range(block["count"]):
        record = {"kind": KIND_NAMES[block["kind"]], "layer": block["layer"], "wave": block["wave"]}
        for f in fields:
            values = struct.unpack_from("<%d%s" % (f["count"], codes[f["type"]]), data,
                                        at + i * size + f["offset"])
            record[f["name"]] = values[0] if f["count"] == 1 else list(values)
        record["position"] = [o + p for o, p in zip(header["origin"], record["position"])]
        yield record


def check_order(data, blocks, starts):
    """What kind 3 holds: every surface record once, layer by layer."""
    order, places, cumulative = {}, {}, 0
    for block, at in zip(blocks, starts):
        if block["kind"] == 1:
            places.setdefault(block["layer"], set()).update(range(cumulative, cumulative + block["count"]))
            cumulative += block["count"]
        elif block["kind"] == 3:
            indices = struct.unpack_from("<%dI" % (16 * block["count"]), data, at)
            order.setdefault(block["layer"], []).extend(i for i in indices if i != 0xFFFFFFFF)
    for layer, indices in order.items():
        check(len(indices) == len(set(indices)) and set(indices) == places.get(layer, set()),
              "the order of layer %d is none of its records" % layer)


def read_note(data, blocks, starts, key):
    """What kind 4 holds under key 0, how the light of deep records was solved for, or 1, checks of answers."""
    note = b"".join(data[at:at + 64 * block["count"]] for block, at in zip(blocks, starts)
                    if block["kind"] == 4 and block["first_key"] == key)
    return json.loads(note.split(b"\0")[0]) if note else None


def main():
    parser = argparse.ArgumentParser(description="Reads a brume irradiance cache.")
    parser.add_argument("file")
    parser.add_argument("--records", action="store_true", help="list records, one a line")
    options = parser.parse_args()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` is no error.
    with open(options.file, "rb") as stream:
        data = stream.read()
    try:
        header = read_header(data)
        blocks, starts = [], []
        for block, at in read_blocks(data, header):
            blocks.append(block)
            starts.append(at)
            if options.records and block["kind"] in RECORD_KINDS:
                for record in records_of(data, at, block, header):
                    print(json.dumps(record))
        check_order(data, blocks, starts)
        if not options.records:
            print(json.dumps({**header, "blocks": blocks,
                              "record_count": sum(b["count"] for b in blocks
                                                  if b["kind"] in RECORD_KINDS),
                              "solve": read_note(data, blocks, starts, 0),
                              "checks": read_note(data, blocks, starts, 1)}, indent=1))
    except Damaged as reason:
        print("error: %s: %s" % (options.file, reason), file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
