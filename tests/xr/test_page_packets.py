"""What the page makes of a frame, and the bytes it writes: against the golden vectors, and against our own decoder."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Tab
from xr_page import PageServer
from xr_samples import HAND_JOINTS

from xr_client.packets import HandPacket, Kind, PosePacket, decode_packet, encode_packet

ACCEPTED = json.loads((Path(__file__).parent / "vectors" / "accepted.json").read_text())["pose"]

FILL = """
  const fillHand = (into, from) => {
    into.kind = from.kind;
    into.tracked = from.pose !== null;
    into.pose.set(from.pose ?? []);
    [into.trigger, into.squeeze, [into.stickX, into.stickY]] = [from.trigger, from.squeeze, from.stick];
    into.buttons = from.buttons.reduce((bits, pressed, k) => bits | (pressed << k), 0);
    into.pinchKnown = from.pinch !== null;
    into.pinch = from.pinch ?? 0;
    into.jointsKnown = from.joints !== null;
    into.joints.set(from.joints?.flat() ?? []);
  };
  const fill = (into, from) => {
    [into.seq, into.epoch, into.captureMs, into.visible] = [from.seq, from.epoch, from.capture_ms, from.visible];
    into.head.tracked = from.head !== null;
    into.head.guessed = from.head_guessed;
    into.head.pose.set(from.head ?? []);
    fillHand(into.hands[0], from.left);
    fillHand(into.hands[1], from.right);
  };
"""
"""Puts a packet's content, as JSON has it, into the page's own form; leaves what is not there as it was before."""

FAKE = """
  const numbers = { nan: NaN, inf: Infinity, "-inf": -Infinity, "-0": -0 };
  const number = (value) => numbers[value] ?? value;
  const xyzw = (values) => Object.fromEntries(values.map((value, k) => ["xyzw"[k], number(value)]));
  const pose = (from) => from && {
    transform: { position: xyzw(from.pose.slice(0, 3)), orientation: xyzw(from.pose.slice(3)) },
    emulatedPosition: from.guessed ?? false,
    views: [],
  };
  const frameOf = ({ viewer, sources }) => ({
    getViewerPose: () => pose(viewer),
    getPose: (space) => pose(space.pose),
    getJointPose: (joint) => pose(joint.pose),
    session: {
      inputSources: sources.map(({ side, mode, grip, joints, gamepad }) => ({
        handedness: side,
        targetRayMode: mode ?? "tracked-pointer",
        gripSpace: grip === undefined ? undefined : { pose: grip },
        hand: joints && new Map(names.map((name, k) => [name, { pose: joints[k] }])),
        gamepad: gamepad && {
          mapping: gamepad.mapping ?? "xr-standard",
          axes: gamepad.axes.map(number),
          buttons: gamepad.values.map((value) => ({ value: number(value), pressed: number(value) > 0.5 })),
        },
      })),
    },
  });
"""
"""Makes a WebXR frame of a description; JSON has no words for some numbers, so texts stand for them."""

HEX = 'const hex = (bytes) => Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");'

UPRIGHT = [0.0, 0.0, 0.0, 1.0]
THUMB_TIP, INDEX_TIP = HAND_JOINTS.index("thumb-tip"), HAND_JOINTS.index("index-finger-tip")


def there(x: Any = 0.25, y: Any = 1.25, z: Any = -0.5, q: Any = None, *, guessed: bool = False) -> dict[str, Any]:
    """A pose of a frame."""
    return {"pose": [x, y, z, *(q or UPRIGHT)], "guessed": guessed}


def gamepad(*values: Any, axes: Any = (0.0, 0.0, 0.0, 0.0), **others: Any) -> dict[str, Any]:
    return {"values": values, "axes": axes, **others}


def a_hand(side: str = "left", **others: Any) -> dict[str, Any]:
    """A hand whose joints are all there, a sixteenth of a metre apart along x."""
    joints = [there(k / 16.0) for k in range(25)]
    return {"side": side, "joints": joints, **others}


def a_controller(side: str = "left", **others: Any) -> dict[str, Any]:
    return {"side": side, "grip": there(0.5), "gamepad": gamepad(0.0, 0.75), **others}


@pytest.fixture(scope="module")
def tab(chromium) -> Iterator[Tab]:
    """A tab where the page's modules can be had."""
    server = PageServer()
    server.start()
    with chromium.tab() as opened:
        opened.goto(f"{server.url}/icon.svg")
        yield opened
    server.stop()


