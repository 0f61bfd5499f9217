"""The released network, its data format and its recipe; the checkpoint is tested where the reference is there."""

import csv
import http.server
import json
import threading
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from sensing.decode import decode_bgr
from sensing.learning.authors_dataset import download_authors_dataset, read_authors_dataset
from sensing.records import Frame, ShearField
from sensing.sources.files import read_picture
from sensing.tracking.gelslim import GelslimField

torch = pytest.importorskip("torch")

from sensing.learning.paper_recipe import random_split, train_paper_model  # noqa: E402
from sensing.wrench.paper_model import PaperEstimator, PaperModel, load_paper_model, predict  # noqa: E402

PLACES = [parent / "shared" / "reference" / "wrench_regression_model.pth" for parent in Path(__file__).parents]
CHECKPOINT = next((place for place in PLACES if place.exists()), Path("none"))
needs_reference = pytest.mark.skipif(
    not CHECKPOINT.exists(), reason="the authors' checkpoint is not beside this checkout"
)


def literal(weights, x):
    """The forward pass written out again, in numpy, from NET08 of docs/provenance.md."""
    w = {name: value.numpy().astype(float) for name, value in weights.items()}

    def linear(name, x):
        return x @ w[f"{name}.weight"].T + w[f"{name}.bias"]

    for block in ("res_blocks.0", "res_blocks.1"):
        inside = linear(f"{block}.fc2", np.maximum(linear(f"{block}.fc1", x), 0))
        past = linear(f"{block}.shortcut", x) if f"{block}.shortcut.weight" in w else x
        x = np.maximum(inside + past, 0)
    return linear("fc_out", x)


@pytest.fixture(scope="module")
def released():
    return load_paper_model(CHECKPOINT)


@pytest.fixture
def random_model():
    torch.manual_seed(3)
    return PaperModel().eval()


def test_forward_pass_is_the_description_written_out(random_model):
    x = np.random.default_rng(0).normal(size=(5, 2, 30, 30)).astype(np.float32)
    assert np.abs(predict(random_model, x) - literal(random_model.state_dict(), x.reshape(5, -1))).max() < 1e-4


@needs_reference
def test_checkpoint_answers_1_8_n_at_zero_shear_so_its_threshold_is_always_passed(released):
    rest = predict(released, np.zeros((1, 2, 30, 30), np.float32))[0]
    assert np.linalg.norm(rest[:3]) == pytest.approx(1.8, abs=0.05)  # M, NET25
    field = ShearField(0.0, np.zeros((2, 30, 30), np.float32))
    wrench = PaperEstimator(released).estimate(field)
    assert np.allclose(np.concatenate([wrench.force_n, wrench.torque_nm]), -rest)  # published negated
    assert np.linalg.norm(wrench.force_n) > 0.2
    assert not PaperEstimator(released, threshold_n=2.0).estimate(field).force_n.any()  # the one-camera node is silent


@needs_reference
@pytest.mark.parametrize("number", [0, 1, 2])
def test_checkpoint_on_the_photos(released, number):
    photo = read_picture(CHECKPOINT.parent / "photos" / f"endcap_{number}.jpg")
    worker = GelslimField(photo)
    rest = predict(released, np.zeros((1, 2, 30, 30), np.float32))[0]
    same = predict(released, worker.update(photo).channels[None])[0]
    assert np.linalg.norm((same - rest)[:3]) < 0.05  # a photo against itself is zero shear, but for the flow's noise

    image = decode_bgr(photo).astype(float)
    down = 1 - 0.5 * np.linspace(0, 1, len(image))[:, None, None]
    moved = []
    for lamp in (0.7, 1.3, down):
        picture = Frame(0.0, 1, "lamp", image=np.clip(image * lamp, 0, 255).astype(np.uint8))
        moved.append(np.linalg.norm((predict(released, worker.update(picture).channels[None])[0] - rest)[:3]))
    assert max(moved) > 1.0  # M, NET26


