"""The law of the rate loop is told to the service by the words, and with the defaults, of `IKClient.velocity`."""

import inspect
from dataclasses import fields

from ik_client import IKClient
from ik_client.rate_types import RateKinematics, RateLaw

GIVEN_BY_THE_LOOP = {"frame", "period", "waist"}


def keywords(method) -> dict:
    """Keyword-only arguments and their defaults."""
    found = inspect.signature(method).parameters.values()
    return {one.name: one.default for one in found if one.kind is one.KEYWORD_ONLY}


def test_the_law_has_every_option_of_a_velocity_with_its_default():
    options = keywords(IKClient.velocity)
    assert {field.name: field.default for field in fields(RateLaw)} == {
        name: default for name, default in options.items() if name not in GIVEN_BY_THE_LOOP
    }
    assert options.keys() > GIVEN_BY_THE_LOOP


def test_what_the_loop_needs_of_a_client_is_what_a_client_has():
    assert keywords(RateKinematics.velocity).keys() == keywords(IKClient.velocity).keys()


def test_what_is_left_to_the_service_is_not_told():
    assert RateLaw().options.keys() == {"law", "hold", "damping", "max_speed", "max_acceleration", "posture_gain"}
    assert RateLaw(collision="off", damping=0.2).options["collision"] == "off"