def written(tab: Tab, contents: list[dict[str, Any]]) -> list[bytes]:
    """What one writer makes of contents, one after another in the same object."""
    script = f"""async (contents) => {{
      const {{ PacketWriter, newContent }} = await import("/pose_packet.js");
      {FILL}
      {HEX}
      const [writer, content] = [new PacketWriter(), newContent()];
      return JSON.parse(contents).map((each) => {{ fill(content, each); return hex(writer.write(content)); }});
    }}"""
    return [bytes.fromhex(packet) for packet in tab.js(script, json.dumps(contents))]


def read(tab: Tab, *frames: dict[str, Any]) -> list[PosePacket]:
    """What one reader makes of frames, one after another, as our decoder takes it."""
    script = f"""async (frames) => {{
      const {{ PacketWriter }} = await import("/pose_packet.js");
      const {{ PoseReader, JOINT_NAMES: names }} = await import("/poses.js");
      {FAKE}
      {HEX}
      const [writer, reader] = [new PacketWriter(), new PoseReader()];
      return JSON.parse(frames).map((each) => {{
        reader.read(frameOf(each), null, true);
        return hex(writer.write(reader.content));
      }});
    }}"""
    packets = [bytes.fromhex(packet) for packet in tab.js(script, json.dumps(frames))]
    for packet in packets:
        numbers = np.frombuffer(packet, "<f4", offset=24)
        assert not (np.signbit(numbers) & (numbers == 0.0)).any(), "minus zero is never sent"
    return [decode_packet(packet) for packet in packets]


def one(tab: Tab, *sources: dict[str, Any], viewer: dict[str, Any] | None = None) -> PosePacket:
    return read(tab, {"viewer": viewer, "sources": sources})[0]


def as_json(packet: PosePacket) -> dict[str, Any]:
    return json.loads(json.dumps(asdict(packet), default=lambda value: value.tolist()))


def random_packet(rng: np.random.Generator, seq: int) -> PosePacket:
    """Any content, its numbers exact in float32."""

    def exact(values: np.ndarray) -> np.ndarray:
        return values.astype(np.float32).astype(np.float64)

    def placed() -> np.ndarray | None:
        q = rng.normal(size=4)
        return exact(np.r_[rng.uniform(-100, 100, 3), q / np.linalg.norm(q)]) if rng.random() < 0.7 else None

    def hand() -> HandPacket:
        kind = Kind(rng.integers(3))
        if kind is Kind.CONTROLLER:
            trigger, squeeze, x, y = exact(rng.uniform([0, 0, -1, -1], 1.0)).tolist()
            a, b, stick = (rng.random(3) < 0.5).tolist()
            return HandPacket(kind, placed(), trigger, squeeze, (x, y), (a, b, stick))
        if kind is Kind.NONE:
            return HandPacket()
        pinch, joints = exact(rng.uniform(0, 1, 1)).item(), exact(rng.uniform(-100, 100, (25, 3)))
        return HandPacket(
            kind,
            placed(),
            pinch=pinch if rng.random() < 0.5 else None,
            joints=joints if rng.random() < 0.5 else None,
        )

    head = placed()
    guessed = head is not None and rng.random() < 0.5
    epoch, time = int(rng.integers(2**32)), float(rng.uniform(0, 1e9))
    return PosePacket(seq, epoch, time, head, guessed, bool(rng.random() < 0.5), hand(), hand())


def test_golden_vectors_are_written_to_the_byte(tab):
    names = [vector["name"] for vector in ACCEPTED]
    packets = written(tab, [vector["content"] for vector in ACCEPTED])
    assert dict(zip(names, map(bytes.hex, packets), strict=True)) == {each["name"]: each["hex"] for each in ACCEPTED}


