"""The choice between the readings of grammar and network, with made-up probabilities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from grounding.language.reader.fields import ACTIONS, CHOICES, NOUNS, QUALIFIERS
from grounding.language.reader.network import Prediction
from grounding.language.reader.revision import Evidence, query_of, revise
from grounding.query import Exclusion, Landmark, Query, Referent

RED_CAR = Referent("car", "car", "red")
QUERY = Query("park behind the red car", "park", ("park",), "behind", landmark="referent", referent=RED_CAR)
RULE = {"status": np.array([0.0, 1.0, 0, 0, 0, 0, 0, 0, 0]), "reading": np.array([0.0, 1.0, 1.0])}
READ, GUESSED = Evidence(), Evidence(dropped=3, doubtful=True)


def predict(
    sure: float = 0.9, qualifiers: tuple[str, ...] = (), actions: tuple[str, ...] = (), **values: str
) -> Prediction:
    """Return a prediction of the query's own values, with others in the place of some."""
    own = {"status": "ok", "action": "park", "relation": "behind", "noun": "car", "colour": "red"} | values
    lists = {**CHOICES, "noun": NOUNS, "colour": ("none", "red", "blue")}
    choices: dict[str, dict[str, float]] = {
        field: dict.fromkeys(names, (1 - sure) / (len(names) - 1)) | {own.get(field, "none"): sure}
        for field, names in lists.items()
    }
    status = values.get("status", "ok")
    choices["status"] = {"ok": 0.1, "reject": 0.1} | {status: 0.9}
    likely = {one: sure if one in qualifiers else 0.01 for one in QUALIFIERS}
    commanded = {one: sure if one in (own["action"], *actions) else 0.01 for one in ACTIONS}
    return Prediction(choices, likely, commanded, "motor")


def test_nothing_changes_where_both_agree() -> None:
    revision = revise(QUERY, GUESSED, predict(), RULE)
    assert (revision.query, revision.changed) == (QUERY, ())


@pytest.mark.parametrize(
    ("field", "value", "before"),
    [
        ("action", "follow", "park"),
        ("relation", "next_to", "behind"),
        ("direction", "left", "none"),
        ("noun", "van", "car"),
        ("colour", "blue", "red"),
    ],
)
def test_the_network_changes_one_field(field: str, value: str, before: str) -> None:
    revision = revise(QUERY, GUESSED, predict(0.9, (), (), **{field: value}), RULE)
    assert revision.changed == ((field, before, value),)
    changed = revision.query.referent if field in ("noun", "colour") else revision.query
    assert getattr(changed, field) == value


def test_the_reading_of_the_grammar_gains_where_it_understood_the_words() -> None:
    def changes(ratio: float, evidence: Evidence) -> bool:
        prediction = predict(relation="next_to")
        shares = {**prediction.choices["relation"], "behind": 0.9 / ratio}
        torn = replace(prediction, choices={**prediction.choices, "relation": shares})
        return bool(revise(QUERY, evidence, torn, RULE).changed)

    left_out, negated = Evidence(dropped=1), READ._replace(contrary=True)
    assert [changes(1.5, one) for one in (READ, left_out, GUESSED)] == [False, False, True]
    assert [changes(5.0, one) for one in (READ, left_out, GUESSED)] == [False, True, True]
    assert [changes(50.0, one) for one in (READ, left_out, negated)] == [True, True, False]


def test_an_action_that_the_network_does_not_see_is_dropped() -> None:
    query = Query(
        "park behind the red car, two mins", "park", ("park", "wait"), "behind", landmark="referent", referent=RED_CAR
    )
    revision = revise(query, READ, predict(), RULE)
    assert (revision.query.actions, revision.changed) == (("park",), (("actions", "park wait", "park"),))
    assert revise(query, READ, predict(actions=("wait",)), RULE).query.actions == ("park", "wait")
    # The main action stays, however unlikely.
    assert revise(query, READ, predict(0.2), RULE).query.action == "park"


def test_an_unsure_network_changes_nothing() -> None:
    assert revise(QUERY, READ, predict(sure=0.15, relation="next_to"), RULE).changed == ()


def test_actions_head_and_landmark_follow() -> None:
    query = revise(QUERY, GUESSED, predict(action="follow", relation="none", noun="van"), RULE).query
    assert (query.actions, query.landmark) == (("follow",), None)
    assert query.referent is not None
    assert query.referent.head == "motor"
    bare = Query("park", "park", ("park",), unresolved="one")
    query = revise(bare, GUESSED, predict(), RULE).query
    assert (query.referent, query.landmark, query.unresolved) == (Referent("car", "motor", "red"), "referent", "")
    sought = Query("behind the red one", "park", ("park",), "behind", unresolved="one", sought=RED_CAR)
    assert revise(sought, READ, predict(), RULE).changed == ()
    assert revise(sought, GUESSED, predict(), RULE).query.referent == Referent("car", "motor", "red")
    assert revise(QUERY, GUESSED, predict(noun="none", colour="none"), RULE).query.referent is None


def test_qualifiers() -> None:
    assert revise(QUERY, READ, predict(qualifiers=("nearest",)), RULE).changed == ()
    revision = revise(QUERY, GUESSED, predict(qualifiers=("nearest", "parked")), RULE)
    assert revision.changed == (("qualifiers", "none", "nearest parked"),)
    assert revise(revision.query, READ, predict(qualifiers=("nearest", "parked")), RULE).changed == ()


def test_an_excluded_vehicle_is_never_chosen() -> None:
    query = Query("the red car, not the blue one", "park", ("park",), referent=RED_CAR)
    blue = predict(relation="none", colour="blue")
    assert revise(query, GUESSED, blue, RULE).changed == (("colour", "red", "blue"),)
    excluding = Query(query.command, "park", ("park",), referent=RED_CAR, excluded=(Exclusion(None, "car", "blue"),))
    assert revise(excluding, GUESSED, blue, RULE).changed == ()


def test_commands_and_others() -> None:
    nothing = revise(QUERY, READ, predict(status="reject"), RULE)
    assert nothing.query == Query(QUERY.command)
    assert nothing.changed == (("status", "ok", "reject"),)
    accepting = RULE | {"status": np.array([1.0, 1.0, 0, 0, 0, 0, 0, 0, 0])}
    found = revise(Query(QUERY.command), GUESSED, predict(qualifiers=("last",)), accepting)
    assert found.changed == (("status", "reject", "ok"),)
    assert found.query.referent == Referent("car", "motor", "red", ("last",))
    assert (found.query.action, found.query.relation, found.query.landmark) == ("park", "behind", "referent")
    assert 0.3 < found.sure < 0.6
    assert query_of("x", predict(status="reject")).action is None


def test_what_both_say_is_never_doubted() -> None:
    assert revise(QUERY, GUESSED, predict(0.4), RULE).query.relation == "behind"


def test_a_negated_sentence_gets_no_further_qualifier() -> None:
    negated = READ._replace(contrary=True)
    assert revise(QUERY, negated, predict(qualifiers=("right_side", "nearest", "parked")), RULE).changed == ()


def test_a_person_beside_the_vehicle_is_meant() -> None:
    beside = (Landmark("guy", "near", "inverse"),)
    query = Query(
        "next to the guy by the red car", "stop", ("stop",), "next_to", landmark="referent", referent=RED_CAR
    )
    person = predict(action="stop", relation="next_to", noun="person", colour="none")
    found = revise(replace(query, secondary=beside), GUESSED, person, RULE).query
    assert found.referent == Referent("person", "guy")
    assert found.secondary == (Landmark("car", "near", "referent", "red"),)
