"""What a solve may ask for beyond its targets: it reaches the service, and mistakes are found before."""

from dataclasses import replace

import numpy as np
import pytest
from fake_service import DEFAULTS, EYE, OPTIONS, Q

from ik_client import BadRequest
from ik_proto import FkRequest, Status


def test_what_is_not_asked_for_is_the_protocols_default(ik, service):
    ik.solve(EYE, EYE, Q)
    ik.solve(EYE, EYE, Q, **dict.fromkeys(OPTIONS))
    for request in service.requests[-2:]:
        for name, value in DEFAULTS.items():
            assert getattr(request, name) == value


@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_reaches_the_service(ik, service, name):
    ik.solve(EYE, EYE, Q, **{name: OPTIONS[name]})
    for other, default in DEFAULTS.items():
        got = getattr(service.requests[-1], other)
        if other == name:
            np.testing.assert_array_equal(got, OPTIONS[name])
        else:
            assert got == default


def test_fk_takes_the_waist(ik, service):
    ik.fk(Q, OPTIONS["waist"])
    assert isinstance(service.requests[-1], FkRequest)
    np.testing.assert_array_equal(service.requests[-1].waist, OPTIONS["waist"])
    with pytest.raises(BadRequest, match="waist must have shape 3, not 2"):
        ik.fk(Q, OPTIONS["waist"][:2])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "walk"}, "mode 'walk' is not known, there are track, reach"),
        ({"collision": False}, "collision must be a string, there are off, report, avoid"),
        ({"waist": [0.0]}, "waist must have shape 3, not 1"),
        ({"left_elbow": [0.0, 0.0, 0.0, 1.0]}, "left_elbow points nowhere"),
        ({"right_elbow": [0.0, 0.0, 1.0, 2.0]}, "right_elbow has confidence 2"),
        ({"weights": [1.0, 1.0]}, "weights must have shape 2x2, not 2"),
        ({"starts": 0}, "starts must be an integer from 1 to 256"),
    ],
)
def test_a_mistaken_option_is_found_before_it_is_sent(ik, service, options, message):
    asked = len(service.requests)
    with pytest.raises(BadRequest, match=message) as caught:
        ik.solve(EYE, EYE, Q, **options)
    assert "\n" not in str(caught.value)
    rows = {name: [value] * 2 if isinstance(value, list) else value for name, value in options.items()}
    with pytest.raises(BadRequest) as caught:
        ik.solve_batch([EYE, EYE], [EYE, EYE], [Q, Q], **rows)
    assert "\n" not in str(caught.value)
    assert len(service.requests) == asked


def test_a_reply_says_what_was_looked_at(ik, service):
    plain = ik.solve(EYE, EYE, Q)
    assert (plain.clearance, plain.nearest, plain.start, plain.starts) == (None,) * 4
    service.answer = lambda request: replace(
        service.reply(request),
        status=Status.BLOCKED,
        clearance=0.011,
        nearest=("left_hand", "torso"),
        start=2,
        starts=9,
    )
    reply = ik.solve(EYE, EYE, Q, mode="reach")
    assert reply.success
    assert reply.status is Status.BLOCKED
    assert (reply.clearance, reply.nearest, reply.start, reply.starts) == (0.011, ("left_hand", "torso"), 2, 9)
