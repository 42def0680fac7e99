"""The wire contract of the IK service: messages, validation, codecs, framing, and the robot both ends agree on.

Pure: no sockets, no clocks, no kinematics.
"""

from ik_proto.codec import JSON, MSGPACK, Codec
from ik_proto.errors import DecodeError, FrameTooLarge, ProtocolError, ReplyError, RequestError
from ik_proto.framing import FrameDecoder, encode_frame
from ik_proto.limits import MAX_FRAME_BYTES, PROTOCOL_VERSION
from ik_proto.messages import (
    Array,
    Document,
    FkReply,
    FkRequest,
    InfoReply,
    InfoRequest,
    Reply,
    Request,
    SolveReply,
    SolveRequest,
)
from ik_proto.replies import parse_fk_reply, parse_info_reply, parse_solve_reply, reply_document
from ik_proto.requests import parse_request, request_document
from ik_proto.status import STATUS_TABLE, Status, StatusInfo

__all__ = [
    "JSON",
    "MAX_FRAME_BYTES",
    "MSGPACK",
    "PROTOCOL_VERSION",
    "STATUS_TABLE",
    "Array",
    "Codec",
    "DecodeError",
    "Document",
    "FkReply",
    "FkRequest",
    "FrameDecoder",
    "FrameTooLarge",
    "InfoReply",
    "InfoRequest",
    "ProtocolError",
    "Reply",
    "ReplyError",
    "Request",
    "RequestError",
    "SolveReply",
    "SolveRequest",
    "Status",
    "StatusInfo",
    "encode_frame",
    "parse_fk_reply",
    "parse_info_reply",
    "parse_request",
    "parse_solve_reply",
    "reply_document",
    "request_document",
]
