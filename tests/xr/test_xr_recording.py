"""Recordings: what is written is read, what is none is refused; what was recorded moves an arm within its bounds."""

import io
import math
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xr_samples import at, controller, hand, packet, pose

from ik_client.engagement import ArmEngagement
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.rotation import rotation_vector
from ik_client.state_machine import ArmState
from xr_client.frames import pose_of
from xr_client.packets import Kind, decode_packet, encode_packet
from xr_client.recording import Recorder, RecordingError, read_recording
from xr_client.replay import Replay

RECORDINGS = ["dev-recording", "tracked-recording", "grabLeft"]
TICK = 0.01


def recorded(count=5) -> list[tuple[float, bytes]]:
    return [
        (0.011 * k, encode_packet(packet(k, left=controller(at(0.01 * k)), right=hand(at())))) for k in range(count)
    ]


def written(session, begin=50.0) -> bytes:
    file = io.BytesIO()
    recorder = Recorder(file)
    for time, data in session:
        recorder.write(data, begin + time)
    return file.getvalue()


def test_what_is_written_is_read(tmp_path):
    session = recorded()
    (tmp_path / "a.ikxr").write_bytes(written(session))
    got = read_recording(tmp_path / "a.ikxr")
    assert [encode_packet(one.packet) for one in got] == [data for _, data in session]
    np.testing.assert_allclose([one.time for one in got], [time for time, _ in session], atol=1e-9)


def test_the_table_of_fields():
    session = recorded(1)
    data = written(session)
    assert data == b"IKXR" + struct.pack("<IdI", 1, 0.0, len(session[0][1])) + session[0][1]


@pytest.mark.parametrize("cut", [1, 20, 159, 455])
def test_a_recording_that_was_cut_off_counts_up_to_there(tmp_path, cut):
    (tmp_path / "a.ikxr").write_bytes(written(recorded())[:-cut])
    assert len(read_recording(tmp_path / "a.ikxr")) == 5 - math.ceil(cut / (len(recorded(1)[0][1]) + 12))


def test_a_missing_file_is_refused(tmp_path):
    for name in ("absent.ikxr", "absent.npz"):
        with pytest.raises(RecordingError, match="cannot be read"):
            read_recording(tmp_path / name)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("recordings")


@given(st.binary(max_size=60) | st.integers(0, 900).map(lambda k: k.to_bytes(2, "little")), st.booleans())
def test_any_file_is_read_or_refused(scratch, data, spoil):
    if spoil:
        whole = bytearray(written(recorded(3)))
        whole[int.from_bytes(data[:2], "little") % len(whole)] ^= 0xFF
        data = bytes(whole)
    for name in ("any.ikxr", "any.npz"):
        (scratch / name).write_bytes(data)
        try:
            assert read_recording(scratch / name)
        except RecordingError as error:
            assert len(str(error).splitlines()) == 1