def test_any_content_is_written_as_our_own_encoder_writes_it(tab):
    """Also that nothing stays of the content before: hands with joints, without, and none at all follow each other."""
    rng = np.random.default_rng(5)
    packets = [random_packet(rng, seq) for seq in range(150)]
    assert written(tab, [as_json(packet) for packet in packets]) == [encode_packet(packet) for packet in packets]


def test_joints_have_webxrs_order(tab):
    assert tab.js("import('/poses.js').then((module) => module.JOINT_NAMES)") == HAND_JOINTS


def test_a_frame_of_hands(tab):
    packet = one(tab, a_hand("left"), a_hand("right", gamepad=gamepad(1.0, 1.0)), viewer=there(0.0, 1.5, 0.0))
    assert packet.head == pytest.approx([0.0, 1.5, 0.0, *UPRIGHT])
    assert (packet.visible, packet.head_guessed) == (True, False)
    for hand in packet.hands:
        assert hand.kind is Kind.HAND
        assert hand.pose == pytest.approx([0.0, 1.25, -0.5, *UPRIGHT])
        assert hand.pinch == pytest.approx((INDEX_TIP - THUMB_TIP) / 16.0)
        assert hand.joints is not None
        assert hand.joints[:, 0] == pytest.approx(np.arange(25) / 16.0)
        # A pinch that the browser says of a hand is not its trigger.
        assert (hand.trigger, hand.squeeze) == (0.0, 0.0)


def test_a_frame_of_controllers(tab):
    values = gamepad(0.25, 0.75, 0.0, 1.0, 0.0, 1.0, axes=[0.9, 0.9, 0.5, -1.0])
    packet = one(tab, a_controller("right", gamepad=values))
    right = packet.right
    assert packet.left.kind is Kind.NONE
    assert (right.kind, right.trigger, right.squeeze, right.stick) == (Kind.CONTROLLER, 0.25, 0.75, (0.5, -1.0))
    assert right.buttons == (False, True, True)
    assert right.pose == pytest.approx([0.5, 1.25, -0.5, *UPRIGHT])


@pytest.mark.parametrize(
    ("grip", "kind"), [(there(0.5), Kind.CONTROLLER), (None, Kind.HAND), (there(0.5, guessed=True), Kind.HAND)]
)
@pytest.mark.parametrize("hand_first", [True, False])
def test_of_a_hand_and_a_controller_the_controller_counts_while_it_is_seen(tab, grip, kind, hand_first):
    both = [a_hand("left"), a_controller("left", grip=grip)]
    packet = one(tab, *(both if hand_first else both[::-1]))
    assert packet.left.kind is kind
    assert packet.left.pose is not None
    assert packet.right.kind is Kind.NONE


def test_a_controller_that_is_not_seen_is_still_squeezed(tab):
    for grip in (None, there(guessed=True)):
        left = one(tab, a_controller(grip=grip)).left
        assert (left.kind, left.pose, left.squeeze) == (Kind.CONTROLLER, None, 0.75)


@pytest.mark.parametrize(
    "source",
    [
        a_hand("none"),
        a_controller("none"),
        *(a_controller(mode=mode) for mode in ("gaze", "screen", "transient-pointer")),
    ],
)
def test_what_is_nobodys_hand_is_left_out(tab, source):
    packet = one(tab, source)
    assert (packet.left.kind, packet.right.kind) == (Kind.NONE, Kind.NONE)


def test_a_guess_of_the_heads_place_is_said_to_be_one(tab):
    assert one(tab, viewer=there(guessed=True)).head_guessed
    assert one(tab).head is None


def test_a_hand_without_a_wrist_is_lost_but_its_pinch_is_known(tab):
    joints = a_hand()["joints"]
    for wrist in (None, there(guessed=True)):
        left = one(tab, a_hand(joints=[wrist, *joints[1:]])).left
        assert (left.kind, left.pose) == (Kind.HAND, None)
        assert left.pinch == pytest.approx((INDEX_TIP - THUMB_TIP) / 16.0)
        assert (left.joints is None) == (wrist is None)


@pytest.mark.parametrize("tip", [THUMB_TIP, INDEX_TIP])
def test_a_pinch_is_known_only_where_both_tips_are(tab, tip):
    joints = a_hand()["joints"]
    joints[tip] = None
    left = one(tab, a_hand(joints=joints)).left
    assert left.pose is not None
    assert (left.pinch, left.joints) == (None, None)


