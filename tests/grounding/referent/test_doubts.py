from __future__ import annotations

from street import RED, WHITE, Street

from grounding.query import Query, Referent
from grounding.referent.doubts import question_about
from grounding.referent.resolver import Resolution, resolve
from grounding.referent.scene import SceneModel
from grounding.vocabulary import Action


def ask(scene: SceneModel, action: Action = "park", qualifiers: tuple[str, ...] = ()) -> Resolution:
    query = Query(
        "", action, relation="behind", landmark="referent", referent=Referent("car", "car", "red", qualifiers)
    )
    return resolve(query, scene)


def test_a_vehicle_behind_us_is_asked_about() -> None:
    scene = Street().car("behind", -14, -3, RED).scene()
    found = ask(scene)
    assert found.status == "ambiguous"
    assert found.question.startswith("there is no red car ahead, only one behind us: do you mean the red car")
    assert [one.item.id for one in found.candidates] == ["behind"]
    assert ask(scene, qualifiers=("behind_ego",)).status == "ok"


def test_a_vehicle_ahead_is_taken() -> None:
    scene = Street().car("behind", -14, -3, RED).car("ahead", 14, -4, RED).scene()
    found = ask(scene)
    assert (found.status, found.candidates[0].item.id) == ("ok", "ahead")


def test_an_unresolved_pronoun_is_asked_about() -> None:
    scene = Street().car("a", 10, -4, RED).car("b", 20, -4, WHITE).scene()
    found = resolve(Query("", "stop", relation="next_to", unresolved="it"), scene)
    assert found.status == "ambiguous"
    assert {one.item.id for one in found.candidates} == {"a", "b"}
    one = resolve(Query("", "stop", relation="next_to", unresolved="it"), Street().car("a", 10, -4, RED).scene())
    assert (one.status, len(one.candidates)) == ("ambiguous", 1)


def test_a_class_that_does_not_fit_is_asked_about() -> None:
    scene = Street().car("a", 14, -4, RED).scene()
    scored = {"lorry": 0.2, "red": 1.0}
    lorry = Referent("truck", "lorry", "red")
    query = Query("", "park", relation="behind", landmark="referent", referent=lorry)
    assert question_about(query, lorry, 0, scored, scene).startswith("no lorry is seen: do you mean the red car")
    assert question_about(query, lorry, 0, scored | {"lorry": 1.0}, scene) == ""
