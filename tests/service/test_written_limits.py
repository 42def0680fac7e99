"""The limits of the service, the tables that quote them, and the page that counts what they cost."""

import re
from dataclasses import fields
from pathlib import Path

from prometheus_client.parser import text_string_to_metric_families

from ik_proto import Status
from ik_service.dispatcher import LARGE_BODY_BYTES
from ik_service.metrics import Metrics
from ik_service.prometheus import MetricsPage
from ik_service.query_pump import _TAKEN
from ik_service.tcp_limits import TcpLimits
from ik_service.worker import WAITING
from ik_service.zenoh_server import _QUEUED_QUERIES

README = Path(__file__).resolve().parents[2] / "proto" / "README.md"
KIB, MIB = 1024, 1024 * 1024
TCP = TcpLimits()
ROWS = {
    "batches and `reach` solves that wait for their turn, of all clients together": f"{WAITING}",
    "body that is read before its connection has shown its token, where one is demanded": (
        f"{LARGE_BODY_BYTES // KIB} KiB"
    ),
    "connections": f"{TCP.connections}",
    "time to complete a frame once begun": f"{TCP.frame_s:g} s, and again for every {TCP.frame_bytes // KIB} KiB of it",
    "requests of one connection": f"{TCP.requests_per_s:,g} a second, {TCP.burst:,} at once after a pause",
    "requests of one connection that wait": f"{TCP.waiting_requests}, or {TCP.waiting_bytes // MIB} MiB",
    "bodies in a row that cannot be decoded, or are `unauthorized`": f"{TCP.hopeless_bodies}",
    "replies a client leaves unread": f"{TCP.unread_bytes // MIB} MiB",
    "silence of the other end's machine": f"{TCP.keepalive_s} s, then 3 questions {TCP.keepalive_s // 3} s apart",
    "TLS handshake": f"{TCP.handshake_s:g} s",
    "queries that wait for one key": f"{_TAKEN} here, {_QUEUED_QUERIES} in the channel before it",
}


def test_the_readme_quotes_every_limit_of_the_service() -> None:
    section = README.read_text().split("## Limits")[1].split("\n## ")[0]
    table = dict(re.findall(r"^\| (.+?) \| (.+?) \|", section, re.MULTILINE))
    assert {what: table.get(what) for what in ROWS} == ROWS
    assert f"silent for {TCP.silent_s:g} s makes place, or for {TCP.first_frame_s:g} s if it never asked" in section
    own_business = {"linger_s", "backlog"}  # no client can tell
    assert {field.name for field in fields(TcpLimits)} - own_business == {
        *("connections", "silent_s", "first_frame_s", "frame_s", "frame_bytes", "requests_per_s", "burst"),
        *("waiting_requests", "waiting_bytes", "unread_bytes", "hopeless_bodies", "handshake_s", "keepalive_s"),
    }


def test_a_scrape_counts_every_outcome_and_every_connection_closed() -> None:
    metrics = Metrics({"version": "0"})
    meter = metrics.meter("tcp")
    for count, status in enumerate(Status, start=1):
        for _ in range(count):
            meter.record(status, 0.001, None)
    metrics.closed["tcp"] = {"late frame": 3, "hopeless bodies": 1}
    values = {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(MetricsPage(metrics).render().decode())
        for sample in family.samples
    }
    assert [values["ik_requests_total", "tcp", status.value] for status in Status] == list(range(1, len(Status) + 1))
    assert values["ik_connections_closed_total", "tcp", "late frame"] == 3
    assert values["ik_connections_closed_total", "tcp", "hopeless bodies"] == 1
