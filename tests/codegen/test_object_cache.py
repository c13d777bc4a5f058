"""Machine code on disk is run only where nobody else can have written it: all else is compiled anew, and said once."""

import hashlib
import os
import stat
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest

from gauss.codegen import file_trust, object_cache, trace
from gauss.errors import CacheWarning

CODE = b"machine code" * 100
OTHER = b"another code" * 100

pytestmark = pytest.mark.skipif(not file_trust.HAS_OWNERS, reason="there are no owners and modes here")
AS_ROOT = pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root gives files away")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Folder of its own, of which nothing has been said yet."""
    found = tmp_path / "cache"
    monkeypatch.setenv("GAUSS_CACHE", str(found))
    monkeypatch.setattr(file_trust, "_warned", set())
    return found


@pytest.fixture
def kept(place):
    """Path of a file that was kept, and its name."""
    name = object_cache.key("about", "text")
    object_cache.write(name, CODE)
    assert object_cache.read(name) == CODE
    return place / name


def test_what_is_kept_is_for_this_user_alone(kept):
    for path, mode in ((kept.parent, 0o700), (kept, 0o600), (kept.parent / file_trust.KEY_FILE, 0o600)):
        assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o720, 0o702, 0o1777])
def test_a_folder_that_others_may_write_to_is_not_used(mode, kept):
    kept.parent.chmod(mode)
    with pytest.warns(CacheWarning, match="go-w"):
        assert object_cache.read(kept.name) is None
    before = sorted(path.name for path in kept.parent.iterdir())
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it has been said
        object_cache.write(object_cache.key("more"), CODE)
        assert object_cache.read(kept.name) is None
    assert sorted(path.name for path in kept.parent.iterdir()) == before


@pytest.mark.parametrize("mode", [0o755, 0o750, 0o500])
def test_a_folder_that_others_may_only_read_is_used(mode, kept):
    kept.parent.chmod(mode)
    assert object_cache.read(kept.name) == CODE


@pytest.mark.parametrize("mode", [0o666, 0o620, 0o602])
def test_a_file_that_others_may_write_to_is_not_run_and_is_replaced(mode, kept):
    kept.chmod(mode)
    with pytest.warns(CacheWarning):
        assert object_cache.read(kept.name) is None
    object_cache.write(kept.name, CODE)
    assert object_cache.read(kept.name) == CODE and stat.S_IMODE(kept.stat().st_mode) == 0o600


@AS_ROOT
@pytest.mark.parametrize("what", ["file", "folder", "key"])
def test_what_somebody_else_owns_is_not_used(what, kept):
    os.chown({"file": kept, "folder": kept.parent, "key": kept.parent / file_trust.KEY_FILE}[what], 12345, -1)
    with pytest.warns(CacheWarning) as said:
        assert object_cache.read(kept.name) is None
    assert "chmod" not in str(said[0].message)  # only the owner can


def test_a_link_is_not_followed(kept, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    kept.rename(elsewhere)
    kept.symlink_to(elsewhere)
    assert object_cache.read(kept.name) is None
    object_cache.write(kept.name, OTHER)
    assert object_cache.read(kept.name) == OTHER and not kept.is_symlink()
    assert CODE in elsewhere.read_bytes()  # what the link led to was not written to


def test_a_file_that_is_changed_after_it_was_opened_is_not_read(kept, monkeypatch, tmp_path):
    """What is looked at is what is read: a swap between the two is without effect, or leaves nothing that is run."""
    foreign, looked = tmp_path / "foreign", os.fstat
    foreign.write_bytes(b"not for you")

    def swapped(handle):
        os.replace(foreign, kept)
        monkeypatch.setattr(os, "fstat", looked)
        return looked(handle)

    monkeypatch.setattr(os, "fstat", swapped)
    assert file_trust.read_own(kept).endswith(CODE)
    assert object_cache.read(kept.name) is None


@pytest.mark.parametrize("length", [0, 1, len(object_cache.MAGIC), len(object_cache.MAGIC) + object_cache.SEAL_BYTES, -1])
def test_a_truncated_file_is_not_run(length, kept):
    kept.write_bytes(kept.read_bytes()[:length])
    assert object_cache.read(kept.name) is None


def test_a_payload_whose_checksum_was_made_anew_is_not_run(kept):
    """Whoever does not know the key can make no seal, by the scheme of before or by that of today."""
    for magic in (b"gauss kernel 1\n", object_cache.MAGIC):
        for digest in (
            hashlib.sha256(kept.name.encode() + OTHER).digest(),
            object_cache._seal(b"\0" * 32, kept.name, OTHER),
        ):
            kept.write_bytes(magic + digest + OTHER)
            assert object_cache.read(kept.name) is None


def test_a_file_under_another_name_is_not_run(kept):
    other = object_cache.key("something", "else")
    kept.rename(kept.parent / other)
    assert object_cache.read(other) is None


@pytest.mark.parametrize("spoil", ["gone", "short", "readable", "link", "folder"])
def test_a_key_that_is_lost_or_known_to_others_seals_nothing(spoil, kept, tmp_path):
    """Another one is made with the next file; what the old one sealed is compiled anew."""
    path = kept.parent / file_trust.KEY_FILE
    before = path.read_bytes()
    if spoil == "readable":
        path.chmod(0o644)
    elif spoil == "short":
        path.write_bytes(before[:-1])
    else:
        path.unlink()
    if spoil == "link":
        (tmp_path / "known").write_bytes(before)
        path.symlink_to(tmp_path / "known")
    if spoil == "folder":
        path.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CacheWarning)
        assert object_cache.read(kept.name) is None
        object_cache.write(kept.name, OTHER)
        assert object_cache.read(kept.name) == (None if spoil == "folder" else OTHER)
    if spoil != "folder":
        assert path.read_bytes() != before and stat.S_IMODE(path.lstat().st_mode) == 0o600


@pytest.mark.parametrize("links", [True, False])
def test_of_keys_made_at_once_one_counts(place, links, monkeypatch):
    place.mkdir(mode=0o700)
    if not links:
        monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(OSError("no hard links")))
    with ThreadPoolExecutor(8) as pool:
        found = set(pool.map(lambda _: file_trust.obtain_key(place), range(8)))
    assert file_trust.read_key(place) in found
    assert len(found) == 1 or not links
    assert [path.name for path in place.iterdir()] == [file_trust.KEY_FILE]


def test_things_that_are_no_files_are_not_waited_for(kept):
    kept.unlink()
    os.mkfifo(kept)
    assert object_cache.read(kept.name) is None
    kept.unlink()
    kept.mkdir()
    assert object_cache.read(kept.name) is None


def test_machine_code_runs_as_well_without_a_cache_that_can_be_used(place):
    place.mkdir()
    place.chmod(0o777)
    with pytest.warns(CacheWarning):
        assert trace(lambda x: [x[0] * 7.25], 1)([2.0]) == 14.5
    assert list(place.iterdir()) == []
