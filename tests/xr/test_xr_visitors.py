"""What the terminal says of pages that come and go."""

from xr_client.visitors import Visitors


def said(visitors: Visitors, *looks: tuple[int, bool, str, float]) -> list[str]:
    return [line for look in looks for line in visitors.look(*look)]


def test_a_page_comes_and_goes():
    visitors = Visitors()
    assert said(visitors, (0, False, "", 0.0), (1, True, "", 10.0)) == []
    assert said(visitors, (1, True, "Quest 3", 10.1)) == ["a page has connected: Quest 3"]
    assert said(visitors, (1, True, "Quest 3", 50.0)) == []
    assert said(visitors, (1, False, "", 73.0), (1, False, "", 74.0)) == ["the page has gone after 63 s"]


def test_another_one_that_takes_over_between_two_looks():
    visitors = Visitors()
    said(visitors, (1, True, "Quest 3", 0.0))
    assert said(visitors, (2, True, "PICO 4", 5.0)) == [
        "the page has gone after 5 s",
        "a page has connected: PICO 4",
    ]


def test_a_page_that_says_nothing_of_itself():
    visitors = Visitors()
    assert said(visitors, (1, True, "", 0.0), (1, True, "", 0.9)) == []
    assert said(visitors, (1, True, "", 1.1), (1, True, "", 1.2)) == [
        "a page has connected: it does not say on what device"
    ]
