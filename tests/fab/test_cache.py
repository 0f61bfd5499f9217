"""The cache of exports: whole entries or none, damage is noticed, its size is bounded, code is part of the key."""

from __future__ import annotations

import errno
import multiprocessing
import os
import shutil
from pathlib import Path

import pytest

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab import cache as module
from fab.cache import ROOT, SOURCES, SUFFIXES, Cache, code_digest
from fab.variant import Variant


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "cache", limit_bytes=1000)


def stored(cache: Cache, tmp_path: Path, key: str, **files: str) -> None:
    source = tmp_path / f"source_{key}"
    source.mkdir()
    for name, text in files.items():
        (source / name).write_text(text)
    cache.store(key, source, sorted(files), {"summary": key})


def restored(cache: Cache, tmp_path: Path, key: str) -> dict[str, str] | None:
    target = tmp_path / "target"
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    values = cache.restore(key, target)
    files = {path.name: path.read_text() for path in target.iterdir()}
    assert values is not None or files == {}
    return None if values is None else files


def test_an_entry_comes_back_as_it_was(cache, tmp_path):
    assert restored(cache, tmp_path, "a") is None
    stored(cache, tmp_path, "a", base="solid", cup="cup")
    assert restored(cache, tmp_path, "a") == {"base": "solid", "cup": "cup"}
    assert restored(cache, tmp_path, "b") is None


@pytest.mark.parametrize("folder", ["files", "entries"])
@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data.replace(b"s", b"z"), lambda _: b""])
def test_damage_is_noticed_and_the_entry_made_again(cache, tmp_path, folder, damage):
    stored(cache, tmp_path, "a", base="solid", cup="sup")
    for path in (cache.folder / folder).iterdir():
        path.write_bytes(damage(path.read_bytes()))
    assert restored(cache, tmp_path, "a") is None
    shutil.rmtree(tmp_path / "source_a")
    stored(cache, tmp_path, "a", base="solid", cup="sup")
    assert restored(cache, tmp_path, "a") == {"base": "solid", "cup": "sup"}


def test_an_entry_that_names_a_file_elsewhere_is_not_followed(cache, tmp_path):
    stored(cache, tmp_path, "a", base="solid")
    content = {"files": {"../stray": module.hashlib.sha256(b"solid").hexdigest()}, "values": {}}
    entry = {"digest": module._digest(content), "content": content}
    (cache.folder / "entries" / "a.json").write_text(module.json.dumps(entry))
    assert restored(cache, tmp_path, "a") is None and not (tmp_path / "stray").exists()


def test_what_was_used_longest_ago_goes_first_and_the_size_is_bounded(cache, tmp_path):
    for k, key in enumerate("abc"):
        stored(cache, tmp_path, key, base=key * 300, shared="s" * 90)
        os.utime(cache.folder / "entries" / f"{key}.json", (1000 + k, 1000 + k))
    assert restored(cache, tmp_path, "a") is not None  # used now: younger than b
    stored(cache, tmp_path, "d", base="d" * 300, shared="s" * 90)
    assert restored(cache, tmp_path, "b") is None
    assert all(restored(cache, tmp_path, key) is not None for key in "acd")
    assert sum(path.stat().st_size for path in (cache.folder / "files").iterdir()) <= 1000


def test_a_file_system_without_locks_has_a_cache_too(cache, tmp_path, monkeypatch):
    def no_lock(*_: object) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(module.fcntl, "flock", no_lock)
    stored(cache, tmp_path, "a", base="solid")
    assert restored(cache, tmp_path, "a") == {"base": "solid"}


def test_processes_that_keep_at_once_lose_nothing_of_each_other(cache, tmp_path, monkeypatch):
    fork = multiprocessing.get_context("fork")
    begun = fork.Event()

    def keep_and_trim():
        begun.wait()
        cache.keep("other", {"cup": b"cup"}, {})

    def entry_written_late(path, data, write=module._write):
        if path.parent.name == "entries":
            begun.set()
            other.join(0.5)  # it ends here unless it waits for this process
        write(path, data)

    other = fork.Process(target=keep_and_trim)
    other.start()
    monkeypatch.setattr(module, "_write", entry_written_late)
    stored(cache, tmp_path, "a", base="solid")
    other.join()
    assert restored(cache, tmp_path, "a") == {"base": "solid"}
    assert restored(cache, tmp_path, "other") == {"cup": "cup"}


def test_the_key_covers_parameters_code_and_libraries(cache, tmp_path, monkeypatch):
    params = EndcapParams(130, 8)
    variants = [
        Variant(MoldLayout(params)),
        Variant(MoldLayout(params, 0.2)),
        Variant(MoldLayout(params, 0.1, "Ecoflex 00-30")),
        Variant(MoldLayout(params), "blank"),
    ]
    variants.append(Variant(MoldLayout(EndcapParams(130, 8.5))))
    keys = {cache.key("molds", variant.identity) for variant in variants}
    assert len(keys) == len(variants)
    copy = tmp_path / "copy"
    for name in ("cad", "fab"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    before = code_digest(copy)
    assert before == code_digest(ROOT)
    (copy / "cad" / "bought.csv").open("a").write("\n")
    code_digest.cache_clear()
    assert code_digest(copy) != before
    monkeypatch.setattr(module.metadata, "version", lambda name: "0.0")
    code_digest.cache_clear()
    assert code_digest(ROOT) != before
    code_digest.cache_clear()


def test_the_code_digest_covers_every_kind_of_file_of_the_packages():
    found = {path.suffix for name in SOURCES for path in (ROOT / name).rglob("*") if path.is_file()}
    assert found - {".pyc", ".nbi", ".nbc", ".typed"} == set(SUFFIXES)  # not what Python and numba compile


@pytest.mark.parametrize("name", ["viewer.js", "index_page.css"])
def test_a_change_of_the_page_changes_the_code_digest(tmp_path, name):
    folder = tmp_path / "fab" / "exports"
    shutil.copytree(ROOT / "fab" / "exports", folder)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    before = code_digest.__wrapped__(tmp_path)
    (folder / name).open("a").write("\n")
    assert code_digest.__wrapped__(tmp_path) != before


def test_a_full_destination_is_an_error_and_leaves_the_entry(cache, tmp_path):
    stored(cache, tmp_path, "a", base="solid", cup="cup")
    full = tmp_path / "full"
    full.mkdir()
    (full / "cup").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        cache.restore("a", full)
    assert list(full.iterdir()) == []
    assert restored(cache, tmp_path, "a") == {"base": "solid", "cup": "cup"}


def test_a_user_without_a_home_has_no_cache_and_no_error(tmp_path, monkeypatch):
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    stored(Cache(), tmp_path, "k", a="1")
    assert Cache().read("k") is None
    Cache().clear()


def test_a_cache_that_cannot_be_written_fails_nothing(tmp_path):
    (tmp_path / "file").write_text("in the way")
    cache = Cache(tmp_path / "file" / "cache")
    stored(cache, tmp_path, "a", base="solid")
    assert restored(cache, tmp_path, "a") is None