def test_weights_of_another_network_and_pickles_are_refused(tmp_path):
    other = tmp_path / "other.pth"
    torch.save(torch.nn.Linear(3, 2).state_dict(), other)
    with pytest.raises(FileError, match="not the weights of the released network"):
        load_paper_model(other)
    torch.save(PaperModel(), other)  # a whole pickled object
    with pytest.raises(FileError, match="not the weights of the released network"):
        load_paper_model(other)
    broken = PaperModel()
    broken.fc_out.bias.data[2] = float("nan")
    torch.save(broken.state_dict(), other)
    with pytest.raises(FileError, match="not finite"):
        load_paper_model(other)
    with pytest.raises(FileError, match="cannot read"):
        load_paper_model(tmp_path / "none.pth")


def test_estimator_refuses_other_fields(random_model):
    estimator = PaperEstimator(random_model)
    with pytest.raises(ParameterError, match="takes"):
        estimator.estimate(ShearField(0.0, np.zeros((2, 18, 18), np.float32)))
    with pytest.raises(ParameterError, match="finite"):
        estimator.estimate(ShearField(0.0, np.full((2, 30, 30), np.nan, np.float32)))


def write_authors_folder(folder, count, seed=0, absolute=False):
    """A stand-in for the authors' folder: fields whose labels are a linear function of them."""
    rng = np.random.default_rng(seed)
    (folder / "shear_fields").mkdir(parents=True)
    truth = rng.normal(size=(6, 1800)) / 40
    with (folder / "index.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["stamp", "wrench", "array_path"])
        for number in range(count):
            array = rng.normal(size=(2, 30, 30)).astype(np.float32)
            np.save(folder / "shear_fields" / f"{number:06d}.npy", array)
            path = f"shear_fields/{number:06d}.npy"
            writer.writerow([number, str((truth @ array.ravel()).tolist()), f"/home/a/{path}" if absolute else path])
    return truth


@pytest.mark.parametrize("absolute", [False, True])
def test_authors_folder_is_read_unchanged(tmp_path, absolute):
    truth = write_authors_folder(tmp_path, 5, absolute=absolute)
    data = read_authors_dataset(tmp_path)
    assert data.fields.shape == (5, 2, 30, 30)
    assert np.allclose(data.fields.reshape(5, -1) @ truth.T, data.wrenches, atol=1e-4)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('wrench,array_path\n"[1,2,3,4,5]",shear_fields/000000.npy\n', "line 2: wrench=.* not six"),
        ('wrench,array_path\n"[1,2,3,4,5,nan]",shear_fields/000000.npy\n', "not six finite"),
        ("force,array_path\n1,2\n", "no column wrench"),
        ("wrench,array_path\n", "without rows"),
        ('wrench,array_path\n"[1,2,3,4,5,6]",shear_fields/9.npy\n', "no readable array"),
        ('wrench,array_path\n"[1,2,3,4,5,6]",../../secret.npy\n', "shear_fields/secret.npy"),
    ],
)
def test_bad_rows_are_named(tmp_path, text, said):
    write_authors_folder(tmp_path, 1)
    (tmp_path / "index.csv").write_text(text)
    with pytest.raises(FileError, match=said):
        read_authors_dataset(tmp_path)


def test_array_of_another_shape_is_named(tmp_path):
    write_authors_folder(tmp_path, 1)
    np.save(tmp_path / "shear_fields" / "000000.npy", np.zeros((2, 18, 18)))
    with pytest.raises(FileError, match=r"000000.npy: shape \(2, 18, 18\)"):
        read_authors_dataset(tmp_path)


