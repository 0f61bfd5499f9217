"""``sensing.weigh`` as a user runs it: a simulated endcap of softer silicone, the guide, the file that it changes."""

import itertools
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from live_stand_in import SHAPE, film, frames, stand_in

from cad.errors import FileError
from cad.materials import silicone
from cad.params import EndcapParams
from sensing import weigh
from sensing.live.core.config import LiveConfig
from sensing.live.core.config_entries import change_entries
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config, save_config
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading, without_numbers
from sensing.live.core.state import Event
from sensing.live.open_endcaps import configured_models
from sensing.records import Wrench
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry
from sensing.weighing.at_rest import RestWatch
from sensing.weighing.gain import WeighingError
from sensing.weighing.words import GRAVITY_M_S2
from sensing.wrench.stiffness import OTHER_WEIGHTS

SOFT = "Smooth-Sil 940"
MINE = """# my lab
[[endcap]]
name = "soft"  # the new one
source = "0"
silicone = "Smooth-Sil 940"
contact_on_n = 0.8
contact_off_n = 0.5
"""


def variants(picture: bytes, count: int) -> list[bytes]:
    """Pictures that differ in a corner without dots, as noise makes them differ."""
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    found = []
    for index in range(count):
        image[-4:, : 1 + index % 600] ^= 8
        found.append(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())
    return found


@pytest.fixture(scope="module")
def soft(tmp_path_factory):
    """Folders of films of a softer endcap under known weights on a level table, by weight in g."""
    simulator = Simulator(shell_geometry(130, 8), silicone(SOFT).neo_hooke(), "draft")
    surface = simulator.surface
    settings = RenderSettings(seed=3).at_level("draft")
    renderer = DomeRenderer(EndcapParams(130, 8), None, settings, surface.position, surface.interpolation)
    weights_g, folders = (600.0, 1800.0, 1200.0), {}
    targets = [Target(normal_n=weight / 1000 * GRAVITY_M_S2) for weight in sorted(weights_g)]
    rest = renderer.render(frame=0).jpeg
    states = simulator.follow(Scene(Indenter(0.0), 0.5), targets)
    for weight, state in zip(sorted(weights_g), states, strict=True):
        folder = tmp_path_factory.mktemp(f"g{weight:g}")
        pressed = renderer.render(state.surface_mm, frame=int(weight)).jpeg
        for number, jpeg in enumerate([*variants(rest, 4), *variants(pressed, 40)]):
            (folder / f"{number:03d}.jpg").write_bytes(jpeg)
        folders[weight] = folder
    return folders


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_text(MINE)
    return path


def answer(endcap: EndcapConfig, folder) -> EndcapReading:
    """The last reading of a film."""
    pipeline = EndcapPipeline(replace(endcap, source="test"), load_model("default", endcap.params), None, 0, 1)
    pictures = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    return [pipeline.update(frame) for frame in frames(pictures)][-1]


def run(path, *words, ask=None) -> int:
    return weigh.main(["--config", str(path), *words], ask or pytest.fail)


def test_weights_of_another_silicone_are_refused_until_it_is_weighed(mine):
    config = load_config(mine)
    with pytest.raises(FileError, match=r"in Smooth-Sil 940.* weigh it"):
        configured_models(config)(config.endcaps[0])
    change_entries(mine, {"soft": {"gain": 0.73, "gain_sd": 0.01}})
    config = load_config(mine)
    assert configured_models(config)(config.endcaps[0]).method == "dots"


@pytest.mark.long
def test_two_weights_make_a_softer_endcap_right(soft, mine, capsys):
    poses = [f"--pose=tilt=0,grams={weight:g},source={soft[weight]}" for weight in (600.0, 1800.0)]
    before = load_config(mine).endcaps[0]
    assert run(mine, *poses, "--dry-run") == 0 and mine.read_text() == MINE
    assert run(mine, *poses) == 0
    said = capsys.readouterr().out
    assert "level table shows the force along the axis only" in said and "stored for soft" in said
    after = load_config(mine).endcaps[0]
    assert after.gain == pytest.approx(0.249 / 0.34, rel=0.04) and abs(after.gain - 0.249 / 0.34) < 3 * after.gain_sd
    assert "# my lab" in mine.read_text() and after.contact_on_n == pytest.approx(0.8 * after.gain, rel=1e-3)
    true_n = -1.2 * GRAVITY_M_S2  # a weight that the gain was not found with
    wrong, right = (float(answer(endcap, soft[1200.0]).wrench.force_n[2]) - true_n for endcap in (before, after))
    assert abs(wrong) > 3 and abs(right) < 0.4 and "calibrated by weight on 20" in after.weighed


