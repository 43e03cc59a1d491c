import json


def test_check_searches_as_often_as_it_is_told_and_prints_what_it_found(call, small_specification):
    status, out, _ = call(
        "check", small_specification, "--adversary", "search", "--games", 2, "--desired", "cruise", "--json"
    )
    assert status == 0
    found = json.loads(out)
    assert list(found) == ["cruise"]
    assert found["cruise"]["games"] == 2
    assert found["cruise"]["rollouts"] == 2 * 48 * 6


def test_a_bicycle_is_searched_for_as_such(call, small_specification):
    options = ("--games", 1, "--desired", "steering_at_the_car", "--json")
    reports = [json.loads(call("check", small_specification, *options, *more)[1]) for more in ((), ("--bicycle",))]
    plain, bicycle = (report["steering_at_the_car"] for report in reports)
    assert (plain["settings"]["bicycle"], bicycle["settings"]["bicycle"]) == (False, True)
    assert plain["least_target"] != bicycle["least_target"]


def test_what_check_cannot_do_is_said_in_one_sentence(call, small_specification):
    for options, said in (
        (["--adversary", "luck"], "--adversary luck is not known; there is: search"),
        (["--desired", "fly"], "--desired fly is not known; choose from cruise"),
        (["--above", 3], "--above 3 and --up-to 2.5 leave no V to start from"),
    ):
        status, out, messages = call("check", small_specification, *options)
        assert status == 2
        assert said in " ".join(messages.split())
        assert not out