def test_recipe_learns_keeps_the_best_epoch_and_repeats(tmp_path):
    write_authors_folder(tmp_path, 120)
    data = read_authors_dataset(tmp_path)
    seen = []
    first = train_paper_model(data.fields, data.wrenches, 1, epochs=12, progress=lambda *row: seen.append(row))
    again = train_paper_model(data.fields, data.wrenches, 1, epochs=12)
    assert np.array_equal(first.history, again.history) and len(seen) == 12
    assert first.best_epoch == int(first.history[:, 1].argmin()) + 1
    assert first.validation_mse == pytest.approx(first.history[:, 1].min(), rel=1e-6)
    assert first.train_mse < 0.5 * float((data.wrenches**2).mean())
    shares = [len(part) for part in random_split(1000, 0)]
    assert shares == [700, 150, 150] and len(np.unique(np.concatenate(random_split(1000, 0)))) == 1000


def test_recipe_refuses_bad_samples():
    with pytest.raises(ParameterError, match="need"):
        train_paper_model(np.zeros((9, 2, 30, 30), np.float32), np.zeros((9, 5), np.float32))
    with pytest.raises(ParameterError, match="finite"):
        train_paper_model(np.zeros((9, 2, 30, 30), np.float32), np.full((9, 6), np.inf, np.float32))


class Hub(http.server.BaseHTTPRequestHandler):
    """The few answers of a model hub that fetching one small data set needs."""

    files: ClassVar[dict[str, bytes]] = {}
    fetched: ClassVar[list[str]] = []
    commit = "0123456789" * 4

    def do_HEAD(self):
        self.answer(body=False)

    def do_GET(self):
        self.answer(body=True)

    def answer(self, body):
        base = "/api/datasets/jonathantwz/gelfoot"
        path = self.path.split("?")[0]
        if path.startswith(f"{base}/revision/") or path == base:
            found = {
                "id": "jonathantwz/gelfoot",
                "sha": self.commit,
                "siblings": [{"rfilename": n} for n in self.files],
            }
            self.reply(json.dumps(found).encode(), "application/json", body)
        elif path.startswith(f"{base}/tree/"):
            rows = [{"type": "file", "path": n, "size": len(d), "oid": n} for n, d in self.files.items()]
            self.reply(json.dumps(rows).encode(), "application/json", body)
        elif "/resolve/" in path and (name := path.split("/resolve/")[1].split("/", 1)[1]) in self.files:
            if body:
                self.fetched.append(name)
            self.reply(self.files[name], "application/octet-stream", body)
        else:
            self.send_response(404)
            self.send_header("X-Error-Code", "RepoNotFound")
            self.send_header("Content-Length", "0")
            self.end_headers()

    def reply(self, data, kind, body):
        self.send_response(200)
        for name, value in (("Content-Type", kind), ("Content-Length", str(len(data))), ("X-Repo-Commit", self.commit)):
            self.send_header(name, value)
        self.send_header("ETag", f'"{len(data):040d}"')
        self.end_headers()
        if body:
            self.wfile.write(data)

    def log_message(self, *_):
        pass


@pytest.fixture
def hub(tmp_path):
    pytest.importorskip("huggingface_hub")
    write_authors_folder(tmp_path / "origin", 3)
    origin = tmp_path / "origin"
    Hub.files = {str(p.relative_to(origin)): p.read_bytes() for p in origin.rglob("*") if p.is_file()}
    Hub.fetched = []
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hub)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def test_download_from_a_local_stand_in(hub, tmp_path):
    found = download_authors_dataset(tmp_path / "here", endpoint=hub)
    assert np.array_equal(read_authors_dataset(found).wrenches, read_authors_dataset(tmp_path / "origin").wrenches)
    count = len(Hub.fetched)
    assert count == 4
    download_authors_dataset(tmp_path / "here", endpoint=hub)
    assert len(Hub.fetched) == count  # nothing is fetched twice


def test_download_says_what_is_wrong(hub, tmp_path):
    with pytest.raises(FileError, match="nobody/nothing: cannot be fetched"):
        download_authors_dataset(tmp_path / "a", "nobody/nothing", endpoint=hub)
    Hub.files = {"archive.zip": b"PK"}
    with pytest.raises(FileError, match=r"without an index.csv"):
        download_authors_dataset(tmp_path / "b", endpoint=hub)
