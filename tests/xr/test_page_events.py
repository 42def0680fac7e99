"""What happens to a person in a session: hands go and come back, rooms move, menus open, servers end."""

import time
from collections.abc import Callable

import pytest
from xr_page import TOKEN, PageServer, enter, put_on, wait_for

from ik_client.types import Hands
from xr_client.grip_switch import GripThresholds
from xr_client.iwer import iwer_script
from xr_client.packets import Kind
from xr_client.tracker import Arrival

BOTH_HANDS, BOTH_CONTROLLERS = (Kind.HAND, Kind.HAND), (Kind.CONTROLLER, Kind.CONTROLLER)


def kinds(arrival: Arrival) -> tuple[Kind, Kind]:
    left, right = arrival.packet.hands
    return left.kind, right.kind


def tracked(arrival: Arrival) -> tuple[bool, bool]:
    left, right = arrival.packet.hands
    return left.pose is not None, right.pose is not None


def loop_until(server: PageServer, condition: Callable[[Hands], bool], what: str) -> Hands:
    """Ask for hands as the teleop loop does, tick by tick, until a condition holds."""

    def tick() -> Hands | None:
        hands = server.tracker.hands(time.monotonic())
        return hands if hands is not None and condition(hands) else None

    return wait_for(tick, what)


def grips(side: str, held: bool) -> Callable[[Hands], bool]:
    def condition(hands: Hands) -> bool:
        sample = getattr(hands, side)
        return sample is not None and sample.tracked and sample.grip is held

    return condition


def test_hands_are_laid_on_controllers_and_taken_off_in_mid_session(worn):
    server, tab = worn
    arrival = server.after(tab, "xrOperator.swapControllers()")
    assert (kinds(arrival), tracked(arrival)) == (BOTH_CONTROLLERS, (True, True))
    assert all(hand.joints is None and hand.pinch is None for hand in arrival.packet.hands)
    arrival = server.after(tab, "xrOperator.swapControllers()")
    assert (kinds(arrival), tracked(arrival)) == (BOTH_HANDS, (True, True))
    assert all(hand.joints is not None and hand.pinch is not None for hand in arrival.packet.hands)


def test_a_switch_of_hands_and_controllers_must_be_gripped_anew(worn):
    server, tab = worn
    loop_until(server, grips("left", False), "an open hand")
    server.after(tab, "xrOperator.grip('left', true)")
    loop_until(server, grips("left", True), "a grip")
    # The controller is squeezed before the hand was seen to open: nothing may follow it.
    server.after(tab, "xrOperator.swapControllers(); xrOperator.grip('left', true)")
    held = server.arrival(lambda latest: latest.packet.left.squeeze == 1.0, "a squeeze")
    assert held.look.left is not None
    assert held.look.left.grip is True
    loop_until(server, lambda hands: hands.left is not None and hands.left.tracked, "the hand")
    for _ in range(20):
        hands = server.tracker.hands(time.monotonic())
        assert hands is not None
        assert hands.left is not None
        assert hands.left.grip is False
    server.after(tab, "xrOperator.grip('left', false)")
    loop_until(server, grips("left", False), "an open hand")
    server.after(tab, "xrOperator.grip('left', true)")
    loop_until(server, grips("left", True), "a grip of the controller")


def test_a_lost_hand_is_said_to_be_lost_and_comes_back(worn):
    server, tab = worn
    arrival = server.after(tab, "xrOperator.setSeen('left', false)")
    assert tracked(arrival) == (False, True)
    assert not (arrival.look.left is not None and arrival.look.left.tracked)
    arrival = server.after(tab, "xrOperator.setSeen('left', true)")
    assert (tracked(arrival), kinds(arrival)) == ((True, True), BOTH_HANDS)


def test_a_wrist_that_is_not_seen_makes_the_hand_lost_though_its_fingers_are_seen(worn):
    server, tab = worn
    hide = """
      globalThis.seen = XRFrame.prototype.getJointPose;
      XRFrame.prototype.getJointPose = function (joint, base) {
        return joint.jointName === "wrist" ? null : seen.call(this, joint, base);
      }
    """
    arrival = server.after(tab, hide)
    assert (kinds(arrival), tracked(arrival)) == (BOTH_HANDS, (False, False))
    assert arrival.packet.left.pinch is not None
    assert arrival.look.left is not None
    assert not arrival.look.left.tracked
    arrival = server.after(tab, "XRFrame.prototype.getJointPose = seen")
    assert tracked(arrival) == (True, True)


def test_a_controller_whose_place_is_a_guess_is_lost(worn):
    server, tab = worn
    guess = "xrDevice.controllers.left.inputSource.gripSpace[IWER.P_SPACE].emulated = argument"
    arrival = server.after(tab, f"xrOperator.swapControllers(); {guess}", True)
    assert (kinds(arrival), tracked(arrival)) == (BOTH_CONTROLLERS, (False, True))
    assert tracked(server.after(tab, guess, False)) == (True, True)


def test_a_pinch_counts_after_it_has_lasted(worn):
    server, tab = worn
    server.packets.clear()
    tab.js("xrOperator.grip('right', true); 0")
    held = server.arrival(lambda latest: latest.look.right is not None and latest.look.right.grip, "a grip")
    limit = GripThresholds().pinch_close
    begun = next(
        time for time, packet in server.packets if packet.right.pinch is not None and packet.right.pinch < limit
    )
    assert held.time - begun >= GripThresholds().dwell
    opened = server.after(tab, "xrOperator.grip('right', false)")
    assert opened.look.right is not None
    assert opened.look.right.grip is False


