"""What an operator reads in VR, as data: states in, words out."""

from typing import Any

import pytest
from picture_rig import FINE, LINKED, Rig, arm, hud

pytest_plugins = ["picture_fixtures"]


def words(rig: Rig, shown: Any, link: Any = LINKED, video: Any = FINE) -> dict[str, Any]:
    return rig.js("state => rig.modules.hudText(state)", {"hud": shown, "link": link, "video": video})


def test_what_is_said_of_a_missing_or_old_picture(used_rig):
    def notice(video, age, note=""):
        state = {"hud": hud(note=note), "link": LINKED, "video": video}
        return used_rig.js("([state, age]) => rig.modules.pictureNotice(state, age)", [state, age])

    gone = {"open": False, "reason": "ik-xr has ended", "fps": 0, "shownMs": None}
    assert notice(FINE, 30.0) == notice(gone, 900.0) == notice(FINE, 30.0, "the robot is far") == []
    assert notice(gone, None) == ["no picture from the robot", "ik-xr has ended"]
    assert notice(FINE, None) == ["no picture from the robot", "connected, but no image has come yet"]
    assert notice(FINE, None, "no pictures: nobody publishes")[1] == "nobody publishes"
    assert (
        notice(FINE, 1e4, "the robot sends no pictures: it has no eyes")[1]
        == "the robot sends no pictures: it has no eyes"
    )
    assert notice(FINE, None, "the robot is far")[1] == "connected, but no image has come yet"
    assert notice(FINE, 3700.0) == ["picture is 3 s old", "the robot sends no new ones"]
    assert notice(gone, 61e3, "the robot is far") == ["picture is 61 s old", "ik-xr has ended"]
    assert notice(None, None)[1]


@pytest.mark.parametrize(
    ("state", "word", "tone", "advice"),
    [
        ("disarmed", "disarmed", "idle", "grip again"),
        ("aligning", "engaging", "wait", "keep the grip"),
        ("hold", "holding", "wait", "grip again"),
        ("fault", "fault", "bad", "clear the fault"),
        ("active", "active", "good", ""),
        ("dreaming", "dreaming", "bad", ""),
    ],
)
def test_the_panel_names_state_reason_and_what_to_do(used_rig, state, word, tone, advice):
    reason = "" if state == "active" else "the hand is stale"
    for side, said_of in enumerate((hud(left=arm(state, reason=reason)), hud(right=arm(state, reason=reason)))):
        said = words(used_rig, said_of)["arms"][side]
        assert said["name"] == ("left arm", "right arm")[side]
        assert (said["state"], said["tone"]) == (word, tone)
        assert said["detail"]["text"].startswith(reason)
        assert advice in said["detail"]["text"]


def test_the_panel_shows_distance_warning_note_and_latencies(used_rig):
    near = arm(position_error_mm=3.4)
    far = arm(position_error_mm=84.0, warning="8 cm at the edge of what the arm reaches")
    said = words(
        used_rig, hud(near, far, note="the robot is in fault", headset=12.3, service=0.4, video=34.4, wait=None)
    )
    assert said["arms"][0]["figure"] == "3 mm from target"
    assert said["arms"][1]["detail"] == {"text": "8 cm at the edge of what the arm reaches", "tone": "wait"}
    assert said["note"] == {"text": "the robot is in fault", "tone": "wait"}
    assert said["footer"] == "poses 12 ms  ·  service <1 ms  ·  picture 34 ms  ·  30 images/s"
    # The reason that says already what to do is left alone, and a distance counts while an arm follows only.
    said = words(used_rig, hud(arm("disarmed", reason="not engaged: grip to engage", position_error_mm=3.0)))["arms"][0]
    assert (said["detail"]["text"], said["figure"]) == ("not engaged: grip to engage", "")
    assert words(used_rig, hud(arm("disarmed")))["arms"][0]["detail"]["text"] == "grip to engage"


def test_without_a_connection_nothing_old_is_shown(used_rig):
    closed = {"open": False, "reason": "ik-xr has ended"}
    said = words(used_rig, hud(arm("active"), headset=12.0), link=closed)
    assert [shown["state"] for shown in said["arms"]] == ["not known", "not known"]
    assert said["note"] == {"text": "no connection to ik-xr: ik-xr has ended", "tone": "bad"}
    assert "poses" not in said["footer"]
    assert words(used_rig, None, link=None, video=None)["note"]["tone"] == "bad"
    assert "waiting" in words(used_rig, None)["note"]["text"]


def test_lines_break_between_words_and_end_where_there_is_no_room(used_rig):
    assert used_rig.js("rig.modules.wrap('aa bb cc dd', 5, 2, (text) => text.length)") == ["aa bb", "cc dd"]
    assert used_rig.js("rig.modules.wrap('aa bb cc dd', 5, 1, (text) => text.length)") == ["aa bb cc dd"]
    assert used_rig.js("rig.modules.wrap('', 5, 2, (text) => text.length)") == []
    assert used_rig.js("rig.modules.cut('aa bb cc', 6, (text) => text.length)") == "aa bb…"
    assert used_rig.js("rig.modules.cut('aa bb', 6, (text) => text.length)") == "aa bb"
