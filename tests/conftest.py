"""Settings shared by all tests."""

import gc
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # pytest-xdist already uses every core
os.environ.setdefault("GAUSS_TIER", "quick")  # the tiers give the same digits (codegen/test_tiers.py)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from tests.support import shape_checks  # noqa: E402

shape_checks.install()  # before the first module of the package is imported

from gauss.codegen import disk_cache, gc_pause  # noqa: E402

settings.register_profile("gauss", deadline=None, derandomize=True)
settings.load_profile("gauss")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Tests and modules are no garbage: neither while they are collected nor afterwards are they looked through for it."""
    with gc_pause():
        collected = yield
    gc.freeze()
    return collected


@pytest.fixture(autouse=True)
def _code_of_the_sources(request):
    """A test that replaces parts of the package neither reads nor leaves code on disk that other processes trust."""
    if "monkeypatch" not in request.fixturenames or request.node.get_closest_marker("disk") is not None:
        yield
        return
    with pytest.MonkeyPatch.context() as replaced:  # the fixture, were it asked for here, would be one of every test
        replaced.setattr(disk_cache, "package_digest", lambda: None)
        yield
