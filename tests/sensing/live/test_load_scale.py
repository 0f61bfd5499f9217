"""A dome of soft silicone reads as a hard one does, in smaller newtons: no limit was made for one stiffness alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import film, frames

from cad.errors import ParameterError
from cad.identity import identity
from cad.materials import silicone
from cad.params import EndcapParams
from sensing import setup
from sensing.live.core.endcap_config import KEPT, EndcapConfig
from sensing.live.core.load_watch import LoadWatch
from sensing.live.core.model import CONTACT_N, live_model, require_reachable
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import ShearField
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.wrench.contact import threshold_from_rest
from sensing.wrench.contact_place import contact_centre
from sensing.wrench.load_scale import load_scale
from sensing.wrench.model import WrenchModel, load_wrench_model
from sensing.wrench.stiffness import weights_digest

DESIGN, SOFT = EndcapParams(130.0, 8.0), "Ecoflex 00-30"
SCALE = silicone(SOFT).neo_hooke().shear_mpa / silicone().neo_hooke().shear_mpa


@pytest.fixture(scope="module")
def hard() -> WrenchModel:
    return load_wrench_model(DESIGN)


@pytest.fixture(scope="module")
def soft(hard) -> WrenchModel:
    """Weights of the same dome in silicone of a seventeenth of the stiffness: the same answers in smaller newtons."""
    cast = replace(hard, identity=identity(DESIGN, SOFT))
    limits = hard.range
    weights = hard.weights | {name: np.float32(SCALE) * hard.weights[name] for name in ("linear", "units")}
    covered = replace(
        limits, force_n=limits.force_n * SCALE, interval_n=limits.interval_n * SCALE,
        rest_px_per_n=limits.rest_px_per_n / SCALE,
    )  # fmt: skip
    return replace(cast, weights=weights, range=covered)


def readings(model: WrenchModel, cast_of: str, press: list[bytes], **options: object) -> list:
    config = EndcapConfig("endcap_0", "test", silicone=cast_of, own_weight=KEPT, **options)
    pipe = EndcapPipeline(config, live_model("default", model, model.shape), zero_frames=1)
    return [pipe.update(frame) for frame in frames(press)]


def test_forces_go_with_stiffness_and_the_square_of_the_wall():
    assert load_wrench_model(DESIGN).load_scale == 1.0  # not a bit of the released design's answers changes
    assert load_scale(16.0, 0.34) == pytest.approx(2.0)


def test_a_soft_dome_reads_as_a_hard_one_in_smaller_newtons(hard, soft):
    press = film([0] * 4 + [0.03, 0.1, 0.25, 0.4, 0.4, 0.4, 0.2, 0.05] + [0] * 3)
    for one, other in zip(readings(hard, "Smooth-Sil 950", press), readings(soft, SOFT, press), strict=True):
        assert np.allclose(other.wrench.force_n, SCALE * one.wrench.force_n, rtol=1e-3, atol=1e-5)
        assert np.allclose(other.wrench.covariance, SCALE**2 * one.wrench.covariance, rtol=1e-2, atol=1e-9)
        assert (other.contact.touching, other.wrench.flags) == (one.contact.touching, one.wrench.flags)
        assert np.allclose(other.place.position_mm, one.place.position_mm, atol=0.01, equal_nan=True)
    assert any(reading.contact.touching and reading.place.known for reading in readings(soft, SOFT, press))


def test_a_dome_that_was_weighed_as_soft_reads_as_a_hard_one_in_smaller_newtons(hard):
    """The same pictures: the forces go with the gain, and where it is touched stays."""
    press = film([0] * 4 + [0.03, 0.1, 0.25, 0.4, 0.4, 0.4, 0.2, 0.05] + [0] * 3)
    gain, plain = 0.06, readings(hard, "Smooth-Sil 950", press)
    weighed = readings(hard, "Smooth-Sil 950", press, gain=gain, gain_weights=weights_digest(hard))
    for one, other in zip(plain, weighed, strict=True):
        assert np.allclose(other.wrench.force_n, gain * one.wrench.force_n, rtol=1e-3, atol=1e-5)
        assert (other.contact.touching, other.wrench.flags) == (one.contact.touching, one.wrench.flags)
        assert np.allclose(other.place.position_mm, one.place.position_mm, atol=0.01, equal_nan=True)
    assert any(reading.place.known for reading in weighed)


def test_a_gain_scales_the_force_at_which_contact_begins(hard):
    model = live_model("default", hard, hard.shape)
    assert model.threshold(gain=0.1).on_n == pytest.approx(0.1 * CONTACT_N)
    assert model.threshold(0.9).off_n == pytest.approx(0.54)  # contact_on_n alone: below 0 it would never end


def test_a_contact_threshold_beyond_all_that_the_weights_know_is_refused(hard):
    """500 mN written as newtons: contact would never begin."""
    model, most_n = live_model("default", hard, hard.shape), hard.range.force_n
    for gain in (1.0, 0.06):
        require_reachable(model, EndcapConfig("left", "0", contact_on_n=0.9 * gain * most_n, gain=gain))
        with pytest.raises(ParameterError, match=r"of left: its weights know forces to .* give newtons"):
            require_reachable(model, EndcapConfig("left", "0", contact_on_n=1.1 * gain * most_n, gain=gain))


def test_a_contact_beside_the_covered_angles_is_flagged_however_soft_the_dome(hard, soft):
    side = np.array([[-5.0, 0, 0, 0, 0, 0]])  # at 90 degrees from the tip
    for model, scale in ((hard, 1.0), (soft, SCALE)):
        assert model._is_beyond(scale * side, np.zeros((1, 6, 6)))[0]


def test_a_soft_dome_that_was_zeroed_under_load_is_named(hard, soft):
    rng, cells = np.random.default_rng(0), hard.shape
    fields = [ShearField(0.0, rng.normal(0, 0.1, (2, *cells)).astype(np.float32)) for _ in range(40)]

    def named(model: WrenchModel) -> list[bool]:
        watch = LoadWatch(replace(model, range=replace(model.range, distance=np.inf, rest_px=np.inf, force_n=np.inf,
                                                       tilt_deg=180.0, interval_n=np.inf)))  # fmt: skip
        found = []
        for field in fields:
            watch.update(field, watch._estimator.estimate(field), touching=False)
            found.append(bool(watch.reason))
        return found

    assert named(soft) == named(hard) and any(named(hard))


def test_setup_takes_a_touch_of_a_soft_dome_for_one(soft):
    dome = SimpleNamespace(pipeline=SimpleNamespace(model=live_model("default", soft, soft.shape)))
    rest = [np.array([0.0, 0.0, 0.002])]
    assert setup._touch_n(dome, rest) == pytest.approx(setup.LEAST_TOUCH_N * SCALE)


def test_the_threshold_that_setup_measures_goes_with_the_endcaps_forces():
    rest = 1e-4 * np.random.default_rng(0).standard_normal((400, 3))
    hard, soft = (threshold_from_rest(scale * rest, load_scale=scale) for scale in (1.0, 0.04))
    assert (soft.on_n, soft.off_n) == pytest.approx((0.04 * hard.on_n, 0.04 * hard.off_n))


def test_a_place_is_known_of_a_force_in_contact_however_soft_the_dome():
    """Contact begins at 0.04 N on the softest dome."""
    force = np.array([0.0, 0.0, -0.04])
    assert contact_centre(force, np.zeros(3), 125.0, 0.0, 0.038).position_mm == pytest.approx([0, 0, 125.0])
    assert np.isnan(contact_centre(force, np.zeros(3), 125.0, 0.0).position_mm).all()


@pytest.mark.parametrize(("wall_mm", "name"), [(8, "Smooth-Sil 950"), (6.5, "Ecoflex 00-30"), (25, "Smooth-Sil 950")])
def test_limits_go_with_the_loads_to_which_weights_are_trained(wall_mm, name):
    """Simulator and estimator share no code, so each has the law; they must not come apart."""
    shear_mpa = silicone(name).neo_hooke().shear_mpa
    geometry = ShellGeometry.from_params(EndcapParams(250, wall_mm))
    assert load_scale(wall_mm, shear_mpa) == pytest.approx(LoadScale.of(geometry, shear_mpa).force, rel=1e-12)
