from __future__ import annotations

from grounding.confidence import Evidence, confidence_of, is_worth_acting

CLEAR = Evidence(margin=4.0, fit=0.0, goal=0.0, exact=1.0, changed=0.0)


def test_less_evidence_gives_less_confidence() -> None:
    best = confidence_of(CLEAR)
    weaker = [
        CLEAR._replace(margin=0.0),
        CLEAR._replace(fit=-2.0),
        CLEAR._replace(goal=-2.0),
        CLEAR._replace(exact=0.0),
        CLEAR._replace(changed=2.0),
    ]
    assert 0.9 < best < 1
    assert all(0 < confidence_of(one) < best for one in weaker)


def test_a_goal_that_is_more_likely_wrong_than_right_is_asked_about() -> None:
    assert is_worth_acting(0.6)
    assert not is_worth_acting(0.4)
