"""Arrow columns made of NumPy's memory and read back, against pyarrow's own way."""

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hj_cosim.recording.columns import name_column, name_numbers, numbers_of, numeric_column

KINDS = ("bool", "int8", "int32", "int64", "uint16", "float32", "float64")


@settings(max_examples=40)
@given(st.sampled_from(KINDS).flatmap(lambda kind: arrays.arrays(kind, st.integers(0, 40))), st.integers(0, 12))
def test_numbers_come_back_as_pyarrow_reads_them_from_any_place_on(values, start):
    column = numeric_column(values)[start:]
    for given_as in (column, pa.chunked_array([column, column], column.type)):
        back = numbers_of(given_as)
        whole = given_as if isinstance(given_as, pa.Array) else given_as.combine_chunks()
        np.testing.assert_array_equal(back, whole.to_numpy(zero_copy_only=False))
        assert back.dtype == values.dtype


def test_no_chunks_are_no_numbers():
    assert numbers_of(pa.chunked_array([], pa.float64())).shape == (0,)
    assert numbers_of(pa.chunked_array([], pa.bool_())).shape == (0,)


@pytest.mark.parametrize("start", [0, 1, 9])
def test_names_come_back_as_their_numbers_and_nobody_as_what_is_asked_for(start):
    numbers = np.array([2, -1, 0, 1, 1, -5, 0, 2, 2, -1, 1])
    column = name_column(numbers, ("a", "b", "c"))[start:]
    assert [None if each is None else "abc".index(each) for each in column.to_pylist()] == [
        None if number < 0 else number for number in numbers[start:]
    ]
    np.testing.assert_array_equal(name_numbers(column, -7), np.where(numbers < 0, -7, numbers)[start:])
    known = name_column(np.array([1, 0, 2]), ("a", "b", "c"))
    np.testing.assert_array_equal(name_numbers(known, -7), [1, 0, 2])