def test_a_pinch_leaves_the_wrist_where_it_is(worn):
    server, tab = worn
    before = server.after(tab).packet.left
    after = server.after(tab, "xrOperator.grip('left', true)").packet.left
    assert before.pose is not None
    assert after.pose is not None
    assert before.pinch is not None
    assert after.pinch is not None
    assert abs(after.pose - before.pose).max() < 1e-5
    assert (before.pinch > 0.08, after.pinch < 0.005) == (True, True)


def test_after_a_recenter_arms_must_be_gripped_anew(worn):
    server, tab = worn
    loop_until(server, grips("left", False), "an open hand")
    before = server.after(tab, "xrOperator.walk([0.3, 0, 0.2]); xrOperator.grip('left', true)")
    loop_until(server, grips("left", True), "a grip")
    after = server.after(tab, "xrOperator.recenter()")
    assert after.packet.epoch > before.packet.epoch
    assert after.packet.head is not None
    assert after.packet.head[0] == pytest.approx(0.0, abs=1e-6)
    assert after.packet.left.pinch is not None
    assert after.packet.left.pinch < GripThresholds().pinch_close
    loop_until(server, grips("left", False), "the arm let go, the fingers still closed")
    server.after(tab, "xrOperator.grip('left', false)")
    loop_until(server, lambda hands: hands.left is not None and hands.left.grip is False, "an open hand")
    server.after(tab, "xrOperator.grip('left', true)")
    loop_until(server, grips("left", True), "a new grip")


@pytest.mark.parametrize("state", ["visible-blurred", "hidden"])
def test_behind_a_menu_there_are_no_hands(worn, state):
    server, tab = worn
    before = server.after(tab).packet
    tab.js("(state) => xrDevice.updateVisibilityState(state)", state)
    behind = server.arrival(lambda latest: not latest.packet.visible, "a packet that says so")
    assert behind.packet.epoch > before.epoch
    assert all(sample is None or not sample.tracked for sample in behind.look.wrists)
    tab.js("xrDevice.updateVisibilityState('visible')")
    back = server.arrival(lambda latest: latest.packet.visible and all(tracked(latest)), "both hands")
    assert back.packet.epoch > behind.packet.epoch


def test_a_session_ends_and_another_one_begins(worn):
    server, tab = worn
    before = server.after(tab)
    tab.js("xrDevice.activeSession.end()")
    tab.until("document.querySelector('#enter-vr').disabled === false")
    again = put_on(tab, server)
    assert again.packet.epoch > before.packet.epoch
    assert (kinds(again), tracked(again)) == (BOTH_HANDS, (True, True))


def test_the_page_comes_back_by_itself_when_the_server_does(chromium, iwer):
    server = PageServer(emulator=iwer_script())
    port = server.start()[0]
    with chromium.tab() as tab:
        enter(tab, server)
        server.stop()
        tab.until("!globalThis.ikxr.link.open")
        again = PageServer(emulator=iwer_script())
        again.start(port)
        arrival = again.arrival(lambda latest: all(tracked(latest)), "both hands at the new server")
        assert kinds(arrival) == BOTH_HANDS
        assert again.tracker.connections == 1
        assert not tab.js("Boolean(xrDevice.activeSession.ended)")
        again.stop()


def test_a_second_page_is_told_that_another_headset_is_connected(worn, chromium):
    server, _ = worn
    connections = server.tracker.connections
    with chromium.tab() as second:
        second.goto(f"{server.url}/emulate#{TOKEN}")
        second.until("/another headset is connected/.test(document.body.innerText)")
        assert server.tracker.connections == connections
        server.arrival(lambda latest: all(tracked(latest)), "the first headset goes on")


def test_a_headset_like_the_vision_pro(chromium, iwer):
    """No pass-through, hands without a gamepad, and no emulator of ours: IWER alone."""
    server = PageServer()
    server.start()
    with chromium.tab() as tab:
        tab.before(iwer)
        tab.before(
            """
            globalThis.xrDevice = new IWER.XRDevice({
              ...IWER.metaQuest3,
              name: "like a Vision Pro",
              controllerConfig: undefined,
              supportedSessionModes: ["inline", "immersive-vr"],
              supportedFeatures: ["viewer", "local", "local-floor", "hand-tracking"],
            }, { stereoEnabled: true });
            xrDevice.installRuntime({ forceInstall: true });
            xrDevice.primaryInputMode = "hand";
            const { get } = Object.getOwnPropertyDescriptor(XRSession.prototype, "inputSources");
            const bare = (source) => new Proxy(source, {
              get: (target, name) => (name === "gamepad" ? null : Reflect.get(target, name, target)),
            });
            Object.defineProperty(XRSession.prototype, "inputSources", {
              get() { return Array.from(get.call(this), bare); },
            });
            """
        )
        arrival = enter(tab, server, "/")
        assert (kinds(arrival), tracked(arrival)) == (BOTH_HANDS, (True, True))
        assert tab.js("document.querySelector('#enter-ar').disabled || document.querySelector('#enter-ar').hidden")
        pinched = server.after(tab, "xrDevice.hands.left.updatePinchValue(1)").packet.left
        assert pinched.pinch is not None
        assert pinched.pinch < GripThresholds().pinch_close
        assert not [line for line in tab.console if line.startswith("uncaught")]
    server.stop()
