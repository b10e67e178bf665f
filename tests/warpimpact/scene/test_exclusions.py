"""What excludes what: every row is refused in its own sentence, in either order, and nothing else is."""

import pytest

from warpimpact.scene.exclusions import EXCLUDED, NEEDS, Rule, check_together


@pytest.mark.parametrize("rule", EXCLUDED, ids=lambda rule: f"{rule.what}, {rule.other}")
def test_what_excludes_is_refused(rule: Rule) -> None:
    with pytest.raises(ValueError, match="cannot be combined with found here: ") as refused:
        check_together({rule.other: "found here", rule.what: True})
    assert str(refused.value) == f"{rule.what} cannot be combined with found here: {rule.why}"
    check_together({rule.what: True, rule.other: False})
    check_together({rule.other: True})


@pytest.mark.parametrize("rule", NEEDS, ids=lambda rule: f"{rule.what}, {rule.other}")
def test_what_is_needed_is_asked_for(rule: Rule) -> None:
    with pytest.raises(ValueError, match="found here needs ") as refused:
        check_together({rule.what: "found here", rule.other: False})
    assert str(refused.value) == f"found here needs {rule.other}: {rule.why}"
    check_together({rule.what: True, rule.other: True})
    check_together({rule.what: True})  # what is not named is not judged
