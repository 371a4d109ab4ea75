"""Mutations of checkpoint files, for tools/fuzz: bytes, and with a right checksum numbers, shapes and names. Bytes in, bytes out."""
import io

import h5py
import numpy as np

from fuzz_namelists import delete_bytes, duplicate_bytes, flip_bytes, insert_bytes, truncate

MARK = b"\ndotyk checkpoint "
NUMBERS = [float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-308, 5e-324, 0.0, -0.0, -1.0, 1e16]
INTEGERS = [0, 1, -1, 2, 2**31 - 1, -2**31, 2**62, -2**63]


def with_checksum(data):
    """A content with the last line that makes it a checkpoint: FNV-1a of 64 bits."""
    value = 0xcbf29ce484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001b3 % 2**64
    return data + MARK + b"%016X\n" % value


def edit(data, change):
    """Change the HDF5 file inside of a checkpoint."""
    end = data.rfind(MARK)
    buffer = io.BytesIO(data[:end])
    try:
        with h5py.File(buffer, "r+") as file:
            change(file["checkpoint"])
    except (OSError, KeyError, ValueError, TypeError, AttributeError, IndexError):  # what was changed before may not be an array
        return data
    return with_checksum(buffer.getvalue())


def replace(group, name, values):
    """Put another dataset in the place of one."""
    del group[name]
    if values is not None:
        group[name] = values


def odd_entries(rng, data):
    """Some numbers of a dataset are odd ones."""
    def change(group):
        name = rng.choice(sorted(group))
        values = group[name][()]
        if values.size:
            for _ in range(rng.choice([1, 1, values.size])):
                values.flat[rng.randrange(values.size)] = rng.choice(NUMBERS if values.dtype.kind == "f" else INTEGERS)
            replace(group, name, values)
    return edit(data, change)


def odd_shape(rng, data):
    """A dataset is missing, empty, shorter, longer, or has other dimensions."""
    def change(group):
        name = rng.choice(sorted(group))
        values = group[name][()]
        replace(group, name, rng.choice([None, values[:0], values[:-1], np.concatenate([values, values]), values.reshape(-1, 1),
                                         values.reshape(1, -1), values.astype("f4"), values.astype("i8"), np.zeros((3, 3, 3)), 1.0,
                                         "text", np.zeros(1000000)]))
    with np.errstate(all="ignore"):
        return edit(data, change)


def odd_attribute(rng, data):
    """An attribute is missing, another number, or a text."""
    def change(group):
        name = rng.choice(sorted(group.attrs))
        del group.attrs[name]
        value = rng.choice(NUMBERS + INTEGERS + ["", "text", "a" * 5000, "dual", "interrupted", None])
        if value is not None:
            group.attrs[name] = value
    return edit(data, change)


def odd_bytes(rng, data):
    """Bytes of the HDF5 file are others, and the checksum is right all the same."""
    end = data.rfind(MARK)
    return with_checksum(rng.choice([flip_bytes, truncate, delete_bytes])(rng, data[:end])) if end > 0 else data


MUTATORS = [flip_bytes, delete_bytes, duplicate_bytes, insert_bytes, truncate, odd_entries, odd_entries, odd_entries, odd_shape,
            odd_shape, odd_attribute, odd_attribute, odd_bytes]
