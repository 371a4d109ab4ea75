"""Mutations of mesh files, for tests/fuzz/fuzz.py: tokens of text, bytes and numbers of binary files. Bytes in, bytes
out."""
import re
import struct

from fuzz_namelists import delete_bytes, duplicate_bytes, flip_bytes, insert_bytes, truncate

INTEGERS = [0, 1, 2, 3, -1, -2, 7, 15, 16, 100, 255, 256, 1000, 65535, 10**6, 2**31 - 1, 2**31, -2**31, 2**32 - 1,
            2**32, 2**53, 2**62, 2**63 - 1, -2**63, 2**63, 2**64 - 1, 2**64, 10**30]
WORDS = ["nan", "NaN", "inf", "-inf", "1e400", "-1e400", "1e308", "-1e308", "1e-320", "0", "-0", "1e300", "1e150",
         "1e-150", "x", "1.5", "1e", "0x1p3", "1.0d0", "", "1 2", "$End", "9" * 400, "0." + "0" * 400 + "1", "a" * 5000,
         "\x00", "\xff", "-", "+", ".", "1e5e5"]
SECTION = re.compile(rb"\$(\w+)\n.*?\$End\1\n", re.S)
NAME = re.compile(rb'"[^"\n]*"')


def odd_word(rng, data):
    """A word of a text becomes an odd one."""
    words = list(re.finditer(rb"\S+", data))
    if not words:
        return data
    old = rng.choice(words)
    new = str(rng.choice(INTEGERS)) if rng.random() < 0.5 else rng.choice(WORDS)
    return data[:old.start()] + new.encode("utf-8", "surrogateescape") + data[old.end():]


def swap_words(rng, data):
    """Words change places: nodes of other elements, tags of others, coordinates for counts."""
    for _ in range(rng.choice([1, 1, 3])):
        words = list(re.finditer(rb"\S+", data))
        if len(words) < 2:
            return data
        a, b = sorted(rng.sample(words, 2), key=lambda w: w.start())
        data = data[:a.start()] + b[0] + data[a.end():b.start()] + a[0] + data[b.end():]
    return data


def change_count(rng, data):
    """A count behind the name of a section, or in the head of a block, is wrong."""
    places = list(re.finditer(rb"(?<=\n)[\d ]+(?=\n)", data))
    heads = list(re.finditer(rb"(?<=[a-z]\n)[\d ]+(?=\n)", data))
    if not places:
        return data
    old = rng.choice(heads if heads and rng.random() < 0.6 else places)
    numbers = old[0].split()
    i = rng.randrange(len(numbers))
    numbers[i] = rng.choice([b"%d" % rng.choice(INTEGERS), b"%d" % (int(numbers[i]) + 1),
                             b"%d" % (int(numbers[i]) - 1)])
    return data[:old.start()] + b" ".join(numbers) + data[old.end():]


def change_sections(rng, data):
    """A section is left out, doubled, moved, emptied, or has no end."""
    places = list(SECTION.finditer(data))
    if not places:
        return data
    old = rng.choice(places)
    rest = data[:old.start()] + data[old.end():]
    other = rng.choice(places)
    name = b"$" + old[1] + b"\n"
    return rng.choice([
        rest, rest + old[0], data + old[0], old[0] + rest, data[:old.start()] + other[0] + data[old.start():],
        data[:old.start()] + name + b"$End" + old[1] + b"\n" + data[old.end():],
        data[:old.start()] + name + b"0\n$End" + old[1] + b"\n" + data[old.end():],
        data[:old.start()] + old[0].replace(b"$End", b"$end") + data[old.end():],
        data[:old.start()] + old[0].replace(old[1],
                                            rng.choice([b"Nodes", b"Elements", b"Periodic", b"NodeData", b"X" * 300]))
        + data[old.end():], data.replace(b"\n", b"\r\n"), data.replace(b"\n", b" "), data.replace(b"\n", b"\n\n"),
        data.rstrip(b"\n"),
        b"$Comments\n" + b"x" * 5000 + b"\n$EndComments\n" + data])


def change_lines(rng, data):
    """Lines are left out, doubled or change places."""
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    action = rng.randrange(4)
    if action == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif action == 1:
        del lines[i]
    elif action == 2:
        lines.insert(j, lines[i])
    else:
        lines[i:i + 3] = []
    return b"\n".join(lines)


def change_names(rng, data):
    """A physical name, dimension or tag is an odd one."""
    names = list(NAME.finditer(data))
    if not names:
        return data
    old = rng.choice(names)
    new = rng.choice([b'"', b'""', b'"""', b"''", b'"a"b"', b'"' + b"a" * 5000 + b'"', b'"\x00"', b'"\xff\xfe"',
                      b'" low "', b'"low"', b'"LOW"', b'"1"', b'"lower', b'lower"', b'"a\tb"', b'"%s"', b"",
                      names[0][0], rng.choice(names)[0]])
    return data[:old.start()] + new + data[old.end():]


def change_version(rng, data):
    """The format is another one."""
    head = rng.choice([b"2.2 0 8", b"4.1 0 8", b"2.2 1 8", b"4.1 1 8", b"2 0 8", b"4 0 8", b"1 0 8", b"3 0 8",
                       b"2.2 0 4", b"4.1 1 4", b"2.2 2 8", b"nan 0 8", b"1e400 0 8", b"2.2", b"", b"2.2 0 8 9",
                       b"-4.1 0 8", b"4.10000001 0 8", b"2.2 -1 8", b"x"])
    return re.sub(rb"(?<=\$MeshFormat\n)[^\n]*", lambda _: head, data, count=1)


def binary_number(rng, data):
    """A number of a binary file becomes an odd one."""
    first = data.find(b"$Nodes") if rng.random() < 0.8 else 0
    for _ in range(rng.choice([1, 1, 1, 3])):
        form = rng.choice(["<i", "<q", "<d", ">i"])
        size = struct.calcsize(form)
        if len(data) - size <= max(first, 0):
            return data
        i = rng.randrange(max(first, 0), len(data) - size)
        if form == "<d":
            new = rng.choice([float("nan"), float("inf"), 1e308, -1e308, 1e-320, 0.0, -0.0, 1e150, 1e-150, 1e300])
        else:
            n = rng.choice(INTEGERS) % 2**(8 * size)
            new = n - 2**(8 * size) if n >= 2**(8 * size - 1) else n
        data = data[:i] + struct.pack(form, new) + data[i + size:]
    return data


def binary_head(rng, data):
    """One of the first numbers behind the name of a section."""
    name = rng.choice([b"$Nodes\n", b"$Elements\n", b"$Entities\n", b"$EndMeshFormat"])
    i = data.find(name)
    if i < 0:
        return data
    i = i - 5 if name == b"$EndMeshFormat" else i + len(name) + rng.choice([0, 0, 4, 8, 8, 16, 24, 32, 36, 40, 44, 48])
    form = rng.choice(["<i", "<q"])
    size = struct.calcsize(form)
    n = rng.choice(INTEGERS + [2**24]) % 2**(8 * size)
    return data[:i] + struct.pack(form, n - 2**(8 * size) if n >= 2**(8 * size - 1) else n) + data[i + size:]


COMMON = [flip_bytes, delete_bytes, duplicate_bytes, insert_bytes, truncate, change_sections, change_names,
          change_version, change_count]
TEXT_MUTATORS = COMMON + [odd_word, odd_word, odd_word, swap_words, change_lines, change_lines]
BINARY_MUTATORS = COMMON + [binary_number, binary_number, binary_number, binary_head, binary_head]