def test_an_archive_with_other_shapes_is_refused(tmp_path):
    good = {part: np.eye(4)[None] for part in ("head", "left", "right")}
    good |= {f"t_{part}": np.zeros(1) for part in ("head", "left", "right")}
    for name, spoilt in (("left", np.eye(3)[None]), ("t_left", np.zeros(2)), ("head", np.full((1, 4, 4), np.nan))):
        parts: dict[str, Any] = {**good, name: spoilt}
        np.savez(tmp_path / "a.npz", **parts)
        with pytest.raises(RecordingError, match="must be finite poses"):
            read_recording(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", head=good["head"])
    np.save(tmp_path / "array.npy", np.eye(4))
    whole = (tmp_path / "a.npz").read_bytes()
    for data in (whole, whole[:90], b"PK\3\4", (tmp_path / "array.npy").read_bytes()):
        (tmp_path / "a.npz").write_bytes(data)
        with pytest.raises(RecordingError, match="no archive"):
            read_recording(tmp_path / "a.npz")


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recorded_session_is_what_the_archive_says(shared_data, name):
    file = shared_data / "human" / "vr" / f"{name}.npz"
    session = read_recording(file)
    with np.load(file) as data:
        assert len(session) == len(data["t_head"])
        for k in range(0, len(session), 97):
            assert session[k].time == pytest.approx(data["t_head"][k] - data["t_head"][0])
            again = decode_packet(encode_packet(session[k].packet))
            assert again.left.kind is Kind.CONTROLLER
            for place, part in ((again.head, "head"), (again.left.pose, "left"), (again.right.pose, "right")):
                assert place is not None
                np.testing.assert_allclose(pose_of(place[:3], place[3:]), data[part][k], atol=2e-5)


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_replayed_session_moves_two_arms_within_all_bounds_and_not_while_lost(shared_data, name):
    """Through packets, tracker, gate, clutch and limiter: the arms are poses themselves, which the limiter bounds.

    Issue 5: "no limit exceeded, no motion while lost, no crash".
    """
    replay = Replay(read_recording(shared_data / "human" / "vr" / f"{name}.npz"))
    limits = MotionLimits()
    arms = [Arm(limits), Arm(limits)]
    now, active = 5.0, 0
    while not replay.finished:
        hands = replay.hands(now)
        for arm, sample in zip(arms, (hands.left, hands.right) if hands else (None, None), strict=True):
            active += arm.tick(sample, now)
        now += TICK
    assert now - 5.0 == pytest.approx(replay.length, abs=0.05)
    assert active > 0.5 * replay.length / TICK
    for arm in arms:
        v, a = (np.abs(np.diff(arm.commands, n, axis=0)).max() / TICK**n for n in (1, 2))
        assert v <= limits.velocity * (1 + 1e-9)
        assert a <= limits.acceleration * (1 + 1e-9)
        assert np.ptp(np.array(arm.commands)[:, :3], axis=0).max() > 0.1
    for _ in range(100):
        now += TICK
        for arm in arms:
            arm.tick(None, now)
    for arm in arms:
        assert np.ptp(arm.commands[-40:], axis=0).max() <= 1e-12
        assert arm.engagement.state is ArmState.DISARMED


class Arm:
    """Three joints that slide a metre a radian and a rotation vector, behind an engagement and a limiter."""

    def __init__(self, limits) -> None:
        self.engagement = ArmEngagement()
        self.limiter = JointLimiter(6, TICK, limits)
        self.commands = [np.zeros(6)]

    def tick(self, sample, now) -> bool:
        step = self.engagement.step(sample, now, wrist=self.wrist, aligned=True)
        goal = np.full(6, np.nan)
        if step.target is not None:
            goal = np.concatenate([step.target[:3, 3], rotation_vector(step.target[:3, :3])])
        self.commands.append(self.limiter.limit(self.commands[-1], goal))
        return step.target is not None

    def wrist(self):
        rest = self.limiter.resting_point
        return pose(rest[:3], rest[3:])


def test_a_replay_of_our_own_recording_is_what_the_loop_saw(tmp_path):
    (tmp_path / "a.ikxr").write_bytes(written(recorded()))
    replay = Replay(read_recording(tmp_path / "a.ikxr"))
    first = replay.hands(7.0)
    assert first is not None
    assert replay.tracker.latest is not None
    assert replay.tracker.latest.time == 7.0
    replay.hands(7.0 + 0.034)
    assert replay.tracker.latest.packet.seq == 3
    assert replay.hands(7.0 + 0.1) is None
    assert replay.finished


def test_the_captured_hands_go_through_a_packet(captured_hand):
    """25 joints of a real hand, as they arrive: in place to a micrometre, and the pinch tells the pinch apart."""
    name, joints = captured_hand
    points = joints[:, :3, 3]
    pinch = float(np.linalg.norm(points[4] - points[9]))
    seen = decode_packet(encode_packet(packet(1, left=replace(hand(at(), pinch), joints=points)))).left
    assert seen.joints is not None
    np.testing.assert_allclose(seen.joints, points, atol=1e-6)
    assert seen.pinch == pytest.approx(pinch, abs=1e-7)
    assert (pinch < 0.015) == (name == "pinch")
