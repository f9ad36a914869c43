"""Compares how numpy, chumpy and scipy objects are read from pickles with the arrays that were pickled."""

import pickle
import time
import tracemalloc
import unittest

import numpy as np
import support  # first of ours: it sets the path
from pickled_arrays import array, matrix
from restricted_pickle import BrokenPickle, load

RNG = np.random.default_rng(7)
PLAIN = [
    RNG.normal(size=(3, 4)),
    RNG.normal(size=(2, 3, 4)).astype(np.float32),
    np.asfortranarray(RNG.normal(size=(3, 4))),
    RNG.integers(0, 2**32, size=(2, 5), dtype=np.uint32),
    RNG.integers(-9, 9, size=7, dtype=np.int64),
    np.array([True, False]),
    np.arange(4, dtype=">f8"),
    np.float64(2.5),
    np.zeros((0, 3)),
    RNG.normal(size=(4, 4))[::2, 1:],
]


def read(data):
    return load(data, "test.pkl")


def sparse_pickle(kind, state, protocol=2):
    """Pickles a scipy matrix under the module name that old versions of scipy used."""
    with support.foreign_classes((f"scipy.sparse.{kind}.{kind}_matrix", object)) as made:
        value = getattr(made, f"{kind}_matrix")()
        value.__dict__.update(state)
        return support.python2_pickle(value, protocol)


class NumpyTest(unittest.TestCase):
    def test_arrays_of_every_protocol(self):
        for protocol in range(2, 6):
            for i, (record, expected) in enumerate(zip(read(pickle.dumps(PLAIN, protocol)), PLAIN)):
                with self.subTest(protocol=protocol, i=i):
                    result = array(record, "x")
                    np.testing.assert_array_equal(result, expected)
                    self.assertEqual((result.dtype, result.shape), (expected.dtype, expected.shape))

    def test_arrays_of_python2(self):
        for protocol in (0, 1, 2):
            for i, (record, expected) in enumerate(zip(read(support.python2_pickle(PLAIN, protocol)), PLAIN)):
                with self.subTest(protocol=protocol, i=i):
                    np.testing.assert_array_equal(array(record, "x"), expected)

    def test_lists_of_arrays_and_numbers(self):
        value = [[1, 2], [3, 4]], [np.eye(2), 2 * np.eye(2)], 1.5
        pairs, stacked, number = read(pickle.dumps(value, 2))
        np.testing.assert_array_equal(array(pairs, "x"), value[0])
        np.testing.assert_array_equal(array(stacked, "x"), value[1])
        self.assertEqual(array(number, "x"), 1.5)

    def test_lists_that_hold_each_other_many_times(self):
        """Pickles of some hundred bytes that describe tables of billions, or that never end."""
        laughs = [1.0] * 10
        for _ in range(40):
            laughs = [laughs] * 10
        large = np.zeros(1 << 20)
        endless = [1.0]
        endless.append(endless)
        for name, value in (("lists", laughs), ("one array, many times", [large] * 100), ("itself", endless)):
            with self.subTest(name):
                data = pickle.dumps(value, 2)
                tracemalloc.start()
                started = time.process_time()
                self.assertRaisesRegex(BrokenPickle, "no known file has such a list", array, read(data), "x")
                self.assertLess(time.process_time() - started, 10.0)
                self.assertLess(tracemalloc.get_traced_memory()[1], 2 * len(data) + 10_000_000)
                tracemalloc.stop()
        record = read(pickle.dumps(np.zeros(2), 2))
        record.state[2].args = (laughs,)
        self.assertRaisesRegex(BrokenPickle, "has dtype a list, expected", array, record, "x")
        deep = [1.0]
        for _ in range(5_000):
            deep = [deep]
        self.assertRaisesRegex(BrokenPickle, "too deep", array, deep, "x")

    def test_values_that_are_not_arrays(self):
        objects = np.array([None, {}], dtype=object)
        for value, message in (
            (objects, "dtype 'O8'"),
            (np.array(["text"]), "dtype 'U4'"),
            (np.zeros(2, dtype=[("a", "f4")]), "dtype 'V4'"),
            ("text", "is a str"),
            (None, "is a NoneType"),
            ([np.eye(2), np.eye(3)], "not a rectangular table"),
            ([2**70], "not a rectangular table"),
            ({1, 2}, "is a set"),
            (np.random.default_rng, "is a Global"),
        ):
            with self.subTest(message=message), self.assertRaisesRegex(BrokenPickle, f"field.*{message}"):
                array(read(pickle.dumps(value, 4)), "field")

    def test_shapes_that_do_not_match_the_data(self):
        data = pickle.dumps(np.arange(6.0), 2)
        self.assertIn(b"K\x06\x85", data)
        for lie in (b"K\x05\x85", b"J\xff\xff\xff\x7f\x85", b"J\xff\xff\xff\xff\x85"):
            with self.subTest(lie=lie), self.assertRaises(BrokenPickle):
                array(read(data.replace(b"K\x06\x85", lie)), "field")


