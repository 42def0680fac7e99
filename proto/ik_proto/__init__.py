"""The wire contract of the IK service: messages, validation, codecs, framing, and the robot both ends agree on.

Pure: no sockets, no clocks, no kinematics.
"""

from ik_proto.codec import JSON, MSGPACK, Codec
from ik_proto.envelope import Envelope, read_envelope
from ik_proto.errors import DecodeError, FrameTooLarge, ProtocolError, ReplyError, RequestError
from ik_proto.framing import FrameDecoder, encode_frame
from ik_proto.limits import MAX_BATCH, MAX_FRAME_BYTES, MAX_POSTURES, MAX_STARTS, PROTOCOL_VERSION
from ik_proto.messages import (
    COLLISIONS,
    MODES,
    Array,
    BatchReply,
    ClearanceReply,
    ClearanceRequest,
    Collision,
    Document,
    FkReply,
    FkRequest,
    InfoReply,
    InfoRequest,
    Mode,
    Reply,
    Request,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
)
from ik_proto.replies import (
    parse_batch_reply,
    parse_clearance_reply,
    parse_fk_reply,
    parse_info_reply,
    parse_solve_reply,
    reply_document,
)
from ik_proto.requests import parse_request, request_document
from ik_proto.status import ANSWERS, STATUS_TABLE, Status, StatusInfo, gravest

__all__ = [
    "ANSWERS",
    "COLLISIONS",
    "JSON",
    "MAX_BATCH",
    "MAX_FRAME_BYTES",
    "MAX_POSTURES",
    "MAX_STARTS",
    "MODES",
    "MSGPACK",
    "PROTOCOL_VERSION",
    "STATUS_TABLE",
    "Array",
    "BatchReply",
    "ClearanceReply",
    "ClearanceRequest",
    "Codec",
    "Collision",
    "DecodeError",
    "Document",
    "Envelope",
    "FkReply",
    "FkRequest",
    "FrameDecoder",
    "FrameTooLarge",
    "InfoReply",
    "InfoRequest",
    "Mode",
    "ProtocolError",
    "Reply",
    "ReplyError",
    "Request",
    "RequestError",
    "SolveBatchRequest",
    "SolveReply",
    "SolveRequest",
    "Status",
    "StatusInfo",
    "encode_frame",
    "gravest",
    "parse_batch_reply",
    "parse_clearance_reply",
    "parse_fk_reply",
    "parse_info_reply",
    "parse_request",
    "parse_solve_reply",
    "read_envelope",
    "reply_document",
    "request_document",
]
