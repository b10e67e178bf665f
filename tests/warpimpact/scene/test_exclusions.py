"""What excludes what: every row is refused in its own sentence, in either order, and nothing else is."""

import pytest

from warpimpact.scene.exclusions import EXCLUDED, NEEDS, check_together


def test_a_pair_is_refused_in_either_order_and_nothing_else_is() -> None:
    for rules, middle in ((EXCLUDED, " cannot be combined with "), (NEEDS, " needs ")):
        for what, other, _ in rules:
            is_needed = rules is NEEDS
            with pytest.raises(ValueError, match=middle):
                check_together({other: not is_needed, what: True})
            check_together({what: True, other: is_needed})
            check_together({what: True})