class ChumpyTest(unittest.TestCase):
    def test_stored_numbers(self):
        with support.foreign_classes(("chumpy.ch.Ch", object)) as made:
            value = made.Ch()
            value.x, value._dirty_vars, value._itr = PLAIN[0], set(), None
            data = [support.python2_pickle(value, protocol) for protocol in (0, 1, 2)] + [pickle.dumps(value, 2)]
        for pickled in data:
            np.testing.assert_array_equal(array(read(pickled), "x"), PLAIN[0])

    def test_computed_arrays_are_refused(self):
        with support.foreign_classes(("chumpy.ch.Ch", object), ("chumpy.ch_ops.add", object)) as made:
            computed, sum_of_two = made.Ch(), made.add()
            computed.y = 1
            data = pickle.dumps([computed, sum_of_two], 2)
        first, second = read(data)
        with self.assertRaisesRegex(BrokenPickle, "without stored numbers"):
            array(first, "field")
        with self.assertRaisesRegex(BrokenPickle, "chumpy.ch_ops.add, expected an array"):
            array(second, "field")


    def chumpy_pickle(self, make):
        """Pickles what `make` returns, to which it is given a function that makes a chumpy array of some numbers."""
        with support.foreign_classes(("chumpy.ch.Ch", object)) as made:

            def chumpy(numbers=None):
                record = made.Ch()
                record.x = numbers
                return record

            return pickle.dumps(make(chumpy), 2)

    def test_chumpy_arrays_that_hold_each_other(self):
        """Each holds the next in a list of one: a walk that looks at each list twice takes 2^24 steps."""

        def nested(chumpy):
            value = 1.0
            for _ in range(24):
                value = [chumpy(value)]
            return value

        started = time.process_time()
        self.assertEqual(array(read(self.chumpy_pickle(nested)), "x").shape, (1,) * 24)
        self.assertLess(time.process_time() - started, 5.0)

    def test_chumpy_arrays_without_an_end(self):
        def itself(chumpy):
            record = chumpy()
            record.x = record
            return record

        with self.assertRaisesRegex(BrokenPickle, "no known file has such a list"):
            array(read(self.chumpy_pickle(itself)), "x")
        chain = b"cchumpy.ch\nCh\nq\x00)\x81}X\x01\x00\x00\x00x"
        data = b"\x80\x02" + chain * 5_000 + b"K\x01" + b"sb" * 5_000 + b"."
        with self.assertRaisesRegex(BrokenPickle, "too deep in each other"):
            array(read(data), "x")

    def test_shapes_that_are_no_sizes(self):
        good = np.zeros((2, 3))
        record = read(pickle.dumps(good, 2))
        for shape in ((1 << 70, 0), (-1, 2), ("2", 3), (1,) * 9, ((1 << 2000),) * 100_000):
            record.state = (1, shape, *record.state[2:])
            with self.assertRaisesRegex(BrokenPickle, "expected up to 8 sizes") as caught:
                array(record, "x")
            self.assertLess(len(str(caught.exception)), 200)


class ScipyTest(unittest.TestCase):
    # The matrix [[0, 1, 0], [2, 0, 3]] in the three layouts, written by hand.
    DENSE = np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 3.0]])
    CSC = {"data": np.array([2.0, 1.0, 3.0]), "indices": np.array([1, 0, 1]), "indptr": np.array([0, 1, 2, 3])}
    CSR = {"data": np.array([1.0, 2.0, 3.0]), "indices": np.array([1, 0, 2]), "indptr": np.array([0, 1, 3])}
    COO = {"data": np.array([1.0, 2.0, 2.0, 1.0]), "row": np.array([0, 1, 1, 1]), "col": np.array([1, 0, 2, 2])}

    def test_layouts(self):
        for kind, state in (("csc", dict(self.CSC)), ("csr", dict(self.CSR)), ("coo", dict(self.COO))):
            for protocol in (0, 2):
                with self.subTest(kind=kind, protocol=protocol):
                    state |= {"_shape": (2, 3), "format": kind, "maxprint": 50}
                    record = read(sparse_pickle(kind, state, protocol))
                    np.testing.assert_array_equal(matrix(record, "x"), self.DENSE)

    def test_broken_tables(self):
        good = self.CSC | {"_shape": (2, 3)}
        for change, message in (
            ({"_shape": (2**20, 2**20)}, "shape"),
            ({"_shape": (2, np.array([1, 2]))}, "expected a whole number"),
            ({"_shape": (2, 3.0)}, "expected a whole number"),
            ({"_shape": (2,) * 100_000}, "of 100000 parts, expected two sizes"),
            ({"_shape": (2, 4)}, "indptr"),
            ({"_shape": (1, 3)}, "row index"),
            ({"indices": np.array([1, 0, -1])}, "row index"),
            ({"indices": np.array([1, 0])}, "too few"),
            ({"indptr": np.array([0, 2, 1, 3])}, "indptr"),
            ({"indptr": np.array([0, 1, 2, 9])}, "indptr"),
            ({"data": np.ones((3, 1))}, "axes"),
        ):
            with self.subTest(change=change), self.assertRaisesRegex(BrokenPickle, message):
                matrix(read(sparse_pickle("csc", good | change)), "field")
        del good["indptr"]
        with self.assertRaisesRegex(BrokenPickle, "without 'indptr'"):
            matrix(read(sparse_pickle("csc", good)), "field")


if __name__ == "__main__":
    unittest.main()
