"""What excludes what: every row is refused in its own sentence, in either order, and nothing else is."""

import pytest

from warpimpact.scene.exclusions import EXCLUDED, NEEDS, check_together


def test_a_pair_is_refused_in_either_order_and_nothing_else_is() -> None:
    for rule, middle in (
        *((rule, " cannot be combined with ") for rule in EXCLUDED),
        *((rule, " needs ") for rule in NEEDS),
    ):
        got = middle == " needs "
        with pytest.raises(ValueError, match=middle):
            check_together({rule.other: not got, rule.what: True})
        check_together({rule.what: True, rule.other: got})
        check_together({rule.what: True})
