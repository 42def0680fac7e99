"""What a robot's eyes see, from the process that renders or films it to those who watch.

A picture pair is a stereo packet of `ik_proto.stereo_packet`; the newest counts, and nothing is queued. It travels
through shared memory on one machine (`shm:NAME`), or over Zenoh (`zenoh://HOST:PORT`, key `ik/<robot>/eyes`). Pictures
are made only while somebody watches.
"""

from ik_client.eyes.source import EyePublisher, EyesError, EyeSource, open_eyes, open_publisher

__all__ = ["EyePublisher", "EyeSource", "EyesError", "open_eyes", "open_publisher"]