def test_numbers_beyond_their_range_are_brought_into_it(tab):
    values = gamepad(1.0000001, -1e-9, axes=[0.0, 0.0, -1.0000001, "nan"])
    left = one(tab, a_controller(gamepad=values)).left
    assert (left.trigger, left.squeeze, left.stick) == (1.0, 0.0, (-1.0, 0.0))
    far = one(tab, a_controller(grip=there(100.1)), viewer=there(y="nan"))
    assert (far.left.pose, far.head) == (None, None)
    assert one(tab, a_controller(grip=there(q=[0.0, 0.0, 0.0, 1.02]))).left.pose is None
    assert one(tab, a_controller(gamepad=gamepad(1.0, 1.0, mapping=""))).left.squeeze == 0.0


ODD = [0.0, "-0", -1e-60, 1e-60, 1.0000001, -1.0000001, 99.99999999, 100.0001, 1e9, "nan", "inf", "-inf", 0.5, -0.5]


def odd_frame(rng: np.random.Generator) -> dict[str, Any]:
    """A frame as no browser should give it."""

    def odd() -> Any:
        return ODD[rng.integers(len(ODD))] if rng.random() < 0.15 else float(rng.normal())

    def odd_pose() -> dict[str, Any] | None:
        q = rng.normal(size=4)
        q = (q / np.linalg.norm(q)).tolist() if rng.random() < 0.8 else [odd(), odd(), odd(), odd()]
        return None if rng.random() < 0.1 else there(odd(), odd(), odd(), q, guessed=rng.random() < 0.1)

    def odd_source() -> dict[str, Any]:
        side, hand = str(rng.choice(["left", "right", "none"])), rng.random() < 0.5
        joints = [there(odd(), odd(), odd()) if rng.random() < 0.99 else None for _ in range(25)]
        pad = gamepad(*(odd() for _ in range(rng.integers(8))), axes=[odd() for _ in range(rng.integers(5))])
        return {
            "side": side,
            "grip": odd_pose(),
            "gamepad": pad if rng.random() < 0.8 else None,
            **({"joints": joints} if hand else {}),
        }

    return {"viewer": odd_pose(), "sources": [odd_source() for _ in range(rng.integers(4))]}


def test_whatever_a_browser_gives_the_packet_is_accepted(tab):
    rng = np.random.default_rng(6)
    packets = read(tab, *(odd_frame(rng) for _ in range(400)))
    hands = [hand for packet in packets for hand in packet.hands]
    # The frames were odd enough to matter, and not so odd that nothing is left.
    for kind in Kind:
        assert sum(hand.kind is kind for hand in hands) > 20
    assert {hand.pose is None for hand in hands if hand.kind} == {True, False}
    assert {packet.head is None for packet in packets} == {True, False}
    assert any(hand.pinch is not None for hand in hands)


def test_packets_are_dropped_while_the_network_is_behind_or_gone(tab):
    script = """async () => {
      const real = globalThis.WebSocket;
      globalThis.WebSocket = class {
        static OPEN = 1;
        constructor() { this.readyState = 1; this.bufferedAmount = 0; this.sent = 0; globalThis.socket = this; }
        send() { this.sent += 1; }
        close() { this.readyState = 3; }
      };
      const { PoseLink } = await import("/pose_link.js");
      const link = new PoseLink("ws://nowhere", { hello: {}, onState() {}, onHud() {} });
      const packet = new Uint8Array(148);
      const said = [link.send(packet)];
      socket.onmessage({ data: '{"type": "ping", "t_ms": 1}' });
      const sent = socket.sent;
      said.push(link.send(packet));
      socket.bufferedAmount = 1e5;
      said.push(link.send(packet));
      socket.bufferedAmount = 0;
      said.push(link.send(packet));
      socket.readyState = 2;
      said.push(link.send(packet));
      globalThis.WebSocket = real;
      return [said, socket.sent - sent];
    }"""
    assert tab.js(script) == [[False, True, False, True, False], 2]
