"""Numbers as a person reads them."""

from math import nan

import pytest

from wrist_stiffness.numerals import number


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.123456, 3, "0.123"),
        (12.345, 3, "12.3"),
        (214.4, 2, "214"),
        (-999.6, 3, "-1000"),
        (123456.7, 3, "123457"),
        (1.234e7, 3, "1.23e+07"),
        (1.234e-7, 3, "1.23e-07"),
        (0.0, 3, "0"),
        (nan, 3, "-"),
    ],
)
def test_a_number_has_no_exponent_where_a_person_writes_none(value, digits, text):
    assert number(value, digits) == text
