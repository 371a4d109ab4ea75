"""Mutations of a namelist's bytes and tokens, for tests/fuzz/fuzz.py. Each takes a random generator and bytes, and
gives bytes."""
import re

NUMBERS = ["0", "-0", "-0.0", "1", "-1", "1e308", "-1e308", "1.7976931348623157e308", "1e-308", "1e-320", "5e-324",
           "1e400", "-1e400", "1e-400", "NaN", "nan", "Inf", "-Infinity", "1e", "e5", "1d10", "1.0f11", "0x10",
           "1e999999999999", "1.2.3", "--1", "+-1", "2147483647", "2147483648", "-2147483649", "9223372036854775808",
           "1" + "0" * 400, "0." + "0" * 400 + "1", "1e+", ".", "", "1_8", "1,", ",", ",,", "3*", "*3", "0*1", "-1*1",
           "1000*1", "1001*1", "1000000*1", "99999999999*1", "2*'x'", "3*3*3", "T", ".true.", "(1,2)", "1e5e5", "'1'",
           "1/2", "1e-2147483648", "00000000000000000000001", "1e0000000000000000000003"]
TEXTS = ["", " ", "''", "a" * 300, "a" * 70000, "дотик", "\xff\xfe", "a\x00b", "\x00", "a\tb", "a\rb", "low", "high",
         "lower", "a.msh", "upper:low", ":", "a:", ":b", "::", "a:b:c", "upper:", "%s%s%n", "../a.msh", ".", "..", "/",
         "nothing.geo", "a.txt", "a.msh/", "xyz", "xx", "nt", "xn", "ξ", "*", "?", "$HOME", "`id`", "a/b/c/d.vtkhdf",
         "-", "--check", "1", "x" * 5000 + ".vtkhdf", "."]
FORMULAS = ["x", "1", "", "x y", "(", ")", "((((x))))", "(" * 2000 + "x" + ")" * 2000, "(" * 100000, "-" * 5000 + "x",
            "1/0", "0/0", "1/x", "log(0)", "sqrt(-1)", "x^x^x", "1e308*1e308", "exp(1000)", "x=1", "q", "t", "sin",
            "sin(", "sin()", "sin(1,2)", "max()", "max(1,2,3)", "pi(", "x;y", "x,y", "1,2", "'", "x>0 ? 1 : 2", "x ? 1",
            "?:", "1e400", "nan", "inf", "_pi", "rint(1e300)", "x" * 3000, "+".join(["x"] * 5000), "sum()", "avg(x)",
            "if(x,1,2)", "x&&y", "x and y", "!x", "#", "\x00", "x\n+y", "é",
            "1..2", "0x", "0xff", "2**3", "x^(1/0)", "tan(pi/2)", "atan2(0,0)", "x!=y", "a=x", "x+=1",
            "max(" * 500 + "x" + ",0)" * 500]
ODD_BYTES = [b"\x00", b"\xff", b"\xc3\x28", b"\xef\xbb\xbf", b"\x1b[31m", b"\r", b"\n", b"\t", b"'", b'"', b"&", b"/",
             b"!", b"=", b",", b"*", b"$", b"(", b"%", b" ", b"\xe2\x80\x8b", b"'" * 1000, b"&x " * 300, b"\n" * 1000,
             b"," * 500, b"(" * 500, b"9" * 5000]
TOKEN = re.compile(rb"'[^'\n]*'|[A-Za-z_]\w*(?=\s*=)|&\w+|[-+\w.*]+|[=,/]")
GROUP = re.compile(rb"&[^&]*?/ *\n")


def place(rng, data):
    """A place in the bytes."""
    return rng.randrange(len(data) + 1)


def flip_bytes(rng, data):
    """Some bytes become others."""
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        if data:
            i = rng.randrange(len(data))
            data[i] = rng.choice([data[i] ^ 1 << rng.randrange(8), rng.randrange(256)])
    return bytes(data)


def delete_bytes(rng, data):
    """A piece is left out."""
    i = place(rng, data)
    return data[:i] + data[i + rng.choice([1, 1, 2, 5, 20, 200]):]


def duplicate_bytes(rng, data):
    """A piece comes again, somewhere."""
    i, j = place(rng, data), place(rng, data)
    piece = data[i:i + rng.choice([1, 4, 20, 200])] * rng.choice([1, 1, 1, 2, 50])
    return data[:j] + piece + data[j:]


def insert_bytes(rng, data):
    """Odd bytes are put in."""
    i = place(rng, data)
    return data[:i] + rng.choice(ODD_BYTES) * rng.choice([1, 1, 1, 3]) + data[i:]


def truncate(rng, data):
    """The end, or the beginning, is missing."""
    i = place(rng, data)
    return rng.choice([data[:i], data[:i], data[i:]])


