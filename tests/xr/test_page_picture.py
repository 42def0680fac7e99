"""What is drawn in VR: pixels read back in a browser, and where they must be by the poses."""

import math

import numpy as np
import pytest
from picture_rig import AHEAD, BLUE, EYE, SEES, WHITE, arm, hud, in_view, room, seen_at

pytest_plugins = ["picture_fixtures"]


def test_newest_wins_and_what_it_replaces_is_closed(rig):
    widths = rig.js(
        """async () => {
          const shown = [];
          for (const seq of [1, 2, 3]) shown.push(...(await rig.show(seq, "red", "blue")));
          return [rig.draw(), rig.draw(), ...shown.map((image) => image.width)];
        }"""
    )
    assert widths == [3, None, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(("fov", "width", "height"), [(60.0, 640, 480), (40.0, 320, 320), (0.0, 640, 480)])
def test_the_screen_fills_the_angle_that_the_camera_saw(rig, fov, width, height):
    rig.show(fovDeg=fov, width=width, height=height)
    rig.draw()
    top = 2.0 * math.tan(math.radians(0.5 * (fov or 75.0)))
    side = top * width / height
    for part, inside in ((0.97, True), (1.03, False)):
        for point in ((side * part, 1.6, -2.0), (-side * part, 1.6, -2.0), (0.0, 1.6 + top * part, -2.0)):
            assert (rig.pixel(point)[0] > 150) == inside


def test_the_screen_stands_still_in_the_room_when_the_head_moves(rig):
    first = room((0.3, 1.5, 0.2), yaw=0.5, pitch=-0.3, roll=0.2)
    rig.look(first)
    rig.show(left=WHITE, right=WHITE, fovDeg=40.0)
    rig.draw()
    # Level, where the head looked at first: neither its pitch nor its roll counts.
    level = room((0.3, 1.5, 0.2), yaw=0.5)
    top = 2.0 * math.tan(math.radians(20.0))
    side = top * 4 / 3
    for head in (first, room((0.2, 1.6, 0.4), yaw=0.2, pitch=0.1), room((0.5, 1.4, 0.0), yaw=0.9, roll=-0.4)):
        rig.look(head)
        rig.draw()
        for corner in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
            for part, inside in ((0.95, True), (1.05, False)):
                point = level @ [part * side * corner[0], part * top * corner[1], -2.0, 1.0]
                where = seen_at(head, point[:3])
                # Below the screen is the panel.
                if in_view(where) and (inside or corner[1] > 0):
                    assert (rig.pixel(point[:3], head)[0] > 150) == inside


def test_recentring_places_it_where_the_head_looks_next(rig):
    rig.show(left=WHITE, right=WHITE, fovDeg=40.0)
    rig.draw()
    turned = room(yaw=1.2, pitch=0.1)
    rig.look(turned)
    rig.draw()
    middle = (room(yaw=1.2) @ [0, 0, -2, 1])[:3]
    assert rig.pixel(middle, turned)[0] < 50
    # A frame without a head leaves all where it is, and takes none of the order.
    rig.js("rig.stage.recenter(); rig.kept = rig.head; rig.head = null; rig.draw()")
    assert rig.pixel(middle, turned)[0] < 50
    rig.js("rig.head = rig.kept; rig.draw()")
    assert rig.pixel(middle, turned)[0] > 150


@pytest.mark.parametrize("pitch", [-1.5, 1.5])
def test_a_head_that_looks_at_floor_or_ceiling_has_a_front(rig, pitch):
    rig.look(room(yaw=0.8, pitch=pitch))
    rig.show(left=WHITE, right=WHITE, fovDeg=40.0)
    rig.draw()
    ahead = room(yaw=0.8)
    rig.look(ahead)
    rig.draw()
    assert rig.pixel((ahead @ [0, 0, -2, 1])[:3], ahead)[0] > 150


def test_in_mode_head_it_follows_the_head(rig):
    rig.js("rig.stage.mode = 'head'; 0")
    rig.show(left=WHITE, right=WHITE, fovDeg=40.0)
    for head in (room(), room((1.0, 1.2, 0.5), yaw=2.0, pitch=0.7, roll=0.5)):
        rig.look(head)
        rig.draw()
        seen = rig.picture()
        middle = np.tan(np.radians(20.0)) / np.tan(0.5 * SEES) * EYE / 2
        inside, outside = int(EYE / 2 - 0.95 * middle), int(EYE / 2 - 1.05 * middle)
        assert seen[inside, EYE // 2, 0] > 150 > 50 > seen[outside, EYE // 2, 0]
    # Back in the room, it is where the head looks then.
    rig.js("rig.stage.mode = 'screen'; 0")
    rig.draw()
    level = room((1.0, 1.2, 0.5), yaw=2.0)
    rig.look(level)
    rig.draw()
    assert rig.pixel((level @ [0, 0, -2, 1])[:3], level)[0] > 150


def test_without_an_image_the_screen_says_so(rig):
    rig.draw()
    seen = rig.picture()
    middle = seen[EYE // 2 - 12 : EYE // 2 + 12, 60:260, :3]
    assert (middle.min(axis=2) > 150).any(), "no letters"
    screen, void = rig.pixel((1.0, 2.6, -2.0)), rig.pixel((0.0, 3.4, -2.0))
    assert void[2] < screen[2] < 80


def test_an_old_picture_is_dimmed_and_its_age_said(rig):
    rig.show(left=WHITE, right=WHITE)
    rig.say(hud())
    corner = (1.0, 2.4, -2.0)
    rig.draw()
    assert rig.pixel(corner)[0] == pytest.approx(200, abs=3)
    rig.draw(950.0)
    assert rig.pixel(corner)[0] == pytest.approx(200, abs=3)
    assert rig.pixel(AHEAD)[0] == pytest.approx(200, abs=3)
    rig.draw(200.0)
    assert rig.pixel(corner)[0] < 100
    rig.show(seq=2, left=WHITE, right=WHITE)
    rig.draw(200.0)
    assert rig.pixel(corner)[0] == pytest.approx(200, abs=3)


def test_the_panel_is_below_the_screen_the_same_for_both_eyes_and_large_enough(rig):
    rig.show(fovDeg=40.0)
    rig.say(hud(arm("fault", reason="HHHH"), arm("active")))
    down = room(pitch=-0.5)
    rig.draw()  # placed for the level head
    rig.look(down)
    rig.draw(200.0)
    left, right = rig.picture("left"), rig.picture("right")
    edge = int(seen_at(down, (0.0, 1.6 - 2.0 * math.tan(math.radians(20.0)), -2.0))[1]) + 2
    panel = left[edge:]
    assert np.array_equal(panel, right[edge:])
    reddish = panel[..., 0] > panel[..., 1] + 60
    greenish = panel[..., 1] > panel[..., 0] + 60
    assert reddish[:, : EYE // 2].sum() > 15
    assert greenish[:, EYE // 2 :].sum() > 15
    assert not reddish[:, EYE // 2 :].any()
    assert not greenish[:, : EYE // 2].any()


def test_the_smallest_letters_are_a_degree_high(used_rig):
    degrees = used_rig.js(
        """async () => {
          const { TEXT, WIDTH } = await import("./hud_panel.js");
          const { PANEL_DISTANCE, PANEL_WIDTH } = await import("./placement.js");
          const { FAMILY } = await import("./text_canvas.js");
          const paint = document.createElement("canvas").getContext("2d");
          paint.font = `${TEXT}px ${FAMILY}`;
          const height = (paint.measureText("H").actualBoundingBoxAscent * PANEL_WIDTH) / WIDTH;
          return (Math.atan(height / PANEL_DISTANCE) * 180) / Math.PI;
        }"""
    )
    assert 1.0 <= degrees < 1.5


def test_states_are_drawn_at_once_and_numbers_twice_a_second(rig):
    drawn = rig.js(
        """(hud) => {
          let cleared = 0;
          const clear = CanvasRenderingContext2D.prototype.clearRect;
          CanvasRenderingContext2D.prototype.clearRect = function (...box) { cleared += 1; clear.apply(this, box); };
          const run = (change) => {
            cleared = 0;
            for (let i = 0; i < 60; i++) {
              rig.now += 20;
              change(i);
              rig.stage.hud({ hud, link: { open: true, reason: "" }, video: null });
              rig.draw();
            }
            return cleared;
          };
          rig.draw();
          const numbers = run((i) => { hud.left.position_error_mm = i; });
          const states = run((i) => { hud.left.state = i % 6 < 3 ? "hold" : "active"; });
          return [numbers, states, run(() => {})];
        }""",
        hud(),
    )
    assert 2 <= drawn[0] <= 4  # in 1.2 s
    assert 19 <= drawn[1] <= 22
    assert drawn[2] <= 1


def test_hands_are_points_in_the_arms_colour_and_grips_are_larger(rig):
    rig.say(hud(arm("active"), arm("hold")))
    joints = [[-0.25 + 0.05 * i, 1.9, -0.6] for i in range(3)]
    grip = [0.3, 1.9, -0.6]
    rig.js("([left, right, xyz]) => rig.hold(left, right, xyz)", [3, 1, [*np.ravel(joints), *grip]])
    rig.draw()

    def area(middle, ours, other):
        x, y = seen_at(room(), middle).round().astype(int)
        part = rig.picture()[y - 8 : y + 9, x - 8 : x + 9]
        return int(((part[..., ours] > 120) & (part[..., ours] > part[..., other] + 40)).sum())

    sizes = [area(joint, 1, 0) for joint in joints]
    assert min(sizes) >= 1
    assert area(grip, 0, 2) > 3 * max(sizes)
    # More of them than before, and none.
    many = [[-0.3 + 0.02 * i, 1.9, -0.6] for i in range(25)]
    rig.js("([left, right, xyz]) => rig.hold(left, right, xyz)", [25, 0, list(np.ravel(many))])
    rig.draw()
    assert area(many[24], 1, 0) >= 1
    assert area(grip, 0, 2) == 0
    rig.js("rig.points = null")
    rig.draw()
    assert area(many[24], 1, 0) == 0


def test_passthrough_leaves_the_room_to_be_seen(rig):
    rig.show()
    for passthrough, opacity in ((True, 0), (False, 255)):
        rig.js("on => { rig.passthrough = on; }", passthrough)
        rig.draw()
        void = rig.pixel((0.0, 3.4, -2.0))
        assert void[3] == opacity
        assert (max(void[:3]) > 0) == (not passthrough)
        assert rig.pixel(AHEAD)[3] == 255


def test_a_lost_context_is_no_error_and_comes_back(rig):
    rig.show()
    rig.draw()
    rig.js("rig.loss = rig.gl.getExtension('WEBGL_lose_context'); rig.loss.loseContext()")
    rig.until("rig.stage.lost")
    rig.show(seq=2, left=BLUE)
    assert [rig.draw(200.0) for _ in range(3)] == [None] * 3
    rig.until("rig.stage._built === false")  # the event has come; only then may it be given back
    rig.js("rig.loss.restoreContext()")
    rig.until("!rig.stage.lost")
    assert rig.draw() == 2, "its credit would never come back"
    assert rig.pixel(AHEAD)[:3] == pytest.approx([0, 0, 200], abs=8)
    assert not [line for line in rig.tab.console if "uncaught" in line]
