"""Valid input made invalid, or other input: texts by bytes and by words, namelists and tables by what they consist of, HDF5 files by their
datasets, attributes, links and storage. Everything is drawn from a random.Random, so that a number gives the same mutation again."""
import re

import h5py
import numpy as np

from gravier import checksum, parse_namelist
from gravier.case import value_text

#: numbers of a dataset that is read to be changed
MOST = 10**7
#: numbers, texts and words that a reader may take for what they are not
EXTREMES = (
    "0", "-0.0", "1", "-1", "2", "3", "7", "1.5", "0.5", "2147483647", "2147483648", "-2147483648", "4294967297", "9223372036854775807",
    "9223372036854775808", "99999999999999999999", "1e30", "1e31", "1e-30", "1e-31", "1e308", "1e309", "-1e309", "1e-320", "5e-324", "NaN",
    "Inf", "-Infinity", "nan(1)", "0x10", "1.", ".5", ".", "+", "-", "1d5", "1D-5", "1e+5", "1e", "e5", "1e5.5", "1.5.2", "1-1", "1+5", "1_8",
    "1e99999999999999999999", "0000000000000000000000000000001", "1" * 400, "0." + "3" * 400, ".true.", ".false.", "T", "F", ".t", "true", "'",
    "''", "'a'", '"b"', "'it''s'", "2*1", "0*1", "999999999*1", "9999999999999*1", "2*", "*", "-2*1", "()", "(1)", "(0)", "(2)", "(1:2)", "%x",
    "é", "\u2212" + "1", "\u00a0", "\x00", "\t", "..", "/dev/null", "/", ".", "~", "%s%n", "a" * 300, "$", ";", "`id`", "#", "!", "&", "/", "=",
    ",", "&end", "&time", "\r", "\n", "\\", "1,2", "1 2", "1;2", "(1.0,2.0)", "z'ff'", "1e3000", "-1e-400", "inf", "+inf", "-nan", "1 e5", "٣")

WORD = re.compile(rb"[A-Za-z_]\w*|[-+]?[\d.]+(?:[eEdD][-+]?\d+)?|'[^'\n]*'|[^\w\s]")


def mutate_bytes(draw, data, others=()):
    """One change of the bytes of a text; `others` are texts of which parts are taken."""
    size = len(data)
    a = draw.randrange(size + 1)
    b = min(size, a + draw.choice((1, 1, 2, 5, 20, 100)))
    kind = draw.randrange(9)
    if kind == 0 and size:
        a = min(a, size - 1)
        return data[:a] + bytes([data[a] ^ (1 << draw.randrange(8))]) + data[a + 1:]
    if kind == 1:
        return data[:a] + data[b:]
    if kind == 2:
        return data[:b] + data[a:b] * draw.choice((1, 1, 3, 1000)) + data[b:]
    if kind == 3:
        return data[:a] + bytes(draw.randrange(256) for _ in range(draw.choice((1, 1, 4, 50)))) + data[a:]
    if kind == 4:
        return data[:a] + draw.choice((b"\0", b"\xff", b"\r", b"\t", b"\n", b"'", b'"', b"&", b"/", b"!", b"=", b",", b"(", b")", b"*", b"#", b"-",
                                       b".", b"0", b"9", b" ", b"\xef\xbb\xbf", b"\x1a", b"\xc3\xa9", b"\xe2\x80\xa8", b"\x0b", b"\x0c")) + data[a:]
    if kind == 5:
        return data[:a]
    if kind == 6:
        c = draw.randrange(size + 1)
        a, b, c = sorted((a, b, c))
        return data[:a] + data[b:c] + data[a:b] + data[c:]
    if kind == 7:
        other = draw.choice(list(others) or [data])
        c = draw.randrange(len(other) + 1)
        return data[:a] + other[c:c + draw.choice((1, 10, 100, 1000))] + data[b:]
    return data[:a] + draw.choice(EXTREMES).encode() + data[b:]


