"""Drawn dances are the same for a seed, can be danced, and have what is judged; the sets do not overlap."""

import numpy as np
import pytest
from choreography import Choreography
from drawn_dance import drawn_dance, drawn_posture
from material import Material, render
from subjects import JUDGING, JUDGING_SEEDS, TUNING, TUNING_SEEDS, Subject, Take, takes

from camera_client.landmarks import COUNT, TRACKED, Landmarks


def test_a_seed_is_a_dance():
    one, same, other = drawn_dance(5), drawn_dance(5), drawn_dance(6)
    assert one == same
    assert one.keys != other.keys


@pytest.mark.parametrize("seed", [*TUNING_SEEDS, *JUDGING_SEEDS])
def test_a_dance_has_what_is_judged(seed):
    dance = drawn_dance(seed)
    times = np.array([key[0] for key in dance.keys])
    assert (np.diff(times) > 0.0).all()
    assert dance.wave[1] - dance.wave[0] == pytest.approx(4.0)
    assert dance.turn[1] - dance.turn[0] == pytest.approx(3.0)
    assert 0.0 <= dance.t_pose[0] < dance.t_pose[1] <= 2.0
    still = [b - a for (a, *p), (b, *q) in zip(dance.keys, dance.keys[1:], strict=False) if p == q]
    assert max(still) > 1.0


def test_postures_can_be_taken():
    rng = np.random.default_rng(0)
    for _ in range(200):
        u, f = (np.array(limb) for limb in drawn_posture(rng))
        assert np.linalg.norm(u) == pytest.approx(1.0)
        assert np.linalg.norm(f) == pytest.approx(1.0)
        assert u @ f >= np.cos(np.radians(140.0)) - 1e-9
        hand = np.array([0.0, 0.175, 0.48]) + 0.29 * u + 0.25 * f
        assert not (hand[0] < 0.17 and hand[1] < 0.26 and hand[2] < 0.60)


def test_nobody_is_tuned_on_and_judged_by():
    assert not {subject.name for subject in TUNING} & {subject.name for subject in JUDGING}
    assert not {subject.stretch for subject in TUNING} & {subject.stretch for subject in JUDGING}
    assert not set(TUNING_SEEDS) & set(JUDGING_SEEDS)
    assert not {take.name for take in takes(fresh=True)} & {take.name for take in takes(fresh=False)}


def test_material_comes_back_as_it_was_rendered(person_folder, scene, tmp_path):
    assert scene
    dance = Choreography(((0.0, "T", "T"), (0.2, "e90", "hang")))
    seen = []

    def detect(colour: np.ndarray, t: float) -> Landmarks | None:
        seen.append((colour.copy(), t))
        if len(seen) == 2:
            return None
        rng = np.random.default_rng(len(seen))
        return Landmarks(rng.uniform(0.0, 300.0, (COUNT, 2)), rng.random(COUNT), rng.standard_normal((COUNT, 3)))

    take = Take(Subject("somebody", (1.0, 1.0, 1.0)), "short", dance, fresh=False)
    render(take, person_folder, detect, tmp_path / "take.npz")
    material = Material(tmp_path / "take.npz", dance)
    moments = list(material.moments())
    assert len(moments) == len(seen) == len(material.landmarks) == 6
    assert np.isnan(material.landmarks[1].pixels).all()
    assert (material.landmarks[1].visibility == 0.0).all()
    rng = np.random.default_rng(1)
    assert np.allclose(material.landmarks[0].pixels[TRACKED], rng.uniform(0.0, 300.0, (COUNT, 2))[TRACKED])
    # The surface before the right hip is a little before its joint.
    for now in moments:
        column, row = np.rint(
            [515.0 * now.in_camera[7, k] / now.in_camera[7, 2] + c for k, c in ((0, 319.5), (1, 179.5))]
        )
        assert 0.0 < now.in_camera[7, 2] - now.depth[int(row), int(column)] < 0.25
    assert not np.array_equal(seen[0][0], seen[1][0])