def long_line(rng, data):
    """A very long token, line or comment."""
    i = place(rng, data)
    letter = rng.choice([b"a", b"1", b" ", b"!", b"'", b"1,", b"a=1,", b"/", b"\xc3"])
    return data[:i] + letter * rng.choice([1000, 10000, 200000]) + data[i:]


def replace_token(rng, data, pattern, words):
    """One of the places that match becomes one of the words."""
    places = list(re.finditer(pattern, data))
    if not places:
        return data
    old = rng.choice(places)
    return data[:old.start()] + rng.choice(words).encode("utf-8", "surrogateescape") + data[old.end():]


def odd_number(rng, data):
    """A number becomes an odd one."""
    return replace_token(rng, data, rb"(?<=[=,])[-+\d.][-+\w.]*", NUMBERS)


def odd_text(rng, data):
    """A text in quotes becomes an odd one."""
    word = rng.choice([rng.choice(TEXTS), rng.choice(NUMBERS)])
    return replace_token(rng, data, rb"(?<=')[^'\n]*(?=')", [word])


def odd_formula(rng, data):
    """A value becomes a formula, or a formula an odd one."""
    formula = rng.choice(FORMULAS)
    keys = ["gap_formula=", "theta_formula=", "young_formula=", "pressure_formula=", "value_formula=",
            "traction_formula=", "force_density_formula="]
    if rng.random() < 0.5 and b"_formula='" in data:
        return replace_token(rng, data, rb"(?<=_formula=')[^'\n]*(?=')", [formula])
    n = rng.choice([1, 1, 2, 3])
    values = ",".join(["'%s'" % formula] * n)
    return replace_token(rng, data, rb"[a-z_]+=(?:'[^'\n]*'|[-+\d.e]+)(?:,[-+\d.e]+)*(?= */)",
                         [rng.choice(keys) + values])


def swap_tokens(rng, data):
    """Two tokens change places."""
    tokens = list(TOKEN.finditer(data))
    if len(tokens) < 2:
        return data
    a, b = sorted(rng.sample(tokens, 2), key=lambda t: t.start())
    return data[:a.start()] + b[0] + data[a.end():b.start()] + a[0] + data[b.end():]


def drop_token(rng, data):
    """A token is left out, or doubled."""
    tokens = list(TOKEN.finditer(data))
    if not tokens:
        return data
    t = rng.choice(tokens)
    return data[:t.start()] + rng.choice([b"", t[0] + b" " + t[0], t[0] + b"," + t[0]]) + data[t.end():]


def misspell(rng, data):
    """A key or a group gets another name."""
    places = list(re.finditer(rb"(?<=&)\w+|[a-z_]+(?==)", data))
    if not places:
        return data
    old = rng.choice(places)
    word = bytearray(old[0])
    i = rng.randrange(len(word))
    new = rng.choice([word[:i] + word[i + 1:], word[:i] + b"x" + word[i:], word.upper(), word + b"(1)", word + b"%a",
                      b"", word[:i] + bytes([rng.randrange(33, 256)]) + word[i + 1:], word * 200,
                      rng.choice([b"material", b"body", b"contact", b"theta", b"value", b"gap", b"name", b"solver",
                                  b"end", b"output"])])
    return data[:old.start()] + bytes(new) + data[old.end():]


def change_groups(rng, data):
    """A group is left out, doubled, moved, emptied, not closed or comes many times."""
    places = list(GROUP.finditer(data))
    if not places:
        return data
    old = rng.choice(places)
    rest = data[:old.start()] + data[old.end():]
    i = place(rng, rest)
    return rng.choice([rest, rest + old[0], data + old[0], rest[:i] + old[0] + rest[i:], data + old[0] * 300,
                       data[:old.start()] + old[0].split(b" ")[0] + b" /\n" + data[old.end():],
                       data[:old.start()] + old[0].rstrip(b" /\n") + b"\n" + data[old.end():]])


def change_key(rng, data):
    """A key is left out, comes twice, or gets many values."""
    places = list(re.finditer(rb",? *[a-z_]+=(?:'[^'\n]*'|[^ ,='/\n]+)(?:,(?:'[^'\n]*'|[-+\d.e]+))*", data))
    if not places:
        return data
    old = rng.choice(places)
    value = rng.choice([b"", old[0] + b" " + old[0].lstrip(b", "), old[0] + b",1" * rng.choice([1, 3, 30, 3000]),
                        old[0] + b"," * 9,
                        old[0].split(b"=")[0] + b"=", old[0].split(b"=")[0] + b"=" + rng.choice(NUMBERS).encode()])
    return data[:old.start()] + value + data[old.end():]


MUTATORS = [flip_bytes, delete_bytes, duplicate_bytes, insert_bytes, truncate, long_line, odd_number, odd_number,
            odd_text, odd_formula, swap_tokens, drop_token, misspell, change_groups, change_key]