def mutate_words(draw, data, words=()):
    """One change of the words of a text; `words` are others that it knows."""
    found = list(WORD.finditer(data))
    if not found:
        return mutate_bytes(draw, data)
    one, other = draw.choice(found), draw.choice(found)
    kind = draw.randrange(7)
    if kind <= 2:
        new = draw.choice(EXTREMES).encode()
    elif kind == 3:
        new = b""
    elif kind == 4:
        new = one[0] + b" " + one[0]
    elif kind == 5 or not words:
        new = other[0]
    else:
        new = draw.choice(words).encode()
    return data[:one.start()] + new + data[one.end():]


def mutate_text(draw, data, words=(), others=()):
    """One to three changes of a text."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        data = mutate_bytes(draw, data, others) if draw.random() < 0.4 else mutate_words(draw, data, words)
    return data


# ---------------------------------------------------------------------------------------------- namelists

def groups_of(text):
    """[(group, [(key, text of its value)])] of a well-formed namelist."""
    return [(group, [(key, value_text(value)) for key, value in keys.items()]) for group, several in parse_namelist(text).items()
            for keys in several]


def written(groups, draw=None):
    """A namelist of [(group, [(key, value)])]; with `draw` in another of the ways of writing that mean the same."""
    if draw is None:
        return "".join(f"&{group}\n" + "".join(f"  {key} = {value}\n" for key, value in keys) + "/\n" for group, keys in groups)
    end = draw.choice(("\n", "\r\n", "\n\n", "  \n"))

    def case(word):
        return draw.choice((word, word.upper(), word.capitalize()))

    def spelt(value):
        if "'" in value:
            return value
        value = draw.choice((value, value.replace(", ", " , "), value.replace(", ", "  "), value.replace(", ", "," + end + " "), value + ","))
        return value.upper() if draw.random() < 0.2 else re.sub(r"(?<=\d)e(?=[-+]?\d)", draw.choice("edDE"), value)

    text = draw.choice(("", "\ufeff", "! a comment" + end, end))
    for group, keys in groups:
        mark = draw.choice((end, " ", " ! / &scene 'x" + end))
        text += f"{draw.choice(('', ' ', chr(9)))}&{case(group)}{mark}"
        for key, value in keys:
            text += f"{case(key)}{draw.choice(('=', ' = ', chr(9) + '= '))}{spelt(value)}{draw.choice((' ', end, ' ! it''s' + end))}"
        text += "/" + draw.choice((end, " ", " ! end" + end, "\n"))
    return text


def mutate_namelist(draw, text, keys):
    """(text, whether it means the same) by one or two changes of groups, keys and values. `keys` are (group, key) of all that there are."""
    groups = groups_of(text)
    if draw.random() < 0.1:
        # several of a kind are told by their order
        order = [group for group, _ in groups]
        draw.shuffle(order)
        several = {name: [inside for group, inside in groups if group == name] for name in order}
        groups = [(name, several[name].pop(0)) for name in order]
        for _, inside in groups:
            draw.shuffle(inside)
        return written(groups, draw), True
    for _ in range(draw.choice((1, 1, 2))):
        group, inside = draw.choice(groups)
        kind = draw.randrange(10)
        at = draw.randrange(len(inside)) if inside else 0
        if kind == 0:
            groups.insert(draw.randrange(len(groups) + 1), (group, list(inside)))
        elif kind == 1:
            groups.remove((group, inside))
            if not groups:
                groups = [(group, [])]
        elif kind == 2 and inside:
            draw.choice(groups)[1].append(inside.pop(at))
        elif kind == 3 and inside:
            inside.pop(at)
        elif kind == 4 and inside:
            inside.append(inside[at])
        elif kind == 5:
            named, key = draw.choice(keys)
            target = [one for one in groups if one[0] == named] or [(named, [])]
            if target[0] not in groups:
                groups.append(target[0])
            target[0][1].append((key, draw.choice(EXTREMES)))
        elif kind == 6 and inside:
            key, value = inside[at]
            inside[at] = (draw.choice((key + "(1)", key + "(2)", key + "(0)", key + "(9999999999)", key + "(", key + "(1:2)", key + " (1)", "")), value)
        elif kind == 7 and inside:
            key, value = inside[at]
            parts = value.split(", ")
            parts[draw.randrange(len(parts))] = draw.choice(EXTREMES)
            inside[at] = (key, ", ".join(parts))
        elif kind == 8 and inside:
            key, value = inside[at]
            inside[at] = (key, draw.choice((value + ", " + value, "", "," + value, value + " /", "-" + value, value + " " + key, f"3*{value}", f"1*{value}")))
        elif inside:
            inside[at] = (inside[at][0], draw.choice(EXTREMES))
    return written(groups), False


# ---------------------------------------------------------------------------------------------- tables

def mutate_table(draw, text):
    """One change of the columns, rows or cells of a CSV table."""
    lines = [line.split(",") for line in text.splitlines()]
    row, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    column = draw.randrange(len(lines[row]))
    kind = draw.randrange(9)
    if kind == 0:
        lines.insert(row, list(lines[other]))
    elif kind == 1:
        del lines[row]
    elif kind == 2:
        lines[row], lines[other] = lines[other], lines[row]
    elif kind == 3:
        for line in lines:
            del line[column:column + 1]
    elif kind == 4:
        for line in lines:
            line.append(line[column] if column < len(line) else "")
    elif kind == 5:
        del lines[row][column]
    elif kind == 6:
        lines[row].insert(column, draw.choice(EXTREMES))
    else:
        lines[row][column] = draw.choice(EXTREMES)
    return draw.choice(("\n", "\n", "\n", "\r\n", "\r")).join(",".join(line) for line in lines) + draw.choice(("\n", "\n", "", "\n\n", "\x1a"))


# ---------------------------------------------------------------------------------------------- HDF5

NUMBERS = (0, 1, -1, 2, 3, 7, 255, -128, 2**31 - 1, 2**31, -2**31, 2**32 + 1, 2**53 + 1, 2**62, 2**63 - 1, -2**63)
REALS = (0.0, -0.0, 1.0, -1.0, 0.5, np.nan, np.inf, -np.inf, 1e30, 1e31, -1e31, 1e-31, 1e-320, 1e300, -1e300, 1e155)
TYPES = ("f4", "f2", ">f8", "i8", "i4", "i2", "i1", "u8", "u1", ">i8", "S8", "S1", "bool", "c16", "f8", "f16")


def put(file, name, values, draw, **how):
    """A dataset in the place of another, with its attributes; its checksum is made anew, left out, or left as it was."""
    attributes = dict(file[name].attrs)
    del file[name]
    one = file.create_dataset(name, data=values, **how)
    for key, value in attributes.items():
        if key != "checksum":
            one.attrs[key] = value
    fate = draw.random()
    if "checksum" in attributes and fate < 0.6:
        seal(one)
    elif "checksum" in attributes and fate < 0.7:
        one.attrs["checksum"] = attributes["checksum"]


def seal(dataset):
    values = dataset[()]
    if isinstance(values, np.ndarray) and values.ndim > 0 and values.dtype.hasobject is False and (
            values.dtype.itemsize == 8 or values.dtype.kind == "S" and values.dtype.itemsize % 8 == 0):
        dataset.attrs["checksum"] = np.int64(checksum.checksum(values))


def change_values(draw, values):
    """Numbers of an array that become others."""
    values = np.array(values)
    flat = values.reshape(-1)
    if not flat.size or values.dtype.kind not in "fiuS":
        return values
    for _ in range(draw.choice((1, 1, 2, 10))):
        at = draw.randrange(flat.size)
        # numbers that are too large become infinity
        with np.errstate(all="ignore"):
            change_value(draw, values, flat, at)
    return values


def change_value(draw, values, flat, at):
    if values.dtype.kind == "S":
        text = bytearray(flat[at].ljust(values.dtype.itemsize))
        text[draw.randrange(len(text))] = draw.choice(b"\0 \n'&/0a\xff")
        flat[at] = bytes(text)
    elif values.dtype.kind == "f":
        flat[at] = draw.choice((*REALS, flat[draw.randrange(flat.size)], -flat[at]))
    else:
        number = draw.choice((*NUMBERS, int(flat[draw.randrange(flat.size)]), int(flat[at]) + 1, int(flat[at]) ^ (1 << draw.randrange(63))))
        flat[at] = np.array(number % 2**64, dtype="u8").astype("i8").astype(values.dtype)


def change_shape(draw, values):
    rows = len(values) if values.ndim else 1
    kind = draw.randrange(9)
    if kind == 0:
        return values[:max(0, rows - 1)] if values.ndim else values
    if kind == 1:
        return np.concatenate([values, values[-1:]]) if values.ndim else values
    if kind == 2:
        return values[:0] if values.ndim else values
    if kind == 3:
        return values.reshape(1, *values.shape)
    if kind == 4:
        return values.reshape(*values.shape, 1)
    if kind == 5:
        return values.T
    if kind == 6:
        return values.reshape(-1)
    if kind == 7:
        return np.concatenate([values, values]) if values.ndim else values
    return values.reshape(-1)[0] if values.size else values


def change_storage(draw, file, name):
    values = file[name][()]
    kind = draw.randrange(9)
    if kind == 0:
        put(file, name, values, draw, compression="gzip")
    elif kind == 1 and values.ndim:
        put(file, name, values, draw, chunks=tuple(max(1, n // 2) for n in values.shape), maxshape=tuple(None for _ in values.shape))
    elif kind == 2:
        put(file, name, values, draw, compression="lzf", fletcher32=True)
    elif kind in (3, 4):
        shape, dtype = values.shape, values.dtype
        rows = draw.choice((2**20, 2**31, 2**33, 2**40, 2**62 // 16))
        del file[name]
        file.create_dataset(name, shape=(rows, *shape[1:]), dtype=dtype, chunks=(1024, *[max(1, n) for n in shape[1:]]))
    elif kind == 5:
        del file[name]
        file[name] = h5py.Empty("f8")
    elif kind == 6:
        shape, dtype = values.shape, values.dtype
        del file[name]
        file.create_dataset(name, shape=shape, dtype=dtype, external=[("nowhere.bin", 0, h5py.h5f.UNLIMITED)])
    elif kind == 7:
        shape, dtype = values.shape, values.dtype
        layout = h5py.VirtualLayout(shape=shape or (1,), dtype=dtype)
        layout[...] = h5py.VirtualSource("nowhere.h5", name, shape=shape or (1,))
        del file[name]
        file.create_virtual_dataset(name, layout)
    else:
        del file[name]
        file.create_dataset(name, data=np.array([b"text"] * max(1, len(np.atleast_1d(values)))), dtype=h5py.string_dtype())


def change_link(draw, file, name, names):
    kind = draw.randrange(9)
    other = draw.choice(names)
    if kind == 0:
        del file[name]
    elif kind == 1:
        file.move(name, name + draw.choice("_x1"))
    elif kind == 2:
        del file[name]
        file.create_group(name)
    elif kind == 3:
        del file[name]
        file[name] = h5py.SoftLink(draw.choice(("/nowhere", "/" + name, "/", "/" + other)))
    elif kind == 4:
        del file[name]
        file[name] = h5py.ExternalLink("nowhere.h5", "/x")
    elif kind == 5 and not other.startswith(name):
        del file[name]
        if other in file:
            file[name] = file[other]
    elif kind == 6:
        del file[name]
        file[name] = np.dtype(draw.choice(("f8", "i4", "S3")))
    elif kind == 7:
        del file[name]
        file[name] = draw.choice((1.0, 7, np.arange(3), np.zeros((2, 2)), b"text"))
    elif isinstance(file[name], h5py.Group):
        file[name][draw.choice(("x", "1", "id", "-1", "é"))] = draw.choice((1.0, np.arange(3)))


def change_attribute(draw, item):
    keys = list(item.attrs)
    key = draw.choice(keys) if keys else "extra"
    old = item.attrs.get(key, 0)
    kind = draw.randrange(8)
    if kind == 0 and keys:
        del item.attrs[key]
    elif kind == 1:
        item.attrs[key] = draw.choice(("text", b"", b"a" * 5000, np.bytes_(b"fixed"), h5py.Empty("f8")))
    elif kind == 2:
        item.attrs[key] = draw.choice((np.arange(5), np.zeros((2, 3)), np.array([old, old]) if not isinstance(old, h5py.Empty) else 0))
    elif kind == 3:
        item.attrs["extra"] = 1
    elif kind == 4:
        item.attrs.create(key, draw.choice((1, 2, 0, 3, 5)), dtype=draw.choice(("i1", "u1", "f4", ">f8", "f8", "i8", ">i8")))
    elif isinstance(old, (float, np.floating)):
        item.attrs[key] = draw.choice(REALS)
    elif isinstance(old, (str, bytes)):
        text = old if isinstance(old, bytes) else old.encode()
        item.attrs[key] = np.bytes_(mutate_bytes(draw, text) or b" ")
    else:
        item.attrs[key] = np.int64(draw.choice(NUMBERS))


def mutate_hdf5(draw, path):
    """One to three changes of an HDF5 file, of what it has or of its bytes."""
    if draw.random() < 0.15:
        with open(path, "rb") as file:
            data = file.read()
        kind = draw.randrange(4)
        if kind == 0:
            data = data[:draw.randrange(len(data))]
        elif kind == 1:
            data = data + bytes(draw.randrange(2000))
        elif kind == 2:
            data = bytes(draw.choice((512, 1024, 100))) + data
        else:
            data = bytearray(data)
            for _ in range(draw.choice((1, 3, 20))):
                data[draw.randrange(len(data))] = draw.randrange(256)
        with open(path, "wb") as file:
            file.write(data)
        return
    with h5py.File(path, "r+") as file:
        for _ in range(draw.choice((1, 1, 1, 2, 3))):
            names = []
            file.visit(names.append)
            if not names:
                return
            try:
                change_item(draw, file, draw.choice(names), names)
            except (TypeError, ValueError, KeyError, OSError, RuntimeError, OverflowError, AttributeError, MemoryError):
                # a change that HDF5 or numpy does not make of this item
                pass


def change_item(draw, file, name, names):
    item = file[name]
    if isinstance(item, h5py.Dataset) and item.size is not None and item.size > MOST:
        # rows that are not there, from a change before this one
        return
    kind = draw.choice(("values", "values", "values", "shape", "type", "storage", "link", "attribute"))
    if kind == "attribute" or (not isinstance(item, h5py.Dataset) and kind != "link" and len(item.attrs)):
        with_attributes = [file[one] for one in names if one in file and len(file[one].attrs)]
        change_attribute(draw, item if len(item.attrs) else draw.choice(with_attributes or [item]))
    elif kind == "link" or not isinstance(item, h5py.Dataset):
        change_link(draw, file, name, names)
    elif kind == "storage":
        change_storage(draw, file, name)
    else:
        values = item[()]
        if kind == "values":
            values = change_values(draw, values)
        elif kind == "shape":
            values = change_shape(draw, values)
        else:
            with np.errstate(all="ignore"):
                values = values.astype(draw.choice(TYPES))
        put(file, name, values, draw)