def test_a_gain_of_other_weights_is_flagged(soft):
    endcap = EndcapConfig("soft", "0", gain=0.73, gain_sd=0.01, gain_weights="0123456789abcdef")
    reading = answer(endcap, soft[600.0])
    assert reading.event is Event.FLAGGED and OTHER_WEIGHTS in reading.wrench.flags and reading.valid


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pose=tilt=0,grams=600,source={600}"], "1 pose: at least 2"),
        (["--pose=tilt=0,grams=600,source={600}", "--pose=tilt=0,grams=600,source={600}"], "differ by a factor"),
        (["--pose=tilt=0,grams=600,source={600}", "--pose=tilt=0,grams=1200,source={1800}"], "contradict one another"),
        (["--pose=grams=0.6,source={600}", "--pose=grams=1.8,source={1800}"], "was it 0.6 kg or 0.6 lb"),
        (["--pose=grams=600,source=nowhere", "--pose=grams=1800,source={1800}"], "nowhere: no such file"),
        (["--gravity=981", "--pose=grams=600,source={600}", "--pose=grams=1800,source={1800}"], "gravity=981 outside"),
        (["--endcap=other", "--pose=grams=600,source={600}"], "choose one of soft"),
        (["--postures=none.csv"], "weight_n is missing"),
    ],
)  # fmt: skip
def test_what_is_refused_is_one_line_and_stores_nothing(soft, mine, capsys, words, said):
    filled = [word.replace("{600}", str(soft[600.0])).replace("{1800}", str(soft[1800.0])) for word in words]
    assert run(mine, *filled) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("sensing.weigh: ") and said in error and mine.read_text() == MINE


def test_an_endcap_that_is_never_loaded_is_refused(soft, mine, capsys, tmp_path):
    folder = tmp_path / "rest"
    folder.mkdir()
    for number, jpeg in enumerate(variants((soft[600.0] / "000.jpg").read_bytes(), 40)):
        (folder / f"{number:03d}.jpg").write_bytes(jpeg)
    words = [f"--pose=grams=600,source={folder}", f"--pose=grams=1800,source={soft[1800.0]}"]
    assert run(mine, *words) == 2
    assert "600 g" in (said := capsys.readouterr().err) and "no contact: the largest force is 0.0" in said


# --- guided --------------------------------------------------------------------------------------------------------
def test_the_guide_refuses_and_lets_try_again(monkeypatch, soft, mine, capsys):
    films = {weight: [path.read_bytes() for path in sorted(soft[weight].glob("*.jpg"))[5:]] for weight in (600, 1800)}
    films[0] = variants((soft[600.0] / "000.jpg").read_bytes(), 30)
    shown, asked = {"weight": 0}, []

    def camera():
        for count in itertools.count():
            time.sleep(1 / 30)
            jpegs = films[shown["weight"]]
            yield replace(frames([jpegs[count % len(jpegs)]])[0], time_s=time.monotonic(), sequence=count)

    def opened(config, models):
        endcap = config.endcaps[0]
        return [LiveEndcap(CameraFeed(camera), EndcapPipeline(endcap, models(endcap), None, 0, 1))]

    steps = iter([
        (0, ""), (0, "5 stone"), (0, "600"), (600, ""), (600, ""), (600, "1.8 kg"), (1800, ""), (1800, "20"),
        (1800, ""), (1800, "900"), (1800, ""), (0, ""),
    ])  # fmt: skip

    def ask(text):
        asked.append(text)
        shown["weight"], word = next(steps)
        return word

    monkeypatch.setattr(weigh, "open_endcaps", opened)
    assert run(mine, ask=ask) == 0
    said = capsys.readouterr().out
    assert "leave it untouched" in asked[0] and "or Enter to finish" in asked[-1] and "no unit of weight" in said
    assert "refused: '' is no weight" in said and "refused: 20 g:" in said and "was it" in said
    assert "refused: the weights contradict one another" in said and "from 2 poses" in said
    assert load_config(mine).endcaps[0].gain == pytest.approx(0.249 / 0.34, rel=0.04)


# --- what stands still -----------------------------------------------------------------------------------------------
def readings(forces, rate_hz=30.0, flags=frozenset(), reason="", touches_n=1.0):
    frame, zero = frames(film([0]))[0], None
    blank = without_numbers("soft", 0, frame, SHAPE, zero, 1, 0.0, None)
    for number, force in enumerate(forces):
        estimate = Wrench(
            number / rate_hz, np.array([0.0, 0.0, -force]), np.zeros(3), "endcap", np.eye(6) * 1e-4, flags
        )
        contact = replace(blank.contact, touching=force > touches_n, known=True)
        event = Event.FLAGGED if flags else Event.GOOD
        yield replace(blank, estimate=estimate, wrench=estimate, contact=contact, event=event, reason=reason)


