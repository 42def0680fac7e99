"""The wire contract of the IK service: messages, validation, codecs, framing, and the robot both ends agree on.

Pure: no sockets, no clocks, no kinematics.
"""

from ik_proto.codec import JSON, MSGPACK, Codec
from ik_proto.errors import DecodeError, FrameTooLarge, ProtocolError, ReplyError, RequestError
from ik_proto.framing import FrameDecoder, encode_frame
from ik_proto.limits import MAX_BATCH, MAX_FRAME_BYTES, MAX_STARTS, PROTOCOL_VERSION
from ik_proto.messages import (
    COLLISIONS,
    MODES,
    Array,
    BatchReply,
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
from ik_proto.replies import parse_batch_reply, parse_fk_reply, parse_info_reply, parse_solve_reply, reply_document
from ik_proto.requests import parse_request, request_document
from ik_proto.status import ANSWERS, STATUS_TABLE, Status, StatusInfo, gravest

__all__ = [
    "ANSWERS",
    "COLLISIONS",
    "JSON",
    "MAX_BATCH",
    "MAX_FRAME_BYTES",
    "MAX_STARTS",
    "MODES",
    "MSGPACK",
    "PROTOCOL_VERSION",
    "STATUS_TABLE",
    "Array",
    "BatchReply",
    "Codec",
    "Collision",
    "DecodeError",
    "Document",
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
    "parse_fk_reply",
    "parse_info_reply",
    "parse_request",
    "parse_solve_reply",
    "reply_document",
    "request_document",
]
