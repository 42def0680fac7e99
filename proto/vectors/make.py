"""Write the golden frames: `python proto/vectors/make.py`.

Each example is written as a JSON body (`NAME.json`) and as a MessagePack body (`NAME.msgpack`), one also as a whole
TCP frame (`solve_request.frame`). An example is a message of the schema's kind of the same name, but for those that
`KINDS` lists. The numbers are chosen to catch a swapped arm, a transposed matrix and a wrong byte
order; a test holds the files to the code.
"""

from pathlib import Path

import numpy as np

from ik_proto import (
    JSON,
    MSGPACK,
    BatchReply,
    ClearanceReply,
    ClearanceRequest,
    Document,
    FkReply,
    FkRequest,
    InfoReply,
    InfoRequest,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
    Status,
    VelocityReply,
    VelocityRequest,
    encode_frame,
    reply_document,
    request_document,
)

FOLDER = Path(__file__).parent


def pose(x: float, y: float, z: float) -> np.ndarray:
    """A quarter turn about z, exact in floating point and not symmetric, at a position [m]."""
    return np.array([[0.0, -1.0, 0.0, x], [1.0, 0.0, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])


LEFT, RIGHT = pose(0.25, 0.125, 0.0625), pose(0.375, -0.25, 0.5)
Q = np.arange(14, dtype=np.float64) / 16.0
TAU = (np.arange(14, dtype=np.float64) - 7.0) / 8.0
WAIST = np.array([0.125, -0.0625, 0.25])
LEFT_ELBOW, RIGHT_ELBOW = np.array([0.0, 0.6, -0.8, 0.75]), np.array([-0.6, 0.0, -0.8, 0.5])
WEIGHTS = np.array([[1.0, 0.5], [0.75, 0.0]])
TWIST = np.array([0.125, -0.0625, 0.03125, 0.5, -0.25, 0.75])
NAMES = [f"{side}_joint_{k}" for side in ("left", "right") for k in range(1, 8)]

EXAMPLES: dict[str, Document] = {
    "solve_request": request_document(SolveRequest(LEFT, RIGHT, Q, -Q, preset="openwbt", id=7)),
    "reach_request": request_document(
        SolveRequest(
            LEFT,
            RIGHT,
            Q,
            -Q,
            id=11,
            mode="reach",
            waist=WAIST,
            left_elbow=LEFT_ELBOW,
            right_elbow=RIGHT_ELBOW,
            weights=WEIGHTS,
            collision="report",
            starts=32,
        )
    ),
    "solve_batch_request": request_document(
        SolveBatchRequest(
            np.stack([LEFT, RIGHT]),
            np.stack([RIGHT, LEFT]),
            np.stack([Q, -Q]),
            id=12,
            mode="reach",
            waist=np.stack([WAIST, -WAIST]),
            left_elbow=np.stack([LEFT_ELBOW, RIGHT_ELBOW]),
            weights=np.stack([WEIGHTS, WEIGHTS.T]),
            collision="avoid",
            starts=16,
        )
    ),
    "fk_request": request_document(FkRequest(Q, id=8)),
    "clearance_request": request_document(ClearanceRequest(np.stack([Q, -Q]), id=15, waist=WAIST)),
    "velocity_request": request_document(VelocityRequest(TWIST, TWIST[::-1].copy(), Q, -Q, id=16)),
    "boxed_velocity_request": request_document(
        VelocityRequest(
            TWIST[:3],
            -TWIST,
            Q,
            id=17,
            frame="hand",
            law="fixed",
            hold_right=False,
            damping=0.125,
            max_speed=0.75,
            max_acceleration=6.5,
            period=0.0078125,
            posture=Q / 2.0,
            posture_gain=0.25,
            left_bounds=np.array([[0.125, 0.0, -0.25], [0.5, 0.375, 0.625]]),
            waist=WAIST,
            collision="report",
        )
    ),
    "bent_fk_request": request_document(FkRequest(Q, id=13, waist=WAIST)),
    "info_request": request_document(InfoRequest(id=9)),
    "stream_request": {
        **request_document(SolveRequest(LEFT, RIGHT, Q, -Q, id=14)),
        "token": "a secret of two ends",
        "stream": "left controller 3f9a",
        "budget_ms": 12.5,
    },
    "openwbt_request": {
        "left_wrist": LEFT.tolist(),
        "right_wrist": RIGHT.tolist(),
        "current_lr_arm_q": Q.tolist(),
        "current_lr_arm_dq": (-Q).tolist(),
    },
    "solve_reply": reply_document(
        SolveReply(
            success=True,
            error="",
            status=Status.OK,
            id=7,
            boot_id="c0ffee0123456789",
            sol_q=Q + 0.5,
            tau=TAU,
            position_error=np.array([0.00390625, 0.0078125]),
            rotation_error=np.array([0.015625, 0.03125]),
            iterations=4,
            solve_us=11.5,
            server_us=23.25,
        )
    ),
    "blocked_reply": reply_document(
        SolveReply(
            success=True,
            error="",
            status=Status.BLOCKED,
            id=11,
            boot_id="c0ffee0123456789",
            sol_q=Q - 0.5,
            tau=-TAU,
            position_error=np.array([0.0625, 0.0]),
            rotation_error=np.array([0.25, 0.0]),
            iterations=96,
            solve_us=310.5,
            server_us=325.75,
            clearance=0.01171875,
            nearest=("left_forearm", "torso"),
            start=3,
            starts=10,
        )
    ),
    "batch_reply": reply_document(
        BatchReply(
            success=False,
            error="1 of 2 rows did not converge, the first is row 1: hold there, their sol_q is their q",
            status=Status.NOT_CONVERGED,
            id=12,
            boot_id="c0ffee0123456789",
            sol_q=np.stack([Q + 0.5, -Q]),
            statuses=[Status.OK, Status.NOT_CONVERGED],
            tau=np.stack([TAU, -TAU]),
            position_error=np.array([[0.00390625, 0.0078125], [0.5, 0.25]]),
            rotation_error=np.array([[0.015625, 0.03125], [1.0, 2.0]]),
            clearance=np.array([0.03125, 0.015625]),
            start=[2, 0],
            iterations=48,
            solve_us=151.5,
            server_us=183.25,
        )
    ),
    "refusal": reply_document(
        SolveReply(
            success=False,
            error="left_wrist must have shape 4x4, not 3x3",
            status=Status.BAD_REQUEST,
            id=10,
            boot_id="c0ffee0123456789",
            sol_q=Q,
        )
    ),
    "superseded_reply": reply_document(
        SolveReply(
            success=False,
            error="a newer request of its stream came while it waited",
            status=Status.SUPERSEDED,
            id=14,
            boot_id="c0ffee0123456789",
        )
    ),
    "fk_reply": reply_document(
        FkReply(
            success=True,
            error="",
            status=Status.OK,
            id=8,
            boot_id="c0ffee0123456789",
            left_wrist=LEFT,
            right_wrist=RIGHT,
        )
    ),
    "clearance_reply": reply_document(
        ClearanceReply(
            success=True,
            error="",
            status=Status.OK,
            id=15,
            boot_id="c0ffee0123456789",
            clearance=np.array([0.015625, -0.0078125]),
            nearest=("left_hand", "torso"),
        )
    ),
    "velocity_reply": reply_document(
        VelocityReply(
            success=True,
            error="",
            status=Status.OK,
            id=16,
            boot_id="c0ffee0123456789",
            dq=Q / 4.0,
            twists=np.stack([TWIST, TWIST[::-1]]),
            manipulability=np.array([0.0078125, 0.00390625]),
            damping=np.array([0.0, 0.03125]),
            limited_by=("joint", ""),
            limiting_joint=("left_joint_4", None),
            clearance=0.01953125,
            nearest=("left_hand", "torso"),
            solve_us=12.5,
            server_us=31.25,
        )
    ),
    "info_reply": reply_document(
        InfoReply(
            success=True,
            error="",
            status=Status.OK,
            id=9,
            boot_id="c0ffee0123456789",
            protocol=1,
            version="0.1.0",
            robot="g1",
            model_hash="00" * 32,
            joint_names=NAMES,
            lower=-1.0 - Q,
            upper=1.0 + Q,
            velocity=np.full(14, 37.0),
            shoulders=np.array([[0.0, 0.125, 0.25], [0.0, -0.125, 0.25]]),
            reach=np.array([0.5, 0.5]),
            presets=["precise", "openwbt"],
            default_preset="precise",
            kernel="c",
            waist_joints=["waist_yaw", "waist_roll", "waist_pitch"],
            margin=0.0078125,
            capsules=["torso", "left_forearm", "right_forearm"],
            modes=["track", "reach"],
        )
    ),
}

KINDS = {
    "reach_request": "solve_request",
    "stream_request": "solve_request",
    "boxed_velocity_request": "velocity_request",
    "bent_fk_request": "fk_request",
    "blocked_reply": "solve_reply",
    "superseded_reply": "refusal",
}


def files() -> dict[str, bytes]:
    """All golden files by name."""
    contents: dict[str, bytes] = {}
    for name, document in EXAMPLES.items():
        contents[f"{name}.json"] = JSON.encode(document)
        if name != "openwbt_request":
            contents[f"{name}.msgpack"] = MSGPACK.encode(document)
    contents["solve_request.frame"] = encode_frame(contents["solve_request.json"])
    return contents


if __name__ == "__main__":
    for name, content in files().items():
        (FOLDER / name).write_bytes(content)
