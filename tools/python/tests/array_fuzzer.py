"""Inputs of random values for arrays and their packages, and what must hold whatever they are."""

import copy
import math
import os
import random
from decimal import Decimal
from fractions import Fraction

import numpy as np

from isowave._arrays import ArrayTypeError, ArrayValueError, as_source


NUM_INPUTS = int(os.environ.get("ISOWAVE_FUZZ_INPUTS", "10000"))


REAL_SHARE = 20


TYPES = {np.dtype(name) for name in "u1 i1 u2 i2 u4 i4 u8 i8 f4 f8".split()}


WILD = [
    math.nan,
    math.inf,
    -math.inf,
    0,
    -0.0,
    -1,
    1,
    2,
    1e-320,
    1e308,
    -1e308,
    2**53,
    10**400,
    "",
    "1",
    "text\nof two lines",
    b"bytes",
    None,
    True,
    1j,
    [],
    (),
    {},
    [1, 2, 3],
    (math.nan,) * 3,
    {"type": "scale"},
    np.float32(2),
    np.float64(math.nan),
    np.int8(-3),
    np.array(3.0),
    np.array([1.0]),
    np.eye(3),
    np.zeros((0, 3)),
    np.datetime64("2020-01-01"),
    np.ma.masked,
    Decimal("NaN"),
    Fraction(1, 3),
    object(),
    int,
    lambda: 1,
    range(1000),
    np.dtype("f4"),
]


DTYPES = "u1 i1 u2 i2 u4 i4 f4 f8 b1 f2 i8 u8 >u2 >f4 >i8 c8 c16 S3 U2 O M8[s] m8[s] V5 f16".split()


SIZES = [2, 3, 5, 7, 7, 5, 3, 2, 4, 6, 1, 0]


class Fuzzer:
    """A seeded source of values that are mostly right."""

    def __init__(self, seed):
        self.rng = random.Random(seed)

    def one_in(self, count):
        return self.rng.randrange(count) == 0

    def wild(self):
        return self.rng.choice(WILD)

    def number(self):
        kind = self.rng.randrange(4)
        if kind == 0:
            return self.rng.choice([0.5, 1.0, 2.0, -1.0, 3, 1e-3])
        return self.rng.uniform(-10, 10) if kind == 1 else self.rng.uniform(0.1, 10)

    def numbers(self, count):
        values = [self.number() for _ in range(count)]
        return self.maybe(self.rng.choice((list, tuple, np.array))(values))

    def steps(self):
        return [self.rng.uniform(0.1, 10) for _ in range(3)]

    def maybe(self, value, chance=12):
        """The value, or once in a while something else, or it with something else inside."""
        if not self.one_in(chance):
            return value
        if isinstance(value, (list, tuple)) and value and not self.one_in(3):
            items = list(value)
            if self.one_in(4):
                items.pop() if self.one_in(2) else items.append(self.wild())
            else:
                items[self.rng.randrange(len(items))] = self.wild()
            return type(value)(items) if type(value) in (list, tuple) else items
        return self.wild()

    def shape(self):
        if not self.one_in(6):
            return self.maybe((7, 5, 3), 30)
        count = 3 if not self.one_in(3) else self.rng.randrange(6)
        sizes = [self.rng.choice(SIZES) for _ in range(count)]
        if sizes and self.one_in(20):
            sizes[0] = self.rng.choice([65536, 65537, 2**31, 2**63, -1])
        return self.maybe(tuple(sizes), 30)

    def dtype(self):
        if not self.one_in(4):
            return np.dtype("u2")
        return self.maybe(np.dtype(self.rng.choice(DTYPES)))

    def direction(self):
        kind = self.rng.randrange(5)
        if kind == 0:
            return np.eye(3).tolist()
        if kind == 1:
            order = self.rng.sample(range(3), 3)
            return [[self.rng.choice((-1.0, 1.0)) * (j == i) for j in range(3)] for i in order]
        angle = self.rng.uniform(0, 7)
        c, s = math.cos(angle), math.sin(angle)
        rows = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
        if kind == 2:
            rows[self.rng.randrange(3)][self.rng.randrange(3)] = self.number()  # shear, singular
        if kind == 3 and self.one_in(2):
            rows[self.rng.randrange(3)] = self.maybe(rows[0], 2)
        return self.maybe(rows)

    def deep(self, tree):
        """A copy of nested lists and dicts in which up to three entries are changed or gone."""
        tree = copy.deepcopy(tree)
        for _ in range(self.rng.randrange(4)):
            node = tree
            while True:
                keys = list(node) if isinstance(node, dict) else list(range(len(node)))
                if not keys:
                    break
                key = self.rng.choice(keys)
                child = node[key]
                if isinstance(child, (dict, list)) and not self.one_in(5):
                    node = child
                    continue
                if self.one_in(5):
                    del node[key]
                elif self.one_in(4) and isinstance(child, float):
                    node[key] = self.number()
                else:
                    node[key] = self.wild()
                break
        return tree


def check_invariants(source):
    assert isinstance(source.shape, tuple) and len(source.shape) == 3
    assert all(type(size) is int and 2 <= size <= 65536 for size in source.shape)
    assert source.dtype in TYPES and source.dtype.isnative
    for values in (source.spacing, source.origin):
        assert type(values) is tuple and len(values) == 3
        assert all(type(value) is float and math.isfinite(value) for value in values)
    assert min(source.spacing) > 0
    direction = source.direction
    assert direction.shape == (3, 3) and direction.dtype == np.float64
    (a, b, c), (d, e, f), (g, h, i) = direction.tolist()
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    assert math.isfinite(determinant) and abs(determinant) > 1e-6
    assert type(source.chunk_layers) is int and 1 <= source.chunk_layers <= source.shape[0]
    no_data = source.no_data
    assert no_data is None or (type(no_data) is float and not math.isnan(no_data))


def check_line(error):
    line = str(error)
    assert line and line.isprintable() and len(line) < 500, repr(line)


def run_fuzz(make, *, seed, num_inputs=None):
    """Judges as_source(*make(fuzzer)) for each input; both outcomes must occur."""
    fuzzer = Fuzzer(seed)
    accepted = refused = 0
    for number in range(num_inputs or NUM_INPUTS):
        made = make(fuzzer)
        if made is None:
            continue  # the package itself refused to make it
        obj, options = made if isinstance(made, tuple) else (made, {})
        try:
            source = as_source(obj, **options)
        except (ArrayValueError, ArrayTypeError) as error:
            check_line(error)
            refused += 1
        except BaseException:
            print(f"seed {seed}, input {number}")
            raise
        else:
            check_invariants(source)
            accepted += 1
            if accepted % 32 == 0:
                read_some(source)
    print(f"{accepted} accepted, {refused} refused")
    assert accepted and refused


def read_some(source):
    """Reads two layers, which must be voxels as promised or one line."""
    try:
        slab = source.read(0, 2)
    except (ArrayValueError, ArrayTypeError) as error:
        check_line(error)
    else:
        assert slab.shape == (2, *source.shape[1:]) and slab.dtype == source.dtype


def fake(package, name, **attributes):
    """A class that looks like one of the package's."""
    return type(name, (Fake,), {"__module__": package, **attributes})


class Fake:
    """Has what it is given, and layers of zeros."""

    def __init__(self, **attributes):
        self.__dict__.update(attributes)

    def __getitem__(self, index):
        return np.zeros(self.shape, self.dtype)[index]


def some_real(fuzzer, make_fake, make_real):
    return (make_real if fuzzer.one_in(REAL_SHARE) else make_fake)(fuzzer)