def watched(*args, **options) -> RestWatch:
    watch = RestWatch()
    for reading in readings(*args, **options):
        watch.add(reading)
    return watch


def test_the_last_interval_at_rest_counts_after_creep():
    time_s = np.arange(240) / 30
    creep = 10 + 0.5 * (1 - np.exp(-time_s))
    rest = watched([*np.zeros(30), *creep, *np.linspace(10, 0, 10), *np.zeros(30)]).pressed()
    assert rest.wrench[2] == pytest.approx(-np.median(creep[-30:]), abs=0.01) and rest.covariance[
        2, 2
    ] == pytest.approx(1e-4)


@pytest.mark.parametrize(
    ("forces", "options", "said"),
    [
        ([0.0] * 60, {}, "no contact: the largest force is 0.00 N"),
        (list(np.linspace(2, 20, 90)), {}, "not at rest: the force moves by 3.1"),
        (list(10 + np.tile([1.0, -1.0], 50)), {}, "not at rest"),
        ([10.0] * 60, {"flags": frozenset({"out_of_range"}), "reason": "unlike training"}, r"out_of_range\): unlike"),
        (
            [83.5] * 60,
            {"flags": frozenset({"dots_lost"}), "touches_n": 99.0},
            r"83\.50 N, is flagged \(dots_lost\): are these pictures of",
        ),
        ([0.0] * 60 + [10.0] * 10, {}, "lasts for less than 1 s"),
        ([], {}, "fewer than 5 readings"),
    ],
)
def test_what_does_not_stand_still_under_a_load_is_refused(forces, options, said):
    with pytest.raises(WeighingError, match=said):
        watched(forces, **options).pressed()


def test_a_load_while_it_should_be_untouched_is_refused():
    assert watched([0.1] * 60).untouched().wrench[2] == pytest.approx(-0.1)
    with pytest.raises(WeighingError, match=r"2\.0 N while it should be untouched"):
        watched([2.0] * 60).untouched()


# --- endcaps.toml -----------------------------------------------------------------------------------------------------
def test_only_the_asked_entries_change(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_text(MINE + '\n[[endcap]]\nname = "b"\nsource = "1"\ngain = 0.5\n\n# the end\n')
    change_entries(path, {"soft": {"gain": 0.73, "gain_date": "2026-01-01"}})
    change_entries(path, {"b": {"gain": 0.9}})
    change_entries(path, {"soft": {"gain": 0.74}})
    text = path.read_text()
    assert [endcap.gain for endcap in load_config(path).endcaps] == [0.74, 0.9]
    assert (
        text.count("gain = ") == 2 and "# the new one" in text and "# the end" in text and text.startswith("# my lab")
    )


def test_a_file_that_cannot_be_changed_safely_is_left(tmp_path):
    path = tmp_path / "endcaps.toml"
    text = 'endcap = [{name = "a", source = "0"}]\n'
    path.write_text(text)
    with pytest.raises(FileError, match=r"by hand, under a: gain = 0\.7"):
        change_entries(path, {"a": {"gain": 0.7}})
    with pytest.raises(FileError, match="no endcap b: it has a"):
        change_entries(path, {"b": {"gain": 0.7}})
    assert path.read_text() == text


def test_a_gain_survives_the_file_and_nonsense_is_refused(tmp_path):
    path = tmp_path / "endcaps.toml"
    save_config(LiveConfig((EndcapConfig("a", "0", gain=0.7, gain_sd=0.01, gain_date="2026-01-01"),)), path)
    assert load_config(path).endcaps[0].gain_sd == 0.01
    for line in ("gain = 0.0", "gain = -1", 'gain = "soft"', "gain_sd = 2.0", "gain = nan", "gain_date = 3"):
        path.write_text(f'[[endcap]]\nname = "a"\nsource = "0"\n{line}\n')
        with pytest.raises(ValueError, match="gain"):
            load_config(path)


def test_the_pipeline_scales_and_a_stand_in_knows_no_weights():
    plain, scaled = (
        EndcapPipeline(EndcapConfig("a", "0", gain=gain, gain_sd=sd), stand_in(), None, 0, 1)
        for gain, sd in ((1.0, 0.0), (0.5, 0.02))
    )
    given = frames(film([0, 0, 1.0, 1.0]))
    a, b = ([pipeline.update(frame) for frame in given][-1].estimate for pipeline in (plain, scaled))
    assert b.force_n == pytest.approx(0.5 * a.force_n) and np.abs(a.force_n).max() > 5
    assert b.covariance[0, 0] > 0.25 * a.covariance[0, 0]
