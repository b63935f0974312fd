import pytest

from wrist_stiffness.report import comparison_report


@pytest.mark.parametrize(
    ("share", "text"), [(None, "-"), (0.884, "88 %"), (1.0, "all"), (2.39, "all"), (-0.2, "-20 %")]
)
def test_a_share_is_never_more_than_all(share, text):
    assert comparison_report._share(share) == text
